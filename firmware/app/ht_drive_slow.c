/* The slow interrupt: speed, adaptation, the checks that need a model, outputs; and the order of its parts. */
#include "ht_drive_slow.h"

#include "ht_limited.h"
#include "ht_rotor_rules.h"

#include <math.h>
#include <stddef.h>

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
    if (c->absolute.used) {
        ht_absolute_step(&c->absolute, &d->absolute, position, moved,
                         ht_port_read_absolute(d->port));
    }
}

/* The flux builds up: R_s is learnt, and the checks follow the flux. Returns the faults that are found. */
static unsigned follow_build(ht_drive *d, const ht_drive_config *c)
{
    ht_protect_follow(&c->protect, &d->protect, &d->control);
    (void)ht_drive_follow_along(d, c);
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

/* Share of the dc link's voltage that a rotor induces at least where it tells its flux: dead time and
 * devices are wrong by up to 1 % of V_dc. */
#define FLUX_TOLD_BY 0.1f

/* Where nothing adapts, the resistances in use are the configured ones. Without a leg they stay
 * as they are: R_s then counts twice along an axis. An arc would be learnt as a resistance. */
static void learn_resistances(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    ht_rotor rotor = c->control.observer.rotor;
    float omega_rad_s = d->control.observer.omega_sync_rad_s;
    if ((d->off_legs == 0u) && !ht_leg_loss_maybe(&c->control.leg_loss, &d->control.leg_loss)) {
        HT_ROTOR_DOES(rotor, adapt, (&c->control.observer, &d->control.observer, c->adapt_gain));
        ht_set_difference_learn(&c->sets, &d->sets, d->control.observer.i_A,
                                d->control.leg_loss.low_V, omega_rad_s,
                                HT_LEG_LOSS_TOLERANCE * v[HT_P_rs_ohm]);
    }
    if (!HT_ROTOR_DOES(rotor, induces,
                       ())) { /* harmonics that are not told would be taken for L_xy */
        ht_leg_loss_learn(&c->control.leg_loss, &d->control.leg_loss, &d->control.i_A, c->lxy_gain);
    } else if (d->off_legs == 0u) {
        HT_ROTOR_DOES(
            rotor, adapt_flux,
            (&c->control.observer, &d->control.observer, c->flux_gain, FLUX_TOLD_BY * d->in.vdc_V));
    } else {
        /* its flux stays as it was learnt */
    }
    ht_leg_loss_tolerate(&d->control.leg_loss, v[HT_P_rs_ohm], v[HT_P_lxy_H], omega_rad_s);
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

void ht_drive_slow_isr(ht_drive *d)
{
    uint32_t faults = 0u; /* written once: the fast interrupt may read them at any time */
    uint32_t lasting;
    const ht_drive_config *c = ht_config_in_force(d); /* once: nor must it change half-way */
    look_for_interrupt(d);
    forget_trips(d, c->params.v);
    measure_speed(d, c);
    ht_drive_follow_heat(d, c);
    lasting = d->heat_faults;
    if (c->index.used && !d->index.known) { /* it was at the start */
        lasting |= HT_FAULT_ENCODER;
    }
    if (c->absolute.used && !d->absolute.known) { /* the same */
        lasting |= HT_FAULT_ABSOLUTE;
    }
    if (c->short_circuit.allowed) {
        ht_short_circuit_follow(&c->short_circuit, &d->short_circuit,
                                d->speed_rpm / c->protect.rpm_per_rad_s);
    }
    if (d->state == (uint16_t)HT_STATE_RUN) {
        faults = ht_protect_slow(&c->protect, &d->protect, &d->control, d->speed_rpm);
        d->slow_faults = faults | lasting;
        d->omega_mean_rad_s += c->omega_mean_gain
                               * (d->control.observer.omega_sync_rad_s - d->omega_mean_rad_s);
        learn_resistances(d, c);
        HT_ROTOR_DOES(c->control.observer.rotor, refer, (d, c));
        ht_drive_come_to_a_stop(d, c);
    } else {
        d->torque_more_Nm = 0.0f;
        if ((d->state == (uint16_t)HT_STATE_BUILD) && !c->has_axis) {
            faults = follow_build(d, c);
        }
        d->slow_faults = faults | lasting;
    }
    switch_outputs(d, c);
}
