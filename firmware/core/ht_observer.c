#include "ht_observer.h"

static float cross(ht_ab p, ht_ab q)
{
    return p.alpha * q.beta - p.beta * q.alpha;
}

/* Compensated: corner of the dc filter and strength of the pull, relative to the
 * flux's speed. 0.1 leaves (0.1)^2 sigma L_s i of the fundamental, 0.15 % of psi. */
#define DC_RATIO 0.1f
/* Adaptation: fades out above this flux speed, ... */
#define ADAPT_RAD_S 60.0f
/* ... a trace weaker than this voltage counts for little, ... */
#define ADAPT_V 0.3f
/* ... R_r is left alone below this load, |i_q/i_d| squared: it matters little there, and
 * the least thing that the models leave out, devices' drops say, would drive it far, ... */
#define ADAPT_LOAD2 0.16f
/* ... and no resistance leaves 0.5 .. 1.6 of its configured value: copper from
 * -40 to 180 degC spans 0.76 .. 1.63 of its value at 20 degC. */
#define ADAPT_LEAST 0.5f
#define ADAPT_MOST 1.6f

void ht_observer_reset(const ht_observer_config *cfg, ht_observer_state *st, const ht_vsd *i)
{
    const ht_ab none = {0.0f, 0.0f};
    st->psi_Wb = none;
    st->psi_r_Wb = none;
    st->gap_Wb = none;
    st->i_dc_A = none;
    st->i_prev_A = *i;
    st->omega_sync_rad_s = 0.0f;
    st->rs_ohm = cfg->rs_ohm;
    st->rr_scale = 1.0f;
}

/* exp(j turn) to third order, whose gain 1 - turn^4/24 stays below one;
 * those of first and second order would blow up by turn^2/2 and turn^4/8 a step,
 * which at high speed is not small against the decay. */
static ht_ab rotated(ht_ab p, float turn)
{
    float cosine = 1.0f - 0.5f * turn * turn;
    float sine = turn * (1.0f - turn * turn * (1.0f / 6.0f));
    ht_ab q;
    q.alpha = cosine * p.alpha - sine * p.beta;
    q.beta = cosine * p.beta + sine * p.alpha;
    return q;
}

/* Pull against the dc part of the currents. */
static void pull_against_dc(const ht_observer_config *cfg, ht_observer_state *st, const ht_vsd *i)
{
    float speed = (st->omega_sync_rad_s < 0.0f) ? -st->omega_sync_rad_s : st->omega_sync_rad_s;
    float gain = DC_RATIO * speed * cfg->ts_s;
    float pull;
    gain = (gain < 1.0f) ? gain : 1.0f; /* NaN counts as 1: it must not hide in the filter */
    pull = gain * cfg->sigma_ls_H;
    st->i_dc_A.alpha += gain * (i->ab.alpha - st->i_dc_A.alpha);
    st->i_dc_A.beta += gain * (i->ab.beta - st->i_dc_A.beta);
    st->psi_Wb.alpha += pull * st->i_dc_A.alpha;
    st->psi_Wb.beta += pull * st->i_dc_A.beta;
}

/* Rotor flux of the current model over one period, and the pull of the stator
 * flux towards it. */
static void pull_to_current_model(const ht_observer_config *cfg, ht_observer_state *st,
                                  const ht_vsd *i, float turn)
{
    float half = 0.5f * cfg->rotor_drive * st->rr_scale;
    float keep = 1.0f - cfg->rotor_decay * st->rr_scale;
    ht_ab r;
    ht_ab gap;
    /* What the rotor's flux had at the period's start turns with the rotor. */
    r.alpha = keep * st->psi_r_Wb.alpha + half * st->i_prev_A.ab.alpha;
    r.beta = keep * st->psi_r_Wb.beta + half * st->i_prev_A.ab.beta;
    r = rotated(r, turn);
    r.alpha += half * i->ab.alpha;
    r.beta += half * i->ab.beta;
    gap.alpha = st->psi_Wb.alpha - cfg->lm_over_lr * r.alpha - cfg->sigma_ls_H * i->ab.alpha;
    gap.beta = st->psi_Wb.beta - cfg->lm_over_lr * r.beta - cfg->sigma_ls_H * i->ab.beta;
    st->psi_r_Wb = r;
    st->gap_Wb = gap;
    st->psi_Wb.alpha -= cfg->hybrid_gain * gap.alpha;
    st->psi_Wb.beta -= cfg->hybrid_gain * gap.beta;
}

static float clamp(float value, float least, float most)
{
    /* NaN goes to `least`. */
    return (value > most) ? most : ((value > least) ? value : least);
}

void ht_observer_adapt(const ht_observer_config *cfg, ht_observer_state *st, float gain)
{
    ht_ab i = st->i_prev_A.ab;
    ht_ab r = st->psi_r_Wb;
    ht_ab h;
    ht_ab e; /* (g0 + j w) D */
    float g0 = cfg->hybrid_gain * cfg->inv_ts;
    float omega = st->omega_sync_rad_s;
    float i2 = i.alpha * i.alpha + i.beta * i.beta;
    float along = r.alpha * i.alpha + r.beta * i.beta;
    float across = cross(r, i);
    float fade = ADAPT_RAD_S * ADAPT_RAD_S / (ADAPT_RAD_S * ADAPT_RAD_S + omega * omega);
    float scale;
    float share;
    float weight = gain * (fade * fade);
    float rs_ohm = st->rs_ohm;
    float rr_scale = st->rr_scale;
    if (!(gain > 0.0f)) {
        st->rs_ohm = cfg->rs_ohm;
        st->rr_scale = 1.0f;
        return;
    }
    share = along * along + across * across; /* |psi_r|^2 |i|^2 */
    if (!(share > 0.0f)) {
        return;
    }
    /* x/(1 + j x) = across (along - j across) / (along^2 + across^2) */
    scale = omega * cfg->lm_over_lr * across / share;
    h.alpha = scale * (along * r.alpha + across * r.beta);
    h.beta = scale * (along * r.beta - across * r.alpha);
    e.alpha = g0 * st->gap_Wb.alpha - omega * st->gap_Wb.beta;
    e.beta = g0 * st->gap_Wb.beta + omega * st->gap_Wb.alpha;
    rs_ohm += weight * (e.alpha * i.alpha + e.beta * i.beta) * cfg->rs_ohm
              / (i2 * cfg->rs_ohm + ADAPT_V * ADAPT_V / cfg->rs_ohm);
    if (across * across > ADAPT_LOAD2 * along * along) {
        rr_scale -= weight * (e.alpha * h.alpha + e.beta * h.beta)
                    / (h.alpha * h.alpha + h.beta * h.beta + ADAPT_V * ADAPT_V);
    }
    /* One write each: the fast interrupt may come in between. */
    st->rs_ohm = clamp(rs_ohm, ADAPT_LEAST * cfg->rs_ohm, ADAPT_MOST * cfg->rs_ohm);
    st->rr_scale = clamp(rr_scale, ADAPT_LEAST, ADAPT_MOST);
}

ht_estimate ht_observer_update(const ht_observer_config *cfg, ht_observer_state *st,
                               const ht_vsd *v_V, const ht_vsd *i, float turn_rad,
                               float inv_psi_ref2)
{
    ht_estimate now;
    ht_ab old = st->psi_Wb;
    float half_rs = 0.5f * st->rs_ohm;
    float omega;

    st->psi_Wb.alpha +=
        cfg->ts_s * (v_V->ab.alpha - half_rs * (st->i_prev_A.ab.alpha + i->ab.alpha));
    st->psi_Wb.beta += cfg->ts_s * (v_V->ab.beta - half_rs * (st->i_prev_A.ab.beta + i->ab.beta));
    if (cfg->kind == HT_OBSERVER_HYBRID) {
        pull_to_current_model(cfg, st, i, turn_rad);
    } else if (cfg->kind == HT_OBSERVER_COMPENSATED) {
        pull_against_dc(cfg, st, i);
    } else {
        /* as it comes */
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

    next.psi_Wb.alpha = now->psi_Wb.alpha + cfg->ts_s * (v_V->ab.alpha - st->rs_ohm * i->ab.alpha);
    next.psi_Wb.beta = now->psi_Wb.beta + cfg->ts_s * (v_V->ab.beta - st->rs_ohm * i->ab.beta);

    behind.alpha = now->psi_Wb.alpha - cfg->sigma_ls_H * i->ab.alpha;
    behind.beta = now->psi_Wb.beta - cfg->sigma_ls_H * i->ab.beta;
    a = behind.alpha;
    behind.alpha -= turn * behind.beta;
    behind.beta += turn * a;
    i_next.alpha = (next.psi_Wb.alpha - behind.alpha) * cfg->inv_sigma_ls;
    i_next.beta = (next.psi_Wb.beta - behind.beta) * cfg->inv_sigma_ls;

    next.torque_Nm = cfg->torque_gain * cross(next.psi_Wb, i_next);
    next.psi_xy_Wb.x = now->psi_xy_Wb.x + cfg->ts_s * (v_V->xy.x - st->rs_ohm * i->xy.x);
    next.psi_xy_Wb.y = now->psi_xy_Wb.y + cfg->ts_s * (v_V->xy.y - st->rs_ohm * i->xy.y);
    return next;
}
