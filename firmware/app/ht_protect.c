#include "ht_protect.h"

#include "ht_limited.h"
#include "ht_rotor_rules.h"

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

uint16_t ht_protect_flux(const ht_protect_config *cfg, ht_protect_state *st, float off2)
{
    st->off2 = off2;
    st->circle2 += cfg->flux_gain * (off2 - st->circle2);
    if ((cfg->flux_check > 0.0f) && !(st->circle2 <= cfg->flux_check * cfg->flux_check)) {
        return HT_FAULT_FLUX;
    }
    return 0u;
}

uint16_t ht_protect_slow(const ht_protect_config *cfg, ht_protect_state *st,
                         const ht_control_state *c, float speed_rpm)
{
    return HT_ROTOR_DOES(cfg->rotor, protect, (cfg, st, c, speed_rpm));
}
