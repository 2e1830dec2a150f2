#include "ht_observer.h"

#include "ht_angle.h"
#include "ht_limited.h"
#include "ht_turned.h"

#include <math.h>

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
/* ... and no resistance leaves these shares of its configured value: copper from -40 to 180 degC spans
 * 0.76 .. 1.63 of its value at 20 degC. The stator's may be an estimate from a plate, which is up to 2.2
 * times too small, or of a machine that loses less in the stator than any known one, 3.4 times too large. */
#define ADAPT_LEAST 0.5f
#define ADAPT_MOST 1.6f
#define ADAPT_LEAST_RS 0.25f
#define ADAPT_MOST_RS 2.4f

void ht_observer_reset(const ht_observer_config *cfg, ht_observer_state *st, ht_ab i_A)
{
    const ht_ab none = {0.0f, 0.0f};
    st->psi_Wb = none;
    st->psi_r_Wb = none;
    st->gap_Wb = none;
    st->i_dc_A = none;
    st->i_A = i_A;
    st->omega_sync_rad_s = 0.0f;
    st->rs_ohm = cfg->rs_ohm;
    st->rr_scale = 1.0f;
    st->more_Wb = 0.0f;
}

void ht_observer_stand_still(ht_observer_state *st)
{
    st->omega_sync_rad_s = 0.0f;
}

/* Pull against the dc part of the currents. */
static ht_ab pulled_against_dc(const ht_observer_config *cfg, ht_observer_state *st, ht_ab psi,
                               ht_ab i)
{
    float speed = fabsf(st->omega_sync_rad_s);
    float gain = DC_RATIO * speed * cfg->ts_s;
    float pull;
    gain = (gain < 1.0f) ? gain : 1.0f; /* NaN counts as 1: it must not hide in the filter */
    pull = gain * cfg->sigma_ls_H;
    st->i_dc_A.alpha += gain * (i.alpha - st->i_dc_A.alpha);
    st->i_dc_A.beta += gain * (i.beta - st->i_dc_A.beta);
    psi.alpha += pull * st->i_dc_A.alpha;
    psi.beta += pull * st->i_dc_A.beta;
    return psi;
}

/* Rotor flux of the current model over one period, and the pull of the stator
 * flux towards it. */
static ht_ab pulled_to_current_model(const ht_observer_config *cfg, ht_observer_state *st,
                                     ht_ab psi, ht_ab i, float turn)
{
    float half = 0.5f * cfg->rotor_drive * st->rr_scale;
    float keep = 1.0f - cfg->rotor_decay * st->rr_scale;
    ht_ab r;
    ht_ab gap;
    /* What the rotor's flux had at the period's start turns with the rotor. */
    r.alpha = keep * st->psi_r_Wb.alpha + half * st->i_A.alpha;
    r.beta = keep * st->psi_r_Wb.beta + half * st->i_A.beta;
    r = ht_turned(r, turn);
    r.alpha += half * i.alpha;
    r.beta += half * i.beta;
    gap.alpha = psi.alpha - cfg->lm_over_lr * r.alpha - cfg->sigma_ls_H * i.alpha;
    gap.beta = psi.beta - cfg->lm_over_lr * r.beta - cfg->sigma_ls_H * i.beta;
    st->psi_r_Wb.alpha = r.alpha;
    st->psi_r_Wb.beta = r.beta;
    st->gap_Wb.alpha = gap.alpha;
    st->gap_Wb.beta = gap.beta;
    psi.alpha -= cfg->hybrid_gain * gap.alpha;
    psi.beta -= cfg->hybrid_gain * gap.beta;
    return psi;
}

ht_ab ht_observer_disagreement_V(const ht_observer_config *cfg, const ht_observer_state *st)
{
    float g0 = cfg->hybrid_gain * cfg->inv_ts;
    float omega = st->omega_sync_rad_s;
    ht_ab e;
    e.alpha = g0 * st->gap_Wb.alpha - omega * st->gap_Wb.beta;
    e.beta = g0 * st->gap_Wb.beta + omega * st->gap_Wb.alpha;
    return e;
}

/* How much R_s is to change by what the models disagree about along the current. */
static float change_ohm(const ht_observer_config *cfg, ht_ab e, ht_ab i, float weight)
{
    float i2 = i.alpha * i.alpha + i.beta * i.beta;
    return weight * (e.alpha * i.alpha + e.beta * i.beta) * cfg->rs_ohm
           / (i2 * cfg->rs_ohm + ADAPT_V * ADAPT_V / cfg->rs_ohm);
}

/* One write: the fast interrupt may come in between. */
static void take_ohm(const ht_observer_config *cfg, ht_observer_state *st, float rs_ohm)
{
    st->rs_ohm = ht_between(rs_ohm, ADAPT_LEAST_RS * cfg->rs_ohm, ADAPT_MOST_RS * cfg->rs_ohm);
}

void ht_observer_adapt_rs(const ht_observer_config *cfg, ht_observer_state *st, float weight)
{
    ht_ab e = ht_observer_disagreement_V(cfg, st);
    take_ohm(cfg, st, st->rs_ohm + change_ohm(cfg, e, st->i_A, weight));
}

void ht_observer_begin_with(const ht_observer_config *cfg, ht_observer_state *st, float rs_ohm)
{
    take_ohm(cfg, st, rs_ohm);
}

float ht_observer_adapted_ohm(const ht_observer_config *cfg, const ht_observer_state *st)
{
    float rs_ohm = st->rs_ohm;
    bool within = (rs_ohm > ADAPT_LEAST_RS * cfg->rs_ohm) && (rs_ohm < ADAPT_MOST_RS * cfg->rs_ohm);
    return within ? rs_ohm : 0.0f;
}

void ht_observer_adapt(const ht_observer_config *cfg, ht_observer_state *st, float gain)
{
    ht_ab i = st->i_A;
    ht_ab r = st->psi_r_Wb;
    ht_ab h;
    ht_ab e;
    float omega = st->omega_sync_rad_s;
    float along = r.alpha * i.alpha + r.beta * i.beta;
    float across = ht_across(r, i);
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
    e = ht_observer_disagreement_V(cfg, st);
    rs_ohm += change_ohm(cfg, e, i, weight);
    if (across * across > ADAPT_LOAD2 * along * along) {
        rr_scale -= weight * (e.alpha * h.alpha + e.beta * h.beta)
                    / (h.alpha * h.alpha + h.beta * h.beta + ADAPT_V * ADAPT_V);
    }
    take_ohm(cfg, st, rs_ohm);
    st->rr_scale = ht_between(rr_scale, ADAPT_LEAST, ADAPT_MOST); /* one write, too */
}

ht_estimate ht_observer_update(const ht_observer_config *cfg, ht_observer_state *st, ht_ab v_V,
                               ht_ab i_A, float turn_rad, float inv_psi_ref2)
{
    ht_estimate now;
    ht_ab old = st->psi_Wb;
    ht_ab psi;
    float half_rs = 0.5f * st->rs_ohm;
    float omega;

    psi.alpha = old.alpha + cfg->ts_s * (v_V.alpha - half_rs * (st->i_A.alpha + i_A.alpha));
    psi.beta = old.beta + cfg->ts_s * (v_V.beta - half_rs * (st->i_A.beta + i_A.beta));
    if (cfg->kind == HT_OBSERVER_HYBRID) {
        psi = pulled_to_current_model(cfg, st, psi, i_A, turn_rad);
    } else if (cfg->kind == HT_OBSERVER_COMPENSATED) {
        psi = pulled_against_dc(cfg, st, psi, i_A);
    } else {
        /* the voltage model alone */
    }
    st->psi_Wb.alpha = psi.alpha;
    st->psi_Wb.beta = psi.beta;
    st->i_A.alpha = i_A.alpha;
    st->i_A.beta = i_A.beta;

    /* |psi| is held at its reference, so the reference's square stands in for
     * the division. */
    omega = ht_across(old, psi) * inv_psi_ref2 * cfg->inv_ts;
    st->omega_sync_rad_s += cfg->omega_gain * (omega - st->omega_sync_rad_s);

    now.psi_Wb.alpha = psi.alpha;
    now.psi_Wb.beta = psi.beta;
    now.torque_Nm = cfg->torque_gain * ht_across(psi, i_A);
    return now;
}

#define PI_F 3.14159265f

HT_SELDOM void ht_observer_coast(const ht_observer_config *cfg, ht_observer_state *st,
                                 float turn_rad)
{
    float turns = (0.5f / PI_F) * turn_rad;
    float keep = 1.0f - cfg->rotor_decay * st->rr_scale;
    /* A flux may coast for so long that the error of ht_turned would add up. */
    ht_ab u = ht_unit((turns < 0.0f) ? (1.0f + turns) : turns);
    ht_ab psi;
    /* Of the first period after a current: what is left when the current has gone. */
    psi.alpha = keep * (st->psi_Wb.alpha - cfg->sigma_ls_H * st->i_A.alpha);
    psi.beta = keep * (st->psi_Wb.beta - cfg->sigma_ls_H * st->i_A.beta);
    psi = ht_product(psi, u);
    st->i_A.alpha = 0.0f;
    st->i_A.beta = 0.0f;
    st->psi_Wb = psi;
    st->psi_r_Wb.alpha = psi.alpha / cfg->lm_over_lr;
    st->psi_r_Wb.beta = psi.beta / cfg->lm_over_lr;
}

HT_SELDOM void ht_observer_follow(const ht_observer_config *cfg, ht_observer_state *st, ht_ab i_A,
                                  float turn_rad)
{
    if (cfg->kind != HT_OBSERVER_HYBRID) {
        (void)pulled_to_current_model(cfg, st, st->psi_Wb, i_A, turn_rad);
    }
}

HT_SELDOM ht_estimate ht_observer_pull(const ht_observer_config *cfg, ht_observer_state *st,
                                       float share, float omega_rad_s)
{
    ht_ab i = st->i_A;
    ht_ab psi = st->psi_Wb;
    ht_estimate now;
    psi.alpha -= share
                 * (psi.alpha - cfg->lm_over_lr * st->psi_r_Wb.alpha - cfg->sigma_ls_H * i.alpha);
    psi.beta -= share * (psi.beta - cfg->lm_over_lr * st->psi_r_Wb.beta - cfg->sigma_ls_H * i.beta);
    st->psi_Wb = psi;
    st->omega_sync_rad_s = omega_rad_s;
    now.psi_Wb = psi;
    now.torque_Nm = cfg->torque_gain * ht_across(psi, i);
    return now;
}

ht_ab ht_observer_predict_rotor(const ht_observer_config *cfg, const ht_observer_state *st,
                                ht_ab psi_Wb, ht_ab i_A)
{
    float turn = cfg->ts_s * st->omega_sync_rad_s;
    ht_ab behind;
    ht_ab turned;
    behind.alpha = psi_Wb.alpha - cfg->sigma_ls_H * i_A.alpha;
    behind.beta = psi_Wb.beta - cfg->sigma_ls_H * i_A.beta;
    turned.alpha = behind.alpha - turn * behind.beta;
    turned.beta = behind.beta + turn * behind.alpha;
    return turned;
}

ht_estimate ht_observer_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                                ht_estimate now, ht_ab v_V, ht_ab i_A)
{
    ht_estimate next;
    ht_ab turned = ht_observer_predict_rotor(cfg, st, now.psi_Wb, i_A);

    next.psi_Wb.alpha = now.psi_Wb.alpha + cfg->ts_s * (v_V.alpha - st->rs_ohm * i_A.alpha);
    next.psi_Wb.beta = now.psi_Wb.beta + cfg->ts_s * (v_V.beta - st->rs_ohm * i_A.beta);
    /* T = 3 P psi x i, i = (psi - turned)/(sigma L_s), and psi x psi = 0 */
    next.torque_Nm = cfg->torque_gain * cfg->inv_sigma_ls * ht_across(turned, next.psi_Wb);
    return next;
}

ht_xy ht_observer_predict_xy(const ht_observer_config *cfg, const ht_observer_state *st, ht_xy v_V,
                             ht_xy i_A)
{
    ht_xy next;
    next.x = cfg->lxy_H * i_A.x + cfg->ts_s * (v_V.x - st->rs_ohm * i_A.x);
    next.y = cfg->lxy_H * i_A.y + cfg->ts_s * (v_V.y - st->rs_ohm * i_A.y);
    return next;
}
