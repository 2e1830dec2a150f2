#include "ht_magnet_observer.h"

#include "ht_limited.h"
#include "ht_turned.h"

#include <math.h>

/* R_s is told where the induced voltage is below half of the drop, squared: there a psi_f that is 8 %
 * wrong moves R_s by 4 %, ... */
#define ADAPT_TURNED2 0.25f
/* ... and the flux above four times the drop, squared. It loses 0.1 to 0.2 % a kelvin. */
#define ADAPT_FLUX_TURNED2 16.0f
#define ADAPT_FLUX 0.25f /* of the configured one, at most */

void ht_magnet_adapt(const ht_observer_config *cfg, ht_observer_state *st, float gain)
{
    ht_ab i = st->i_A;
    float turned_V = st->omega_sync_rad_s * cfg->magnet.psi_f_Wb;
    float drop2 = st->rs_ohm * st->rs_ohm * (i.alpha * i.alpha + i.beta * i.beta);
    if (!(gain > 0.0f)) {
        st->rs_ohm = cfg->rs_ohm;
    } else if (turned_V * turned_V < ADAPT_TURNED2 * drop2) {
        ht_observer_adapt_rs(cfg, st, gain);
    } else {
        /* psi_f and R_s cannot be told apart */
    }
}

void ht_magnet_adapt_flux(const ht_observer_config *cfg, ht_observer_state *st, float gain,
                          float least_V)
{
    ht_ab i = st->i_A;
    ht_ab r = st->psi_r_Wb;
    float r2 = r.alpha * r.alpha + r.beta * r.beta;
    float turned2 = st->omega_sync_rad_s * st->omega_sync_rad_s * r2;
    float drop2 = st->rs_ohm * st->rs_ohm * (i.alpha * i.alpha + i.beta * i.beta);
    float most = ADAPT_FLUX * cfg->magnet.psi_f_Wb;
    if (!(gain > 0.0f)) {
        st->more_Wb = 0.0f;
    } else if ((turned2 > ADAPT_FLUX_TURNED2 * drop2) && (turned2 > least_V * least_V)) {
        ht_ab e = ht_observer_disagreement_V(cfg, st);
        float off_Wb = ht_across(r, e) / (st->omega_sync_rad_s * sqrtf(r2));
        st->more_Wb = ht_between(st->more_Wb + gain * off_Wb, -most, most); /* one write, too */
    } else {
        /* too little to tell */
    }
}

ht_estimate ht_magnet_update(const ht_observer_config *cfg, ht_observer_state *st, ht_ab v_V,
                             ht_ab i_A, float turn_rad, ht_ab axis, float inv_psi_ref2)
{
    float half_rs = 0.5f * st->rs_ohm;
    float r = ht_magnet_active_Wb(&cfg->magnet, axis, i_A) + st->more_Wb;
    ht_estimate now;
    ht_ab psi;
    (void)inv_psi_ref2;
    psi.alpha = st->psi_Wb.alpha + cfg->ts_s * (v_V.alpha - half_rs * (st->i_A.alpha + i_A.alpha));
    psi.beta = st->psi_Wb.beta + cfg->ts_s * (v_V.beta - half_rs * (st->i_A.beta + i_A.beta));
    st->psi_r_Wb.alpha = r * axis.alpha;
    st->psi_r_Wb.beta = r * axis.beta;
    st->gap_Wb.alpha = psi.alpha - st->psi_r_Wb.alpha - cfg->sigma_ls_H * i_A.alpha;
    st->gap_Wb.beta = psi.beta - st->psi_r_Wb.beta - cfg->sigma_ls_H * i_A.beta;
    psi.alpha -= cfg->hybrid_gain * st->gap_Wb.alpha;
    psi.beta -= cfg->hybrid_gain * st->gap_Wb.beta;
    st->psi_Wb = psi;
    st->i_A = i_A;
    st->omega_sync_rad_s += cfg->omega_gain * (turn_rad * cfg->inv_ts - st->omega_sync_rad_s);
    now.psi_Wb = psi;
    now.torque_Nm = cfg->torque_gain * ht_across(psi, i_A);
    return now;
}

void ht_magnet_align(const ht_observer_config *cfg, ht_observer_state *st, ht_ab i_A, ht_ab axis)
{
    float r = ht_magnet_active_Wb(&cfg->magnet, axis, i_A);
    ht_observer_reset(cfg, st, i_A);
    st->psi_r_Wb.alpha = r * axis.alpha;
    st->psi_r_Wb.beta = r * axis.beta;
    st->psi_Wb.alpha = st->psi_r_Wb.alpha + cfg->sigma_ls_H * i_A.alpha;
    st->psi_Wb.beta = st->psi_r_Wb.beta + cfg->sigma_ls_H * i_A.beta;
}

ht_estimate ht_magnet_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                              ht_estimate now, ht_ab v_V, ht_ab i_A, ht_ab axis, ht_ab *rotor_Wb)
{
    float turn = cfg->ts_s * st->omega_sync_rad_s;
    ht_ab ahead = ht_turned(axis, turn);
    ht_ab r;
    ht_estimate next;
    float grows;
    next.psi_Wb.alpha = now.psi_Wb.alpha + cfg->ts_s * (v_V.alpha - st->rs_ohm * i_A.alpha);
    next.psi_Wb.beta = now.psi_Wb.beta + cfg->ts_s * (v_V.beta - st->rs_ohm * i_A.beta);
    r.alpha = now.psi_Wb.alpha - cfg->sigma_ls_H * i_A.alpha;
    r.beta = now.psi_Wb.beta - cfg->sigma_ls_H * i_A.beta;
    r = ht_turned(r, turn);
    grows = cfg->magnet.share * (ht_along(ahead, next.psi_Wb) - ht_along(axis, now.psi_Wb));
    r.alpha += grows * ahead.alpha;
    r.beta += grows * ahead.beta;
    *rotor_Wb = r;
    next.torque_Nm = cfg->torque_gain * cfg->inv_sigma_ls * ht_across(r, next.psi_Wb);
    return next;
}
