/* The torque reference: by the speed regulator with its ramp, the brake and a stop, or as it is given, within
 * its limits. */
#include "ht_drive_slow.h"

#include "ht_limited.h"

#include <math.h>

/* Limits of the torque reference for either sign, and of its power. Returns which of them is the nearer
 * one, HT_LIMIT_... */
static unsigned limit_torque(const ht_drive *d, const float *v, float *least_Nm, float *most_Nm)
{
    float omega_rad_s = fabsf(d->speed_rpm) * HT_RAD_S_PER_RPM;
    float power_W = v[HT_P_power_limit_W];
    unsigned nearer = (d->heat_share < 1.0f) ? (unsigned)HT_LIMIT_HEAT : d->torque_limited_by;
    *most_Nm = d->torque_limit_Nm;
    *least_Nm = d->torque_least_Nm;
    if ((power_W > 0.0f) && ((*most_Nm * omega_rad_s) > power_W)) {
        *most_Nm = power_W / omega_rad_s;
        *least_Nm = (*least_Nm < -*most_Nm) ? -*most_Nm : *least_Nm;
        nearer = HT_LIMIT_POWER;
    }
    return nearer;
}

/* Take over what the parameter `motion` asks for, whatever the brake does. A ramp begins at the speed that is
 * measured. */
static void follow_motion(ht_drive *d, uint16_t motion)
{
    if (motion != d->motion) {
        d->motion = motion;
        d->stop_ticks = 0.0f;
        ht_ramp_reset(&d->ramp, d->speed_rpm);
    }
}

/* The speed reference on its way: by the ramp, or down to a standstill. */
static float speed_ref_rpm(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    bool stops = d->motion != (uint16_t)HT_MOTION_FOLLOW;
    return ht_ramp_step(stops ? &c->stop : &c->ramp, &d->ramp, stops ? 0.0f : v[HT_P_speed_ref_rpm],
                        d->speed_rpm, (d->limits & ~(unsigned)HT_LIMIT_RAMP) != 0u);
}

/* Does a ramp wait? `before`: its speed in the slow interrupt before. */
static bool ramp_waits(const ht_drive *d, const ht_drive_config *c, float before_rpm)
{
    const ht_ramp_config *ramp = (d->motion != (uint16_t)HT_MOTION_FOLLOW) ? &c->stop : &c->ramp;
    float target_rpm = (ramp == &c->stop) ? 0.0f : c->params.v[HT_P_speed_ref_rpm];
    return ((d->limits & ~(unsigned)HT_LIMIT_RAMP) != 0u)
           && ((ramp->up_rpm > 0.0f) || (ramp->down_rpm > 0.0f))
           && (d->ramp.speed_rpm == before_rpm) && (d->ramp.speed_rpm != target_rpm);
}

/* These limits act in this slow interrupt. */
static void note_limits(ht_drive *d, unsigned limits)
{
    uint16_t began = (uint16_t)(limits & ~(unsigned)d->limits);
    uint16_t row;
    for (row = 0u; row < (uint16_t)HT_LIMITS; row++) {
        if ((((unsigned)began >> row) & 1u) != 0u) {
            d->limit_from[row] = d->tick;
        }
        if (((limits >> row) & 1u) != 0u) {
            d->limit_to[row] = d->tick;
        }
    }
    d->limits = (uint16_t)limits;
}

/* The speed regulator's torque. While V_dc limits the torque, the integral waits: the error that
 * this leaves would wind it up. */
static float regulated_Nm(ht_drive *d, const ht_drive_config *c, float error_rad_s, float least_Nm,
                          float most_Nm, bool waits)
{
    ht_speed_state before = d->speed;
    float torque_Nm = ht_speed_step(&c->speed, &d->speed, error_rad_s, least_Nm, most_Nm);
    if (waits) {
        d->speed = before;
    }
    return torque_Nm;
}

/* Share of torque_limit_Nm by which the mean torque moves the reference at most. The mean of a table is
 * off by 0.13 of its reference. */
#define MEAN_SHARE 0.2f

/* By what the reference is to differ from the torque that is asked for, so that the mean torque does not: the
 * mean of what the torque lacks of the reference in force. That one is within all limits, so nothing winds up.
 * A ripple that beats with the looks has no phase that stays, so their mean is the torque's. Where the flux
 * hardly turns R_s alone tells the torque, and what was learnt fades. */
static float mean_more_Nm(const ht_drive *d, const float *v)
{
    float gain = 1.0f / (1.0f + v[HT_P_torque_mean_s] * v[HT_P_f_slow_Hz]);
    float lacks_Nm = d->in.torque_ref_Nm - d->control.estimate.torque_Nm;
    float more_Nm = d->torque_more_Nm;
    if (!(v[HT_P_torque_mean_s] > 0.0f) || (d->off_legs != 0u)) {
        return 0.0f;
    }
    if (fabsf(d->omega_mean_rad_s) < HT_TURNING_RAD_S) {
        lacks_Nm = 0.0f;
    }
    more_Nm += gain * (lacks_Nm - more_Nm);
    return ht_limited(more_Nm, MEAN_SHARE * v[HT_P_torque_limit_Nm]);
}

void ht_drive_follow_reference(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    uint16_t vdc_acts = d->vdc_acts; /* one that acts in between acts again */
    float negative_Nm = v[HT_P_torque_negative_Nm];
    float more_Nm = 0.0f;
    float least_Nm;
    float most_Nm;
    unsigned nearer;
    unsigned acts = vdc_acts;
    ht_brake brake = ht_outputs_brake(&c->outputs, &d->outputs, d->control.estimate.torque_Nm,
                                      v[HT_P_motion] == (float)HT_MOTION_FOLLOW);
    follow_motion(d, (uint16_t)v[HT_P_motion]);
    d->torque_least_Nm =
        -((negative_Nm > 0.0f) ? ht_smaller(d->torque_limit_Nm, negative_Nm) : d->torque_limit_Nm);
    nearer = limit_torque(d, v, &least_Nm, &most_Nm);
    d->vdc_acts = 0u;
    if (!(d->in.vdc_V > c->vdc.above_V)) {
        d->vdc_from_rpm = (d->speed_rpm < 0.0f) ? -d->speed_rpm : d->speed_rpm;
    }
    if (brake == HT_BRAKE_BUILDS) {
        d->torque_ref_Nm = ht_between(c->outputs.hold_Nm, least_Nm, most_Nm);
        ht_ramp_reset(&d->ramp, d->speed_rpm);
        ht_speed_follow(&d->speed, d->torque_ref_Nm);
        acts |= (unsigned)HT_LIMIT_BRAKE;
    } else if (brake != HT_BRAKE_OPEN) { /* it moves: stand still */
        float error = -d->speed_rpm * HT_RAD_S_PER_RPM;
        ht_ramp_reset(&d->ramp, 0.0f);
        d->torque_ref_Nm = regulated_Nm(d, c, error, least_Nm, most_Nm, vdc_acts != 0u);
        acts |= (unsigned)HT_LIMIT_BRAKE;
    } else if ((v[HT_P_control_mode] != 0.0f) && (v[HT_P_motion] == (float)HT_MOTION_FOLLOW)) {
        more_Nm = mean_more_Nm(d, v);
        d->torque_ref_Nm = ht_between(v[HT_P_torque_ref_Nm] + more_Nm, least_Nm, most_Nm);
        ht_ramp_reset(&d->ramp, d->speed_rpm);
        ht_speed_follow(&d->speed, d->torque_ref_Nm); /* no step on the return to speed mode */
    } else {
        float before_rpm = d->ramp.speed_rpm;
        float error = (speed_ref_rpm(d, c) - d->speed_rpm) * HT_RAD_S_PER_RPM;
        d->torque_ref_Nm = regulated_Nm(d, c, error, least_Nm, most_Nm, vdc_acts != 0u);
        acts |= ramp_waits(d, c, before_rpm) ? (unsigned)HT_LIMIT_RAMP : 0u;
    }
    if ((d->torque_ref_Nm >= most_Nm) || (d->torque_ref_Nm <= least_Nm)) {
        acts |= nearer;
    }
    d->torque_more_Nm = more_Nm;
    note_limits(d, acts);
}

void ht_drive_come_to_a_stop(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    if (d->motion == (uint16_t)HT_MOTION_FOLLOW) {
        return;
    }
    d->stop_ticks += 1.0f;
    if (((d->ramp.speed_rpm == 0.0f) && (fabsf(d->speed_rpm) <= v[HT_P_start_max_rpm])
         && ht_outputs_close(&c->outputs, &d->outputs))
        || (d->stop_ticks >= (v[HT_P_stop_s] * v[HT_P_f_slow_Hz]))) {
        ht_drive_stop(d);
    }
}
