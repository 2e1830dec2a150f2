/* The slow interrupt: speed, references, adaptation, and the checks that need a model. */
#include "ht_drive_inside.h"

#include "ht_limited.h"

#include <math.h>
#include <stddef.h>

#define PI_F 3.14159265f
/* Below the first speed of the flux R_r has no visible effect. From the load below (i_q/i_d) on,
 * R_r matters, and the flux is lowered to the share below until its speed is above the second
 * limit. Lowering it increases the slip of a rated load, 9.4 rad/s, by 1.7 rad/s: the second limit
 * lies above 2.5 + 1.7, or the drive would switch back and forth. */
#define STANDING_RAD_S 2.5f
#define TURNING_RAD_S 4.5f
#define LOWER_LOAD 0.4f
#define LOWER_FLUX 0.92f

/* The flux of the build-up stands still. If it turns although the encoder shows standstill, the
 * shaft turns and the encoder does not notice it. */
#define BUILD_LOOK_S 0.01f
#define BUILD_TURN_RPM 100.0f
static uint16_t turning_unnoticed(const ht_drive *d, const ht_drive_config *c)
{
    float off = c->protect.rpm_per_rad_s * d->control.observer.omega_sync_rad_s - d->speed_rpm;
    bool there = (float)d->state_ticks > HT_BUILD_BLIND * (float)d->build_ticks
                                             + BUILD_LOOK_S * c->params.v[HT_P_f_isr_Hz];
    if (!there || !(c->params.v[HT_P_encoder_trip_rpm] > 0.0f)
        || ((off < BUILD_TURN_RPM) && (off > -BUILD_TURN_RPM))) {
        return 0u;
    }
    return (uint16_t)HT_FAULT_ENCODER;
}

/* A shaft that is caught takes no torque, but for what its flux is believed wrong. More current across the flux
 * than this, in no-load currents, tells that it turns otherwise than the encoder says. */
#define CATCH_ACROSS 1.5f
static uint16_t slips_unnoticed(const ht_drive *d, const ht_drive_config *c)
{
    float most_A = CATCH_ACROSS * c->protect.no_load_A;
    if (!(c->params.v[HT_P_encoder_trip_rpm] > 0.0f) || (fabsf(d->protect.i_A.beta) < most_A)) {
        return 0u;
    }
    return (uint16_t)HT_FAULT_ENCODER;
}

/* Current in alpha-beta that the lost legs leave. */
static float derated_A(const ht_drive *d, const ht_drive_config *c)
{
    return ht_derated_A(&d->control.lost, c->derating.rated_A);
}

static float smaller(float a, float limit)
{
    return (a < limit) ? a : limit; /* NaN limits nothing */
}

/* The current along the flux as it will be a slow period on, A, if it grows as it did since the last
 * one: beyond the real pull-out it grows by itself. Without the ripple, of which the flux's distance
 * from its reference tells. */
static float follow_along(ht_drive *d, const ht_drive_config *c)
{
    ht_ab psi = d->control.estimate.psi_Wb;
    ht_ab i = d->control.observer.i_A;
    float size = sqrtf(psi.alpha * psi.alpha + psi.beta * psi.beta);
    float along_A = 0.0f;
    float rise_A;
    if (size > 0.0f) {
        along_A = (psi.alpha * i.alpha + psi.beta * i.beta) / size
                  - c->control.observer.inv_sigma_ls * (size - d->in.flux_ref_Wb);
    }
    rise_A = along_A - d->along_A;
    d->along_A = along_A;
    return (rise_A > 0.0f) ? (along_A + rise_A) : along_A;
}

/* A rotor flux below this share of the reference is no running machine's: the flux is limited then,
 * and a torque reference still chooses vectors, without a dc link for example. */
#define LEAST_ROTOR 0.1f

static float rotor_Wb(const ht_drive *d)
{
    float least_Wb = LEAST_ROTOR * d->flux_ramp_Wb;
    return (d->protect.rotor_now_Wb > least_Wb) ? d->protect.rotor_now_Wb : least_Wb;
}

/* The torque limit, and what makes it so. */
typedef struct {
    float most_Nm;
    uint16_t by; /* HT_LIMIT_... */
} ht_limit;

static void limit_to(ht_limit *limit, float most_Nm, unsigned by)
{
    if (most_Nm < limit->most_Nm) { /* NaN limits nothing */
        limit->most_Nm = most_Nm;
        limit->by = (uint16_t)by;
    }
}

/* What the parameters allow, and what flux and current can give. The rotor flux is between now and the
 * next slow interrupt on its way from what it is to what it settles at, and at a given torque the
 * current is largest at one end of this way. */
static ht_limit torque_limit(const ht_drive *d, const ht_drive_config *c, float most_A,
                             float along_A)
{
    ht_limit limit = {c->params.v[HT_P_torque_limit_Nm], (uint16_t)HT_LIMIT_TORQUE};
    float flux_ref = d->flux_ref_Wb;
    unsigned flux = (flux_ref < d->flux_ramp_Wb) ? (unsigned)HT_LIMIT_VOLTAGE
                                                 : (unsigned)HT_LIMIT_FLUX;
    limit_to(&limit, c->pull_out_Nm_Wb2 * flux_ref * flux_ref, flux);
    if ((c->params.v[HT_P_flux_least_loss] != 0.0f)
        && (d->flux_ramp_Wb < c->params.v[HT_P_flux_ref_Wb])) {
        limit_to(&limit, c->least_loss.reach_Nm_Wb2 * flux_ref * flux_ref, HT_LIMIT_FLUX);
    }
    limit_to(&limit, ht_derated_Nm(&c->derating, most_A, flux_ref), HT_LIMIT_CURRENT);
    limit_to(&limit, ht_derated_now_Nm(&c->derating, most_A, flux_ref, rotor_Wb(d)),
             HT_LIMIT_CURRENT);
    /* The same from what is measured: the current along the flux, one slow period on. */
    limit_to(&limit, ht_derated_beside_Nm(&c->derating, most_A, flux_ref, along_A),
             HT_LIMIT_CURRENT);
    if (d->off_legs != 0u) {
        /* While the flux goes down to its new limit, that one counts: currents above the rated one
         * for a while harm nothing, a drive without torque may. */
        float i_A = derated_A(d, c);
        float most_Wb = ht_derated_Wb(&c->derating, i_A);
        limit_to(
            &limit,
            ht_derated_Nm(&c->derating, i_A, (d->flux_ref_Wb < most_Wb) ? d->flux_ref_Wb : most_Wb),
            HT_LIMIT_LEGS);
    }
    return limit;
}

/* |i_q/i_d| of the reference */
static float load_of(const ht_drive *d, const ht_drive_config *c)
{
    float psi = d->flux_ramp_Wb;
    return fabsf(d->torque_ref_Nm) * c->protect.ls_H
           / (c->control.observer.torque_gain * psi * psi);
}

/* Where load and speed make the flux stand still, R_r cannot be observed, and a drive with a wrong
 * R_r may settle at that very point: more flux, less slip, standstill of the flux. A little less
 * flux gives more slip, and the flux turns again. */
static void keep_off_zero_frequency(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    float size;
    d->omega_mean_rad_s += c->omega_mean_gain
                           * (d->control.observer.omega_sync_rad_s - d->omega_mean_rad_s);
    size = (d->omega_mean_rad_s < 0.0f) ? -d->omega_mean_rad_s : d->omega_mean_rad_s;
    if ((c->control.observer.kind != HT_OBSERVER_HYBRID) || !(v[HT_P_adapt_s] > 0.0f)
        || (load_of(d, c) < LOWER_LOAD) || (size > TURNING_RAD_S)) {
        d->flux_lowered = 0u;
    } else if (size < STANDING_RAD_S) {
        d->flux_lowered = 1u;
    } else {
        /* as it was */
    }
}

/* After the loss of a leg the flux takes this share of the steps: each of them shows in the currents,
 * which are larger then. */
#define DERATING_STEP 0.2f

/* Limits that more flux may move. */
#define OF_THE_MACHINE                                                                 \
    ((unsigned)HT_LIMIT_VOLTAGE | (unsigned)HT_LIMIT_FLUX | (unsigned)HT_LIMIT_CURRENT \
     | (unsigned)HT_LIMIT_LEGS)

/* The flux without weakening and derating: the parameter's, or less where that costs less. A drive
 * without a leg keeps the parameter's: its losses and its reserve are other ones. */
static float wanted_Wb(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    float most_Wb = v[HT_P_flux_ref_Wb];
    ht_least_loss_input in;
    if ((v[HT_P_flux_least_loss] == 0.0f) || (d->off_legs != 0u)) {
        ht_least_loss_reset(&d->least_loss, most_Wb);
        return most_Wb;
    }
    in.torque_ref_Nm = d->torque_ref_Nm;
    in.torque_Nm = d->control.estimate.torque_Nm;
    in.omega_rad_s = d->omega_mean_rad_s;
    in.rs_ohm = d->control.observer.rs_ohm;
    in.rr_scale = d->control.observer.rr_scale;
    in.limited = (d->limits & OF_THE_MACHINE) != 0u;
    return ht_least_loss_step(&c->least_loss, &d->least_loss, &in, most_Wb);
}

/* A new flux reference is approached as fast as in the build-up. The rotor's flux could not follow
 * a step of the stator's. */
static void ramp_flux(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    float wanted = wanted_Wb(d, c) * ((d->flux_lowered != 0u) ? LOWER_FLUX : 1.0f);
    float share = 1.0f;
    float larger;
    float step;
    float missing;
    if (d->off_legs != 0u) {
        float most = ht_derated_Wb(&c->derating, derated_A(d, c));
        wanted = (most < wanted) ? most : wanted;
        share = DERATING_STEP;
    }
    larger = (wanted > d->flux_ramp_Wb) ? wanted : d->flux_ramp_Wb;
    step = share * larger / (v[HT_P_build_s] * v[HT_P_f_slow_Hz]);
    missing = wanted - d->flux_ramp_Wb;
    d->flux_ramp_Wb += ht_limited(missing, step);
}

/* Trips by hardware are forgotten together, when there was none for the time that a start must wait.
 * Only this interrupt writes here, and only the fast one counts trips: one that comes in between is
 * noticed the next time. */
static void forget_trips(ht_drive *d, const float *v)
{
    uint16_t trips = d->trips;
    if (trips != d->trips_noticed) {
        d->quiet_s = 0u;
        d->quiet_part_s = 0.0f;
        d->trips_noticed = trips; /* last: a start in between sees a longer wait */
        return;
    }
    d->quiet_part_s += 1.0f / v[HT_P_f_slow_Hz];
    if (d->quiet_part_s >= 1.0f) {
        d->quiet_part_s -= 1.0f;
        d->quiet_s = (d->quiet_s < 0xFFFFu) ? (uint16_t)(d->quiet_s + 1u) : 0xFFFFu;
    }
    if (((float)d->quiet_s + d->quiet_part_s) >= v[HT_P_restart_wait_s]) {
        d->trips_forgotten = trips;
    }
}

/* Faults are found by the fast interrupt, except that it has stopped: that is found here. */
static void look_for_interrupt(ht_drive *d)
{
    uint32_t tick = d->tick;
    if (tick == d->tick_last) { /* no fast interrupt since the last slow one */
        ht_drive_stand_in(d, HT_FAULT_INTERRUPT);
        ht_port_read(d->port, &d->samples); /* the shaft may turn all the same */
        d->position_now = d->samples.position;
    }
    d->tick_last = tick;
}

static void measure_speed(ht_drive *d, const ht_drive_config *c)
{
    ht_capture capture;
    uint32_t position = d->position_now; /* once: the fast interrupt may come in between */
    uint32_t counts = position - d->position_last;
    int32_t moved = (int32_t)counts;
    d->position_last = position;
    ht_port_read_capture(d->port, &capture);
    d->speed_rpm = ht_speed_measure_step(&c->measure, &d->measured, moved, &capture);
    ht_index_step(&c->index, &d->index, position, &capture);
}

/* The flux builds up: R_s is learnt, and the checks follow the flux. Returns the faults that are found. */
static unsigned follow_build(ht_drive *d, const ht_drive_config *c)
{
    ht_protect_follow(&c->protect, &d->protect, &d->control);
    (void)follow_along(d, c);
    if (d->catches != 0u) {
        ht_ramp_reset(&d->ramp, d->speed_rpm); /* RUN begins with the speed that there is then */
        return slips_unnoticed(d, c);          /* away from standstill R_s cannot be learnt */
    }
    if ((c->adapt_gain > 0.0f) && (c->control.observer.kind == HT_OBSERVER_HYBRID)
        && (d->off_legs == 0u)) {
        ht_observer_adapt(&c->control.observer, &d->control.observer, c->build_gain);
        d->built += 1.0f;
    }
    return turning_unnoticed(d, c);
}

/* Where nothing adapts, the resistances in use are the configured ones. Without a leg they stay
 * as they are: R_s then counts twice along an axis. An arc would be learnt as a resistance. */
static void learn_resistances(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    float omega_rad_s = d->control.observer.omega_sync_rad_s;
    if ((d->off_legs == 0u) && !ht_leg_loss_maybe(&c->control.leg_loss, &d->control.leg_loss)) {
        ht_observer_adapt(&c->control.observer, &d->control.observer,
                          (c->control.observer.kind == HT_OBSERVER_HYBRID) ? c->adapt_gain : 0.0f);
        ht_set_difference_learn(&c->sets, &d->sets, d->control.observer.i_A,
                                d->control.leg_loss.low_V, omega_rad_s,
                                HT_LEG_LOSS_TOLERANCE * v[HT_P_rs_ohm]);
    }
    ht_leg_loss_learn(&c->control.leg_loss, &d->control.leg_loss, &d->control.i_A, c->lxy_gain);
    ht_leg_loss_tolerate(&d->control.leg_loss, v[HT_P_rs_ohm], v[HT_P_lxy_H], omega_rad_s);
}

/* Speed of the flux over the shaft's, at least: the slip of a machine that brakes. */
#define BRAKING_SHARE 0.95f

/* The flux reference: the ramp, or what Vdc can drive of it. */
static float weakened_Wb(const ht_drive *d, const ht_drive_config *c)
{
    ht_flux_input flux;
    ht_ab i = d->control.observer.i_A;
    float a = (i.alpha < 0.0f) ? -i.alpha : i.alpha;
    float b = (i.beta < 0.0f) ? -i.beta : i.beta;
    float omega_rad_s = d->control.observer.omega_sync_rad_s;
    float least_rad_s;
    if (c->params.v[HT_P_field_weakening] == 0.0f) {
        return d->flux_ramp_Wb;
    }
    /* |i| within 4 %: alpha max plus beta min */
    flux.i_A = (a > b) ? (0.96f * a + 0.398f * b) : (0.96f * b + 0.398f * a);
    flux.flux_Wb = d->flux_ramp_Wb;
    flux.vdc_V = d->in.vdc_V;
    /* A step of the torque turns the flux back for a moment, and the shaft does not take part in that: a
     * flux reference that did would rise beyond the voltage, and the torque be lost. */
    least_rad_s = BRAKING_SHARE * fabsf(d->speed_rpm)
                  * (c->params.v[HT_P_pole_pairs] * (PI_F / 30.0f));
    flux.omega_sync_rad_s = (fabsf(omega_rad_s) > least_rad_s) ? omega_rad_s : least_rad_s;
    return ht_flux_reference(&c->flux, &flux);
}

/* Limits of the torque reference for either sign, and of its power. Returns which of them is the nearer
 * one, HT_LIMIT_... */
static unsigned limit_torque(const ht_drive *d, const float *v, float *least_Nm, float *most_Nm)
{
    float omega_rad_s = fabsf(d->speed_rpm) * (PI_F / 30.0f);
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

/* The speed reference on its way: by the ramp, or down to a standstill. A ramp begins at the speed that is
 * measured. */
static float speed_ref_rpm(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    uint16_t motion = (uint16_t)v[HT_P_motion];
    bool stops = motion != (uint16_t)HT_MOTION_FOLLOW;
    if (motion != d->motion) {
        d->motion = motion;
        d->stop_ticks = 0.0f;
        ht_ramp_reset(&d->ramp, d->speed_rpm);
    }
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

/* The torque reference, by the speed or as it is given, within its limits. */
static void follow_reference(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    uint16_t vdc_acts = d->vdc_acts; /* one that acts in between acts again */
    float negative_Nm = v[HT_P_torque_negative_Nm];
    float least_Nm;
    float most_Nm;
    unsigned nearer;
    unsigned acts = vdc_acts;
    ht_brake brake = ht_outputs_brake(&c->outputs, &d->outputs, d->control.estimate.torque_Nm,
                                      v[HT_P_motion] == (float)HT_MOTION_FOLLOW);
    d->torque_least_Nm =
        -((negative_Nm > 0.0f) ? smaller(d->torque_limit_Nm, negative_Nm) : d->torque_limit_Nm);
    nearer = limit_torque(d, v, &least_Nm, &most_Nm);
    d->vdc_acts = 0u;
    if (!(d->in.vdc_V > c->vdc.above_V)) {
        d->vdc_from_rpm = (d->speed_rpm < 0.0f) ? -d->speed_rpm : d->speed_rpm;
    }
    if (vdc_acts != 0u) {
        ht_speed_follow(&d->speed, d->in.torque_ref_Nm); /* the regulator goes on from there */
    }
    if (brake == HT_BRAKE_BUILDS) {
        d->torque_ref_Nm = ht_between(c->outputs.hold_Nm, least_Nm, most_Nm);
        ht_ramp_reset(&d->ramp, d->speed_rpm);
        ht_speed_follow(&d->speed, d->torque_ref_Nm);
        acts |= (unsigned)HT_LIMIT_BRAKE;
    } else if (brake != HT_BRAKE_OPEN) { /* it moves: stand still */
        float error = -d->speed_rpm * (PI_F / 30.0f);
        ht_ramp_reset(&d->ramp, 0.0f);
        d->torque_ref_Nm = ht_speed_step(&c->speed, &d->speed, error, least_Nm, most_Nm);
        acts |= (unsigned)HT_LIMIT_BRAKE;
    } else if ((v[HT_P_control_mode] != 0.0f) && (v[HT_P_motion] == (float)HT_MOTION_FOLLOW)) {
        d->torque_ref_Nm = ht_between(v[HT_P_torque_ref_Nm], least_Nm, most_Nm);
        d->motion = (uint16_t)HT_MOTION_FOLLOW;
        ht_ramp_reset(&d->ramp, d->speed_rpm);
        ht_speed_follow(&d->speed, d->torque_ref_Nm); /* no step on the return to speed mode */
    } else {
        float before_rpm = d->ramp.speed_rpm;
        float error = (speed_ref_rpm(d, c) - d->speed_rpm) * (PI_F / 30.0f);
        d->torque_ref_Nm = ht_speed_step(&c->speed, &d->speed, error, least_Nm, most_Nm);
        acts |= ramp_waits(d, c, before_rpm) ? (unsigned)HT_LIMIT_RAMP : 0u;
    }
    if ((d->torque_ref_Nm >= most_Nm) || (d->torque_ref_Nm <= least_Nm)) {
        acts |= nearer;
    }
    note_limits(d, acts);
}

/* A stop is over when the shaft stands as for a start and the brake holds it, or when its time is. Then the gates go off, as at a
 * command of the background. */
static void come_to_a_stop(ht_drive *d, const ht_drive_config *c)
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

/* Torque and flux references, and the flux that leaves the torque current. */
static void refer_torque(ht_drive *d, const ht_drive_config *c)
{
    ht_limit limit;
    float most_A = ht_derated_most_A(&c->derating, (d->off_legs != 0u) ? &d->control.lost : NULL,
                                     d->in.vdc_V, d->flux_ref_Wb);
    d->flux_ref_Wb = ht_derated_flux_Wb(&c->derating, most_A, d->flux_ref_Wb, rotor_Wb(d));
    /* The flux may be on its way down: the torque goes first. */
    limit = torque_limit(d, c, most_A, follow_along(d, c));
    d->torque_limited_by = limit.by;
    d->torque_limit_Nm = d->heat_share * limit.most_Nm;
    follow_reference(d, c);
}

/* With magnets: the largest flux that the voltage turns with this torque and the parameter allows, but no
 * less than the current can lower it to. */
static float most_flux_Wb(const ht_drive *d, const ht_drive_config *c, float most_A,
                          float torque_Nm)
{
    const ht_magnet_config *m = &c->control.observer.magnet;
    float least_Wb = m->psi_f_Wb - m->ld_H * most_A;
    float most_Wb = c->params.v[HT_P_flux_ref_Wb];
    if (c->params.v[HT_P_field_weakening] != 0.0f) {
        float turned_Wb = ht_magnet_turned_Wb(
            c->flux.reach_pu * d->in.vdc_V, d->control.observer.omega_sync_rad_s,
            d->control.observer.rs_ohm, torque_Nm, m->torque_gain);
        most_Wb = smaller(turned_Wb, most_Wb);
    }
    least_Wb = (least_Wb > c->flux.flux_min_Wb) ? least_Wb : c->flux.flux_min_Wb;
    return (most_Wb > least_Wb) ? most_Wb : least_Wb;
}

/* Each halves the range in which the torque limit is searched for. */
#define LIMIT_ROUNDS 8

/* With magnets: the largest torque whose own flux lets it be. More torque takes more of the voltage and
 * leaves less flux, so that a limit at the flux of the torque before would swing from tick to tick. */
static ht_limit magnet_limit(const ht_drive *d, const ht_drive_config *c, float most_A)
{
    ht_limit limit = {0.0f, (uint16_t)HT_LIMIT_CURRENT};
    const ht_magnet_config *m = &c->control.observer.magnet;
    float sign = (d->torque_ref_Nm < 0.0f) ? -1.0f : 1.0f;
    float most_Nm = c->params.v[HT_P_torque_limit_Nm];
    float step_Nm;
    float limit_Nm = 0.0f;
    int n;
    if (c->params.v[HT_P_field_weakening] != 0.0f) {
        most_Nm = smaller(ht_magnet_driven_Nm(c->flux.reach_pu * d->in.vdc_V,
                                              sign * d->control.observer.omega_sync_rad_s,
                                              d->control.observer.rs_ohm, m->torque_gain),
                          most_Nm);
    }
    step_Nm = most_Nm;
    for (n = 0; n <= LIMIT_ROUNDS; n++) {
        float tried_Nm = limit_Nm + step_Nm;
        float flux_Wb = most_flux_Wb(d, c, most_A, sign * tried_Nm);
        if ((tried_Nm <= most_Nm) && (ht_magnet_most_Nm(m, most_A, flux_Wb) >= tried_Nm)) {
            limit_Nm = tried_Nm;
        }
        step_Nm *= 0.5f;
    }
    limit.most_Nm = limit_Nm;
    if (limit_Nm >= c->params.v[HT_P_torque_limit_Nm]) {
        limit.by = (uint16_t)HT_LIMIT_TORQUE;
    } else if (limit_Nm >= most_Nm) {
        limit.by = (uint16_t)HT_LIMIT_VOLTAGE;
    } else {
        /* the current, at the flux that the voltage leaves */
    }
    return limit;
}

/* With magnets: the torque that current and flux allow, and the flux with which it takes the least
 * current. */
static void refer_magnets(ht_drive *d, const ht_drive_config *c)
{
    const ht_magnet_config *m = &c->control.observer.magnet;
    float most_A = ht_derated_most_A(&c->derating, NULL, d->in.vdc_V, m->psi_f_Wb);
    ht_limit limit;
    float most_Wb;
    limit = magnet_limit(d, c, most_A);
    d->torque_limited_by = limit.by;
    d->torque_limit_Nm = d->heat_share * limit.most_Nm;
    follow_reference(d, c);
    most_Wb = most_flux_Wb(d, c, most_A, d->torque_ref_Nm);
    d->flux_ref_Wb = smaller(ht_magnet_flux_Wb(m, ht_magnet_least_A(m, d->torque_ref_Nm)), most_Wb);
}

/* Losses outside of the stator's winding: the rotor's at this torque, R_r (L_m/L_r)^2 i^2 with the current
 * i across the rotor flux, and the iron's as it is configured. With magnets there are none. */
static float frame_W(const ht_drive *d, const ht_drive_config *c)
{
    float omega = fabsf(d->omega_mean_rad_s);
    float iron = 3.0f * omega * (c->least_loss.hysteresis_ohm + c->least_loss.eddy_ohm * omega);
    float across_A;
    if (c->control.observer.magnets || (d->state != (uint16_t)HT_STATE_RUN)) {
        return 0.0f;
    }
    across_A = d->torque_ref_Nm / (c->control.observer.torque_gain * rotor_Wb(d));
    return 3.0f * d->control.observer.rr_scale * c->protect.slip_gain * across_A * across_A
           + iron * d->flux_ref_Wb * d->flux_ref_Wb;
}

/* Speeds of the flux between which the adapted R_s is exact under load. Nearer to standstill R_r is not
 * observed, and above it the voltage hides R_s. */
#define TELLS_FROM_RAD_S 10.0f
#define TELLS_TO_RAD_S 35.0f

/* R_s where it tells the winding's temperature, else 0. An arc counts as a resistance. */
static float telling_ohm(const ht_drive *d, const ht_drive_config *c)
{
    float omega = fabsf(d->omega_mean_rad_s);
    bool tells = (c->heat.rs_tells != (uint16_t)HT_RS_TELLS_NOTHING)
                 && (d->state == (uint16_t)HT_STATE_RUN) && (d->off_legs == 0u)
                 && (omega > TELLS_FROM_RAD_S) && (omega < TELLS_TO_RAD_S)
                 && (load_of(d, c) > LOWER_LOAD)
                 && !ht_leg_loss_maybe(&c->control.leg_loss, &d->control.leg_loss);
    return tells ? ht_observer_adapted_ohm(&c->control.observer, &d->control.observer) : 0.0f;
}

/* The first slow interrupt after a build-up by direct current: hear what its R_s tells. */
static void hear_build(ht_drive *d, const ht_drive_config *c)
{
    float rs_ohm = ht_observer_adapted_ohm(&c->control.observer, &d->control.observer);
    if ((d->state == (uint16_t)HT_STATE_RUN) && (d->built > c->built) && (rs_ohm > 0.0f)) {
        ht_heat_built(&c->heat, &d->heat, rs_ohm);
    }
    if (d->state != (uint16_t)HT_STATE_BUILD) {
        d->built = 0.0f;
    }
}

/* One thermistor after the other, if there is any. */
static void read_sensors(ht_drive *d, const ht_drive_config *c)
{
    uint16_t channel = d->slow_channel;
    bool asked = channel < (uint16_t)HT_SLOW_CHANNELS;
    uint16_t next = (channel == (uint16_t)HT_SLOW_WINDING) ? (uint16_t)HT_SLOW_SINK
                                                           : (uint16_t)HT_SLOW_WINDING;
    uint16_t reading;
    if (!(c->ntc[HT_SLOW_WINDING].pull_share > 0.0f) && !(c->ntc[HT_SLOW_SINK].pull_share > 0.0f)) {
        d->slow_channel = (uint16_t)HT_SLOW_CHANNELS;
        return;
    }
    reading = ht_port_read_slow(d->port, asked ? channel : 0u, next);
    d->slow_channel = next;
    if (!asked) {
        return;
    }
    d->sensors[channel] = (uint16_t)HT_NTC_WHOLE;
    if (c->ntc[channel].pull_share > 0.0f) {
        d->sensors[channel] = (uint16_t)ht_ntc_take(&c->ntc[channel], &d->ntc[channel], reading);
    } else {
        ht_ntc_reset(&d->ntc[channel]);
    }
    if ((channel == (uint16_t)HT_SLOW_WINDING) && !(d->ntc[channel].missed > 0.0f)
        && ht_ntc_tells(&c->ntc[channel], &d->ntc[channel])) {
        ht_heat_measured(&c->heat, &d->heat, d->ntc[channel].degC);
    }
}

/* Faults of thermistors that are open or shorted. */
static uint32_t broken_sensors(const ht_drive *d)
{
    uint32_t faults = 0u;
    if (d->sensors[HT_SLOW_WINDING] != (uint16_t)HT_NTC_WHOLE) {
        faults |= (d->sensors[HT_SLOW_WINDING] == (uint16_t)HT_NTC_OPEN) ? HT_FAULT_WINDING_OPEN
                                                                         : HT_FAULT_WINDING_SHORT;
    }
    if (d->sensors[HT_SLOW_SINK] != (uint16_t)HT_NTC_WHOLE) {
        faults |= (d->sensors[HT_SLOW_SINK] == (uint16_t)HT_NTC_OPEN) ? HT_FAULT_SINK_OPEN
                                                                      : HT_FAULT_SINK_SHORT;
    }
    return faults;
}

/* Share of the torque that the power stage's temperature leaves. */
static float device_share(const ht_drive *d, const ht_drive_config *c)
{
    const ht_device_heat_config *device = &c->device_heat;
    bool watched = (device->K_W > 0.0f)
                   || ht_ntc_tells(&c->ntc[HT_SLOW_SINK], &d->ntc[HT_SLOW_SINK]);
    return watched ? ht_heat_left(ht_drive_device_degC(d), device->limit_degC, device->trip_degC)
                   : 1.0f;
}

/* The machine cools in every state. Gates that are on need a winding that is not too hot. */
static void follow_heat(ht_drive *d, const ht_drive_config *c)
{
    bool powered = (ht_state_flags(d->state) & (unsigned)HT_GATES_ON) != 0u;
    float winding;
    float device;
    hear_build(d, c);
    ht_heat_step(&c->heat, &d->heat, powered, frame_W(d, c), telling_ohm(d, c));
    read_sensors(d, c);
    ht_device_heat_step(&c->device_heat, &d->device_heat, d->heat.square_A2, powered, d->in.vdc_V);
    winding = ht_heat_share(&c->heat, ht_heat_winding_degC(&c->heat, &d->heat));
    device = device_share(d, c);
    d->heat_share = (winding < device) ? winding : device;
    d->heat_warnings = (uint16_t)(((winding < 1.0f) ? (unsigned)HT_WARNING_WINDING : 0u)
                                  | ((device < 1.0f) ? (unsigned)HT_WARNING_DEVICE : 0u));
    /* It need not be so that there is a limit before the trip. */
    d->heat_faults = broken_sensors(d) | ((winding > 0.0f) ? 0u : HT_FAULT_WINDING)
                     | ((device > 0.0f) ? 0u : HT_FAULT_DEVICE);
}

/* The others are the fast interrupt's. */
#define SWITCHED ((uint16_t)HT_OUT_PRECHARGE | (uint16_t)HT_OUT_BRAKE | (uint16_t)HT_OUT_FAN)

/* The fast interrupt may come in between and find a fault: its brake must not open again. */
static void switch_outputs(ht_drive *d, const ht_drive_config *c)
{
    bool works = ((ht_state_flags(d->state) & (unsigned)HT_AT_WORK) != 0u)
                 || (d->heat_warnings != 0u);
    uint16_t on = ht_outputs_step(&c->outputs, &d->outputs, d->in.vdc_V, works);
    uint16_t others = on;
    if (d->state != (uint16_t)HT_STATE_RUN) {
        ht_outputs_drop(&d->outputs);
    } else if (ht_outputs_lifted(&c->outputs, &d->outputs)) {
        on |= (uint16_t)HT_OUT_BRAKE;
    } else {
        /* the brake is closed */
    }
    if (on == d->outputs.on) {
        return;
    }
    d->outputs.on = on;
    ht_port_outputs(d->port, SWITCHED, on);
    if ((on != others) && (d->state != (uint16_t)HT_STATE_RUN)) {
        d->outputs.on = others;
        ht_port_outputs(d->port, SWITCHED, others);
    }
}

/* Share of the dc link's voltage that magnets induce at least where it tells their flux: dead time and
 * devices are wrong by up to 1 % of V_dc. */
#define FLUX_TOLD_BY 0.1f

void ht_drive_slow_isr(ht_drive *d)
{
    uint32_t faults = 0u; /* written once: the fast interrupt may read them at any time */
    uint32_t lasting;
    const ht_drive_config *c = ht_config_in_force(d); /* once: nor must it change half-way */
    look_for_interrupt(d);
    forget_trips(d, c->params.v);
    measure_speed(d, c);
    follow_heat(d, c);
    lasting = d->heat_faults;
    if (c->index.used && !d->index.known) { /* it was at the start */
        lasting |= HT_FAULT_ENCODER;
    }
    if (c->short_circuit.allowed) {
        ht_short_circuit_follow(&c->short_circuit, &d->short_circuit,
                                d->speed_rpm / c->protect.rpm_per_rad_s);
    }
    if (d->state == (uint16_t)HT_STATE_RUN) {
        faults = ht_protect_slow(&c->protect, &d->protect, &d->control, d->speed_rpm);
        d->slow_faults = faults | lasting;
        if (c->control.observer.magnets) {
            ht_leg_loss_tolerate(&d->control.leg_loss, c->params.v[HT_P_rs_ohm],
                                 c->params.v[HT_P_lxy_H], d->control.observer.omega_sync_rad_s);
            ht_observer_adapt_magnet(&c->control.observer, &d->control.observer, c->adapt_gain);
            ht_observer_adapt_flux(&c->control.observer, &d->control.observer, c->flux_gain,
                                   FLUX_TOLD_BY * d->in.vdc_V);
            refer_magnets(d, c);
        } else {
            learn_resistances(d, c);
            keep_off_zero_frequency(d, c);
            ramp_flux(d, c);
            d->flux_ref_Wb = weakened_Wb(d, c);
            refer_torque(d, c);
        }
        come_to_a_stop(d, c);
    } else {
        if ((d->state == (uint16_t)HT_STATE_BUILD) && !c->control.observer.magnets) {
            faults = follow_build(d, c);
        }
        d->slow_faults = faults | lasting;
    }
    switch_outputs(d, c);
}

float ht_drive_sink_degC(const ht_drive *d)
{
    const ht_drive_config *c = ht_config_in_force(d);
    bool tells = ht_ntc_tells(&c->ntc[HT_SLOW_SINK], &d->ntc[HT_SLOW_SINK]);
    return tells ? d->ntc[HT_SLOW_SINK].degC : c->heat.ambient_degC;
}

float ht_drive_device_degC(const ht_drive *d)
{
    return ht_device_heat_degC(&d->device_heat, ht_drive_sink_degC(d));
}
