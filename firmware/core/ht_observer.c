#include "ht_observer.h"

static float cross(ht_ab p, ht_ab q)
{
    return p.alpha * q.beta - p.beta * q.alpha;
}

void ht_observer_reset(ht_observer_state *st, const ht_vsd *i)
{
    st->psi_Wb.alpha = 0.0f;
    st->psi_Wb.beta = 0.0f;
    st->psi_r_Wb.alpha = 0.0f;
    st->psi_r_Wb.beta = 0.0f;
    st->i_prev_A = *i;
    st->omega_sync_rad_s = 0.0f;
}

/* Rotor flux of the current model over one period, and the pull of the stator
 * flux towards it. The rotation is of third order, whose gain 1 - t^4/24 stays
 * below one; those of first and second order would blow up by t^2/2 and t^4/8 a
 * step, which at high speed is not small against the decay. */
static void hybrid_correct(const ht_observer_config *cfg, ht_observer_state *st, const ht_vsd *i,
                           float omega_r)
{
    float turn = omega_r * cfg->ts_s;
    float keep = 1.0f - cfg->rotor_decay - 0.5f * turn * turn;
    float half = 0.5f * cfg->rotor_drive;
    float sine = turn * (1.0f - turn * turn * (1.0f / 6.0f));
    ht_ab r = st->psi_r_Wb;
    st->psi_r_Wb.alpha =
        keep * r.alpha - sine * r.beta + half * (st->i_prev_A.ab.alpha + i->ab.alpha);
    st->psi_r_Wb.beta =
        keep * r.beta + sine * r.alpha + half * (st->i_prev_A.ab.beta + i->ab.beta);
    st->psi_Wb.alpha += cfg->hybrid_gain
                        * (cfg->lm_over_lr * st->psi_r_Wb.alpha + cfg->sigma_ls_H * i->ab.alpha
                           - st->psi_Wb.alpha);
    st->psi_Wb.beta += cfg->hybrid_gain
                       * (cfg->lm_over_lr * st->psi_r_Wb.beta + cfg->sigma_ls_H * i->ab.beta
                          - st->psi_Wb.beta);
}

ht_estimate ht_observer_update(const ht_observer_config *cfg, ht_observer_state *st,
                               const ht_vsd *v_V, const ht_vsd *i, float omega_r,
                               float inv_psi_ref2)
{
    ht_estimate now;
    ht_ab old = st->psi_Wb;
    float half_rs = 0.5f * cfg->rs_ohm;
    float omega;

    st->psi_Wb.alpha += cfg->ts_s * (v_V->ab.alpha - half_rs * (st->i_prev_A.ab.alpha + i->ab.alpha));
    st->psi_Wb.beta += cfg->ts_s * (v_V->ab.beta - half_rs * (st->i_prev_A.ab.beta + i->ab.beta));
    if (cfg->hybrid_gain > 0.0f) {
        hybrid_correct(cfg, st, i, omega_r);
    }
    st->i_prev_A = *i;

    /* |psi| is held at its reference, so the reference's square stands in for
     * the division. */
    omega = cross(old, st->psi_Wb) * inv_psi_ref2 * cfg->inv_ts;
    st->omega_sync_rad_s += cfg->omega_gain * (omega - st->omega_sync_rad_s);

    now.psi_Wb = st->psi_Wb;
    now.torque_Nm = cfg->torque_gain * cross(st->psi_Wb, i->ab);
    now.psi_xy_Wb.x = cfg->lxy_H * i->xy.x;
    now.psi_xy_Wb.y = cfg->lxy_H * i->xy.y;
    return now;
}

ht_estimate ht_observer_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                                const ht_estimate *now, const ht_vsd *v_V, const ht_vsd *i)
{
    ht_estimate next;
    ht_ab behind; /* rotor flux seen from the stator */
    ht_ab i_next;
    float turn = cfg->ts_s * st->omega_sync_rad_s;
    float a;

    next.psi_Wb.alpha = now->psi_Wb.alpha + cfg->ts_s * (v_V->ab.alpha - cfg->rs_ohm * i->ab.alpha);
    next.psi_Wb.beta = now->psi_Wb.beta + cfg->ts_s * (v_V->ab.beta - cfg->rs_ohm * i->ab.beta);

    behind.alpha = now->psi_Wb.alpha - cfg->sigma_ls_H * i->ab.alpha;
    behind.beta = now->psi_Wb.beta - cfg->sigma_ls_H * i->ab.beta;
    a = behind.alpha;
    behind.alpha -= turn * behind.beta;
    behind.beta += turn * a;
    i_next.alpha = (next.psi_Wb.alpha - behind.alpha) * cfg->inv_sigma_ls;
    i_next.beta = (next.psi_Wb.beta - behind.beta) * cfg->inv_sigma_ls;

    next.torque_Nm = cfg->torque_gain * cross(next.psi_Wb, i_next);
    next.psi_xy_Wb.x = now->psi_xy_Wb.x + cfg->ts_s * (v_V->xy.x - cfg->rs_ohm * i->xy.x);
    next.psi_xy_Wb.y = now->psi_xy_Wb.y + cfg->ts_s * (v_V->xy.y - cfg->rs_ohm * i->xy.y);
    return next;
}
