#include "ht_contracts.h"
#include "ht_leg_loss.c"
#include "ht_tables.c"
#include "ht_vsd.c"
#include "prove.h"

#include <stddef.h>

void ht_applied_high(const ht_applied *a, const ht_toggles *toggles, ht_six *high)
{
    (void)a;
    (void)toggles;
    *high = any_six();
}

/* What is named is a switch. */
void prove_leg_loss_judged(void)
{
    ht_leg_loss_state st;
    int n;
    for (n = 0; n < HT_LEGS; n++) {
        st.leg[n].upper_V = nondet_float();
        st.leg[n].lower_V = nondet_float();
    }
    MUST(judged(&st, nondet_float()) <= HT_SWITCHES);
}

static uint16_t promise_judged(const ht_leg_loss_state *st, float enough_V)
{
    uint16_t found = nondet_uint16();
    (void)st;
    (void)enough_V;
    GIVEN(found <= HT_SWITCHES);
    return found;
}

/* One period from any state that an earlier one can have left. */
void prove_leg_loss(void)
{
    ht_leg_loss_config cfg;
    ht_leg_loss_state st;
    ht_leg_loss_state was;
    ht_leg_loss_period in;
    ht_xy v = any_xy();
    ht_xy to = any_xy();
    ht_six begin_A = any_six();
    ht_six end_A = any_six();
    uint16_t leg = nondet_uint16();
    int n;
    cfg.winding = (ht_winding)nondet_uint16();
    GIVEN((unsigned)cfg.winding < HT_WINDINGS);
    cfg.least_V2 = nondet_float();
    cfg.gain = nondet_float();
    cfg.l_per_ts_ohm = nondet_float();
    cfg.sum_A = nondet_float();
    cfg.zero_A = nondet_float();
    cfg.hold = nondet_uint16();
    cfg.wait = nondet_uint16();
    in.applied = NULL;
    in.toggles = NULL;
    in.begin_A = &begin_A;
    in.end_A = &end_A;
    in.vdc_V = nondet_float();
    in.rs_ohm = nondet_float();
    st.low_V = any_xy();
    st.low_V2 = nondet_float();
    st.low_A2 = nondet_float();
    st.tolerance_ohm2 = nondet_float();
    st.count = nondet_uint16();
    st.wait = nondet_uint16();
    st.found = nondet_uint16();
    for (n = 0; n < HT_LEGS; n++) {
        st.leg[n].upper_V = nondet_float();
        st.leg[n].lower_V = nondet_float();
        st.leg[n].sum_A = nondet_float();
        GIVEN((st.leg[n].upper_V >= 0.0f) && (st.leg[n].lower_V >= 0.0f));
    }
    st.without = nondet_uint16();
    st.sum_V = any_xy();
    st.fit.both_VA = nondet_float();
    st.fit.change_A2 = nondet_float();
    st.fit.residual_V2 = nondet_float();
    st.more_ohm = nondet_float();
    st.learnt = nondet_bool();
    GIVEN((cfg.hold >= 1u) && (cfg.hold < 0xFFFFu) && (st.count <= (cfg.hold + 1u))
          && (st.wait <= cfg.wait) && (cfg.wait >= 1u));
    GIVEN((st.found <= HT_SWITCHES) && (leg < 6u));
    was = st;
    ht_leg_loss_step(&cfg, &st, &in, v, any_xy(), to);
    MUST((st.count <= (cfg.hold + 1u)) && (st.wait <= cfg.wait));
    MUST(st.found <= HT_SWITCHES);
    MUST((st.leg[leg].upper_V >= 0.0f) && (st.leg[leg].lower_V >= 0.0f)); /* never NaN */
    MUST(IMPLIES(was.found != 0u, st.found == was.found));                /* the first one counts */
    MUST(IMPLIES(st.found != was.found, (was.count == (cfg.hold + 1u)) && (was.wait <= 1u)));
    /* Not a number shows no loss: other checks see it. */
    MUST(IMPLIES(is_nan(v.x) || is_nan(to.y), (st.found == was.found) && (st.count == 0u)));
    MUST(IMPLIES(is_nan(end_A.p[3]), st.found == was.found));
    MUST(st.without == was.without);
    /* Where something was learnt since the residual became large, the leg that is named counts. */
    MUST(IMPLIES(was.learnt, (st.more_ohm == was.more_ohm) || is_nan(was.more_ohm)));
}

/* What is learnt of L_xy is within its limits, and never NaN. */
void prove_leg_loss_learnt(void)
{
    ht_leg_loss_config cfg;
    ht_leg_loss_state st;
    float had_ohm = nondet_float();
    bool learnt;
    cfg.l_per_ts_ohm = nondet_float();
    GIVEN(cfg.l_per_ts_ohm > 0.0f);
    st.fit.both_VA = nondet_float();
    st.fit.change_A2 = nondet_float();
    st.fit.residual_V2 = nondet_float();
    st.more_ohm = had_ohm;
    learnt = explained(&cfg, &st);
    MUST(IMPLIES(learnt, !is_nan(st.more_ohm)));
    MUST(IMPLIES(!learnt, (st.more_ohm == had_ohm) || is_nan(had_ohm)));
}

void prove_leg_loss_begin(void)
{
    ht_leg_loss_state st;
    ht_leg_loss_reset(&st);
    MUST((st.count == 0u) && (st.wait == 0u) && (st.found == 0u));
    MUST(st.without == 0u);
    MUST((st.leg[5].upper_V == 0.0f) && (st.leg[5].lower_V == 0.0f));
    MUST((st.more_ohm == 0.0f) && !st.learnt);
    MUST((st.low_V.x == 0.0f) && (st.low_V.y == 0.0f) && (st.low_A2 == 0.0f)
         && (st.low_V2 == 0.0f));
    ht_leg_loss_tolerate(&st, nondet_float(), nondet_float(), nondet_float());
    MUST(!(st.tolerance_ohm2 < 0.0f)); /* it never makes a residual count that is too small */
}

/* Each number is one switch of one leg. */
void prove_leg_loss_of(void)
{
    uint16_t found = nondet_uint16();
    ht_leg_loss loss;
    GIVEN((found >= 1u) && (found <= HT_SWITCHES));
    loss = ht_leg_loss_of(found);
    MUST(loss.leg < HT_LEGS);
    MUST(found == (1u + 2u * loss.leg + (loss.lower ? 1u : 0u)));
}
