#include "ht_contracts.h"
#include "ht_observer.c"
#include "prove.h"

static void any_observer(ht_observer_config *cfg, ht_observer_state *st)
{
    cfg->kind = (ht_observer_kind)nondet_uint16();
    cfg->ts_s = nondet_float();
    cfg->inv_ts = nondet_float();
    cfg->rs_ohm = nondet_float();
    cfg->sigma_ls_H = nondet_float();
    cfg->inv_sigma_ls = nondet_float();
    cfg->lxy_H = nondet_float();
    cfg->torque_gain = nondet_float();
    cfg->hybrid_gain = nondet_float();
    cfg->rotor_decay = nondet_float();
    cfg->rotor_drive = nondet_float();
    cfg->lm_over_lr = nondet_float();
    cfg->omega_gain = nondet_float();
    st->psi_Wb = any_ab();
    st->psi_r_Wb = any_ab();
    st->gap_Wb = any_ab();
    st->i_dc_A = any_ab();
    st->i_A = any_ab();
    st->omega_sync_rad_s = nondet_float();
    st->rs_ohm = nondet_float();
    st->rr_scale = nondet_float();
    GIVEN((unsigned)cfg->kind < HT_OBSERVERS);
    GIVEN((cfg->rs_ohm >= 0.0f) && (cfg->rs_ohm <= 1000.0f));
}

/* Whatever a sensor or the estimate shows. */
void prove_observer_nan(void)
{
    ht_observer_config cfg;
    ht_observer_state st;
    ht_estimate now;
    ht_ab v = any_ab();
    ht_ab i = any_ab();
    bool alpha;
    bool beta;
    any_observer(&cfg, &st);
    alpha = is_nan(v.alpha) || is_nan(i.alpha) || is_nan(st.psi_Wb.alpha);
    beta = is_nan(v.beta) || is_nan(i.beta) || is_nan(st.psi_Wb.beta);
    now = ht_observer_update(&cfg, &st, v, i, nondet_float(), nondet_float());
    MUST(IMPLIES(alpha, is_nan(now.psi_Wb.alpha) && is_nan(st.psi_Wb.alpha)));
    MUST(IMPLIES(beta, is_nan(now.psi_Wb.beta) && is_nan(st.psi_Wb.beta)));
    MUST(IMPLIES(alpha || beta, is_nan(now.torque_Nm)));
    now = ht_observer_predict(&cfg, &st, now, any_ab(), i);
    MUST(IMPLIES(alpha || beta, is_nan(now.torque_Nm)));
    MUST(IMPLIES(alpha, is_nan(now.psi_Wb.alpha)));
}

void prove_observer_adapt(void)
{
    ht_observer_config cfg;
    ht_observer_state st;
    float gain = nondet_float();
    any_observer(&cfg, &st);
    ht_most[0][0] = ADAPT_MOST;
    ht_most[0][1] = 1000.0f;
    GIVEN((st.rs_ohm >= 0.0f) && is_finite(st.rs_ohm));
    GIVEN((st.rr_scale >= ADAPT_LEAST) && (st.rr_scale <= ADAPT_MOST));
    ht_observer_adapt(&cfg, &st, gain);
    MUST((st.rr_scale >= ADAPT_LEAST) && (st.rr_scale <= ADAPT_MOST));
    MUST((st.rs_ohm >= 0.0f) && is_finite(st.rs_ohm));
    MUST(IMPLIES(!(gain > 0.0f), (st.rs_ohm == cfg.rs_ohm) && (st.rr_scale == 1.0f)));
}
