#include "ht_protect.h"

#include "ht_angle.h"
#include "ht_limited.h"
#include "ht_turned.h"

#include <math.h>

static bool within(float value, float limit)
{
    return fabsf(value) < limit;
}

void ht_protect_reset(ht_protect_state *st)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->count[leg] = 0u;
        st->other[leg] = 0u;
        st->same[leg] = 0u;
    }
    st->circle2 = 0.0f;
    st->off2 = 0.0f;
    st->rotor_Wb = 0.0f;
    st->rotor_now_Wb = 0.0f;
    st->i_A.alpha = 0.0f;
    st->i_A.beta = 0.0f;
    st->flux_Wb.alpha = 0.0f;
    st->flux_Wb.beta = 0.0f;
    st->omega_rad_s = 0.0f;
    st->speed_error_rpm = 0.0f;
    st->counts_quick = 0.0f;
    st->counts_slow = 0.0f;
}

uint16_t ht_protect_samples(const ht_protect_config *cfg, const ht_control_input *in,
                            float speed_rpm, bool powered)
{
    const float *i = in->i_A.p;
    float trip = cfg->i_trip_A;
    float squares = i[0] * i[0] + i[1] * i[1] + i[2] * i[2] + i[3] * i[3] + i[4] * i[4]
                    + i[5] * i[5];
    unsigned faults = 0u;
    /* Where the squares' sum is below one phase's limit, no phase is beyond it. */
    if (!(squares < trip * trip)
        && !(within(i[0], trip) && within(i[1], trip) && within(i[2], trip) && within(i[3], trip)
             && within(i[4], trip) && within(i[5], trip))) {
        faults |= HT_FAULT_OVERCURRENT;
    }
    if (powered
        && !(within(i[0] + i[2] + i[4], cfg->i_sum_trip_A)
             && within(i[1] + i[3] + i[5], cfg->i_sum_trip_A))) {
        faults |= HT_FAULT_CURRENT_SUM;
    }
    if (!within(speed_rpm, cfg->speed_trip_rpm)) {
        faults |= HT_FAULT_OVERSPEED;
    }
    if (!(in->vdc_V <= cfg->vdc_max_V)) {
        faults |= HT_FAULT_VDC_HIGH;
    }
    if (!(in->vdc_V >= cfg->vdc_min_V)) {
        faults |= HT_FAULT_VDC_LOW;
    }
    return (uint16_t)faults;
}

/* The other two legs of the same set. */
static const uint16_t others[HT_LEGS][2] = {{2u, 4u}, {3u, 5u}, {0u, 4u},
                                            {1u, 5u}, {0u, 2u}, {1u, 3u}};

uint16_t ht_protect_stuck(const ht_protect_config *cfg, ht_protect_state *st, const ht_samples *s,
                          uint16_t leg)
{
    uint16_t count = s->adc[HT_ADC_I + leg];
    uint16_t other =
        (uint16_t)(s->adc[HT_ADC_I + others[leg][0]] + s->adc[HT_ADC_I + others[leg][1]]);
    float moved;
    if (count != st->count[leg]) {
        st->count[leg] = count;
        st->other[leg] = other;
        st->same[leg] = 0u;
        return 0u;
    }
    if (st->same[leg] < HT_STUCK_LOOKS) {
        st->same[leg]++;
        return 0u;
    }
    moved = (float)other - (float)st->other[leg];
    if ((cfg->stuck_counts > 0.0f) && !within(moved, cfg->stuck_counts)) {
        return HT_FAULT_STUCK;
    }
    return 0u;
}

/* Of the slow mean: an encoder that shows half of its counts moves the two means 0.39 of it apart. */
#define LEAST_CHANGE 0.3f

uint16_t ht_protect_encoder(const ht_protect_config *cfg, ht_protect_state *st, float moved)
{
    float away;
    st->counts_quick += cfg->counts_quick * (moved - st->counts_quick);
    st->counts_slow += cfg->counts_slow * (moved - st->counts_slow);
    away = fabsf(st->counts_quick - st->counts_slow);
    if ((cfg->most_counts > 0.0f) && (away > cfg->most_counts)
        && (away > LEAST_CHANGE * fabsf(st->counts_slow))) {
        return HT_FAULT_ENCODER;
    }
    return 0u;
}

/* A command beyond Vdc is none of these: where interleaved sets decide one after the other, a step of the
 * torque beyond the reach asks one set for the opposite of what the other one still makes. */
static bool finite_results(const ht_control_state *c, float torque_ref_Nm)
{
    const float huge = 1.0e6f;
    return within(c->estimate.torque_Nm, huge) && within(c->decided.torque_Nm, huge)
           && within(torque_ref_Nm, huge) && within(c->v_xy_pu.x, huge)
           && within(c->v_xy_pu.y, huge) && within(c->estimate.psi_Wb.alpha, huge)
           && within(c->estimate.psi_Wb.beta, huge);
}

uint16_t ht_protect_results(const ht_protect_config *cfg, const ht_control_state *c,
                            float torque_ref_Nm)
{
    ht_ab i = c->observer.i_A; /* this sample's, transformed by the step */
    ht_ab psi = c->estimate.psi_Wb;
    float i2 = i.alpha * i.alpha + i.beta * i.beta;
    /* Of sums as small as these each part is finite and within its bound. */
    float torques = fabsf(c->estimate.torque_Nm) + fabsf(c->decided.torque_Nm)
                    + fabsf(torque_ref_Nm);
    float command = fabsf(c->v_xy_pu.x) + fabsf(c->v_xy_pu.y);
    bool flux = within(psi.alpha, cfg->flux_trip_Wb) && within(psi.beta, cfg->flux_trip_Wb);
    unsigned faults = 0u;
    if (!(i2 <= cfg->i_ab_trip_A * cfg->i_ab_trip_A)) {
        faults |= HT_FAULT_OVERCURRENT;
    }
    if (!(flux && (torques < 1.0e5f) && (command < 1.0f))) { /* look closer */
        if (!finite_results(c, torque_ref_Nm)) {
            faults |= HT_FAULT_NONFINITE;
        } else if (!flux) {
            faults |= HT_FAULT_FLUX;
        } else {
            /* credible */
        }
    }
    return (uint16_t)faults;
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

/* The flux is off by the square root of `off2`, units of `flux_check`, at present. Is its mean square
 * beyond the limit? */
static uint16_t flux_beyond(const ht_protect_config *cfg, ht_protect_state *st, float off2)
{
    st->off2 = off2;
    st->circle2 += cfg->flux_gain * (off2 - st->circle2);
    if ((cfg->flux_check > 0.0f) && !(st->circle2 <= cfg->flux_check * cfg->flux_check)) {
        return HT_FAULT_FLUX;
    }
    return 0u;
}

/* With magnets: distance of the two models' fluxes. */
static uint16_t magnets_slow(const ht_protect_config *cfg, ht_protect_state *st,
                             const ht_control_state *c)
{
    ht_ab gap = c->observer.gap_Wb;
    float off2 = cfg->inv_psi_f * cfg->inv_psi_f * (gap.alpha * gap.alpha + gap.beta * gap.beta);
    return flux_beyond(cfg, st, off2);
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

uint16_t ht_protect_slow(const ht_protect_config *cfg, ht_protect_state *st,
                         const ht_control_state *c, float speed_rpm)
{
    ht_ab i = c->observer.i_A;
    uint16_t faults = 0u;
    ht_ab r = rotor_flux(cfg, c);
    float slip = c->observer.rr_scale * cfg->slip_gain * (r.alpha * i.beta - r.beta * i.alpha);
    float r2 = r.alpha * r.alpha + r.beta * r.beta;
    float off;
    if (cfg->magnets) {
        return magnets_slow(cfg, st, c);
    }
    follow(cfg, st, r, i);
    if (r2 != 0.0f) {
        float estimated = cfg->rpm_per_rad_s * (flux_rad_s(cfg, st, c, r) - slip / r2);
        st->speed_error_rpm += cfg->encoder_gain * (speed_rpm - estimated - st->speed_error_rpm);
    }
    off = off_circle_A(cfg, st) / cfg->no_load_A;
    faults = flux_beyond(cfg, st, off * off);
    if ((cfg->encoder_trip_rpm > 0.0f) && !within(st->speed_error_rpm, cfg->encoder_trip_rpm)) {
        faults = (uint16_t)(faults | HT_FAULT_ENCODER);
    }
    return faults;
}
