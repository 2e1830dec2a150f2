#include "ht_induction_rules.h"

#include "ht_angle.h"
#include "ht_limited.h"
#include "ht_misfit.h"
#include "ht_turned.h"

#include <math.h>

void ht_induction_configure(const float *v, ht_observer_config *c)
{
    (void)v;
    (void)c;
}

bool ht_induction_bears_short(const ht_params *p)
{
    (void)p;
    return true;
}

bool ht_induction_fits(const float *v, uint16_t misfit)
{
    (void)v;
    (void)misfit;
    return true;
}

bool ht_induction_learns_rs(const float *v)
{
    return (v[HT_P_observer] == (float)HT_OBSERVER_HYBRID) && (v[HT_P_adapt_s] > 0.0f);
}

float ht_induction_reserve_Wb(const float *v, float reach_Nm_Wb2)
{
    return sqrtf(v[HT_P_flux_reserve_Nm] / reach_Nm_Wb2);
}

/* By the circle diagram, with the flux reference. */
float ht_induction_limit_A(const ht_derating_config *c, const ht_observer_config *machine,
                           const float *v)
{
    float unit_A = v[HT_P_flux_ref_Wb] / c->ls_H;
    float centre_A = unit_A * 0.5f / c->lean;
    float radius_A = centre_A - unit_A;
    float across_A = v[HT_P_torque_limit_Nm] / (c->torque_gain * v[HT_P_flux_ref_Wb]);
    float along_A;
    (void)machine;
    across_A = (across_A < radius_A) ? across_A : radius_A;
    along_A = centre_A - sqrtf(radius_A * radius_A - across_A * across_A);
    return sqrtf(along_A * along_A + across_A * across_A);
}

/* Rotor flux and current are followed this many times faster than the rotor flux can rise. */
#define ROTOR_FASTER 30.0f

void ht_induction_configure_protect(const float *v, ht_protect_config *c)
{
    c->rotor_gain = 1.0f; /* R_r not told: every change is taken for a steady state */
    c->magnetise_A_Wb = 0.0f;
    if (v[HT_P_rr_ohm] > 0.0f) {
        float ratio = v[HT_P_lm_H] / v[HT_P_lr_H];
        c->rotor_gain = v[HT_P_rr_ohm]
                        / (v[HT_P_rr_ohm] + v[HT_P_lr_H] * v[HT_P_f_slow_Hz] / ROTOR_FASTER);
        c->magnetise_A_Wb = ROTOR_FASTER / (ratio * v[HT_P_lm_H]);
    }
}

/* Distance of the present current from the circle diagram, A. */
static float circle_distance_A(const ht_protect_config *cfg, ht_ab psi, ht_ab i, float psi2)
{
    float size = sqrtf(psi2);
    float unit_A = size / cfg->ls_H;
    float along_A = (psi.alpha * i.alpha + psi.beta * i.beta) / size;
    float across_A = (psi.alpha * i.beta - psi.beta * i.alpha) / size;
    float radius_A = unit_A * 0.5f * (1.0f / cfg->sigma - 1.0f);
    along_A -= unit_A + radius_A; /* from the centre */
    return radius_A - sqrtf(along_A * along_A + across_A * across_A);
}

/* Rotor flux as seen from the stator. */
static ht_ab rotor_flux(const ht_protect_config *cfg, const ht_control_state *c)
{
    ht_ab r;
    r.alpha = c->estimate.psi_Wb.alpha - cfg->sigma * cfg->ls_H * c->observer.i_A.alpha;
    r.beta = c->estimate.psi_Wb.beta - cfg->sigma * cfg->ls_H * c->observer.i_A.beta;
    return r;
}

/* Follow the size of the rotor flux r, and the current along and across it. */
static void follow(const ht_protect_config *cfg, ht_protect_state *st, ht_ab r, ht_ab i)
{
    float size = sqrtf(r.alpha * r.alpha + r.beta * r.beta);
    float along = 0.0f;
    float across = 0.0f;
    if (size != 0.0f) { /* NaN goes in */
        along = (r.alpha * i.alpha + r.beta * i.beta) / size;
        across = (r.alpha * i.beta - r.beta * i.alpha) / size;
    }
    st->rotor_now_Wb = size;
    st->rotor_Wb += cfg->rotor_gain * (size - st->rotor_Wb);
    st->i_A.alpha += cfg->rotor_gain * (along - st->i_A.alpha);
    st->i_A.beta += cfg->rotor_gain * (across - st->i_A.beta);
}

/* Distance of the current from the circle diagram without what a change of the rotor flux takes, A;
 * 0 without flux. Its low pass takes what it is behind, times magnetise_A_Wb. */
static float off_circle_A(const ht_protect_config *cfg, const ht_protect_state *st)
{
    float sigma_ls_H = cfg->sigma * cfg->ls_H;
    ht_ab i = st->i_A;
    ht_ab psi;
    float psi2;
    i.alpha -= cfg->magnetise_A_Wb * (st->rotor_now_Wb - st->rotor_Wb);
    psi.alpha = st->rotor_Wb + sigma_ls_H * i.alpha;
    psi.beta = sigma_ls_H * i.beta;
    psi2 = psi.alpha * psi.alpha + psi.beta * psi.beta;
    /* NaN goes in: it must not pass for a machine without flux */
    return (psi2 != 0.0f) ? circle_distance_A(cfg, psi, i, psi2) : 0.0f;
}

/* For the next look at the flux. */
static void remember(ht_protect_state *st, const ht_control_state *c, ht_ab rotor_Wb)
{
    st->flux_Wb = rotor_Wb;
    st->omega_rad_s = c->observer.omega_sync_rad_s;
}

void ht_protect_follow(const ht_protect_config *cfg, ht_protect_state *st,
                       const ht_control_state *c)
{
    ht_ab r = rotor_flux(cfg, c);
    follow(cfg, st, r, c->observer.i_A);
    remember(st, c, r);
}

#define PI_F 3.14159265f
/* 2 atan(t) is 2 t/(1 + ATAN t^2), within 0.01 for |t| <= 1. */
#define ATAN 0.28f

/* Twice the angle whose tangent is across/along, along >= 0: -pi .. pi. */
static float twice_angle(float across, float along)
{
    float size = fabsf(across);
    bool steep = size > along;
    float t = steep ? (along / size) : (size / along);
    float angle = 2.0f * t / (1.0f + ATAN * t * t);
    angle = steep ? (PI_F - angle) : angle;
    return (across < 0.0f) ? -angle : angle;
}

/* No flux turns so often in a slow period. */
#define MOST_TURNS 1.0e4f

/* Electrical speed of the rotor flux `now`, mean since the slow interrupt before: the turn that the observer's
 * speeds at both make in this time, and the rest of the angle between both. The observer's speed alone has a
 * scheme's ripple in it, which beats with the looks, and is wrong where the voltage keeps the flux away from its
 * reference; and the stator flux turns by twice the load angle when the torque reverses. */
static float flux_rad_s(const ht_protect_config *cfg, ht_protect_state *st,
                        const ht_control_state *c, ht_ab now)
{
    ht_ab was = st->flux_Wb;
    float observed = 0.5f * (st->omega_rad_s + c->observer.omega_sync_rad_s);
    float turns = ht_limited(cfg->slow_turns_s * observed, MOST_TURNS);
    float part = turns - (float)(int32_t)turns;
    ht_ab turn = ht_unit((part < 0.0f) ? (part + 1.0f) : part);
    float along;
    float across;
    was = ht_product(turn, was);
    along = was.alpha * now.alpha + was.beta * now.beta;
    across = was.alpha * now.beta - was.beta * now.alpha;
    along += sqrtf(along * along + across * across);
    remember(st, c, now);
    if ((along == 0.0f) && (across == 0.0f)) { /* no flux before, or the opposite one */
        return c->observer.omega_sync_rad_s;
    }
    return observed + cfg->slow_Hz * twice_angle(across, along);
}

uint16_t ht_induction_protect(const ht_protect_config *cfg, ht_protect_state *st,
                              const ht_control_state *c, float speed_rpm)
{
    ht_ab i = c->observer.i_A;
    uint16_t faults = 0u;
    ht_ab r = rotor_flux(cfg, c);
    float slip = c->observer.rr_scale * cfg->slip_gain * (r.alpha * i.beta - r.beta * i.alpha);
    float r2 = r.alpha * r.alpha + r.beta * r.beta;
    float off;
    follow(cfg, st, r, i);
    if (r2 != 0.0f) {
        float estimated = cfg->rpm_per_rad_s * (flux_rad_s(cfg, st, c, r) - slip / r2);
        st->speed_error_rpm += cfg->encoder_gain * (speed_rpm - estimated - st->speed_error_rpm);
    }
    off = off_circle_A(cfg, st) / cfg->no_load_A;
    faults = ht_protect_flux(cfg, st, off * off);
    if ((cfg->encoder_trip_rpm > 0.0f) && !(fabsf(st->speed_error_rpm) < cfg->encoder_trip_rpm)) {
        faults = (uint16_t)(faults | HT_FAULT_ENCODER);
    }
    return faults;
}
