/* Temperatures: losses of the machine, thermistors, and the torque that they leave. */
#include "ht_drive_slow.h"

#include "ht_rotor_rules.h"

#include <math.h>

/* Losses outside of the stator's winding: the rotor's at this torque, R_r (L_m/L_r)^2 i^2 with the current
 * i across the rotor flux, and the iron's as it is configured. */
static float frame_W(const ht_drive *d, const ht_drive_config *c)
{
    float iron = 3.0f * ht_least_loss_iron_W_Wb2(&c->least_loss, d->omega_mean_rad_s);
    float across_A;
    if (d->state != (uint16_t)HT_STATE_RUN) {
        return 0.0f;
    }
    across_A = HT_ROTOR_DOES(c->control.observer.rotor, across_A, (d, c));
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
                 && (ht_drive_load(d, c) > HT_LOWER_LOAD)
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

/* The part that the samples miss: the mean squares of the look less the squares of its two samples. */
HT_SELDOM static void take_look(ht_drive *d, const ht_drive_config *c)
{
    const ht_observer_config *m = &c->control.observer;
    ht_look_circuit circuit;
    ht_six mean_A2;
    int leg;
    circuit.machine = m;
    circuit.lxy_H = m->lxy_H + m->ts_s * d->control.leg_loss.more_ohm;
    circuit.vdc_V = d->in.vdc_V;
    circuit.period = &c->control.period;
    circuit.dead = &c->control.dead;
    circuit.off_legs = d->off_legs;
    ht_look_squares(&d->look, &circuit, &mean_A2);
    for (leg = 0; leg < HT_LEGS; leg++) {
        float from_A = d->look.i_A[0].p[leg];
        float to_A = d->look.i_A[1].p[leg];
        float more_A2 = mean_A2.p[leg] - 0.5f * (from_A * from_A + to_A * to_A);
        d->heat.more_A2[leg] += c->heat.more_gain * (more_A2 - d->heat.more_A2[leg]);
    }
}

/* Takes the look that is there, and asks for the next one at random: the same place of the ripple, or of a
 * current whose frequency fits the slow interrupt's, must not come each time. */
HT_SELDOM static void follow_look(ht_drive *d, const ht_drive_config *c)
{
    uint32_t drawn;
    float wait;
    if (!(c->heat.more_gain > 0.0f) || (d->looked == 0u)) {
        return;
    }
    take_look(d, c);
    drawn = 25173u * (uint32_t)d->look_turn + 13849u;
    d->look_turn = (uint16_t)(drawn & 0xFFFFu);
    wait = c->heat.look_turns * (1.0f / 65536.0f) * (float)d->look_turn;
    d->look_wait = (uint16_t)wait;
    d->looked = 0u; /* last: now the fast interrupt may begin */
}

/* Not in its caller's frame: the stack is short. */
HT_APART static void heat_devices(ht_drive *d, const ht_drive_config *c, bool powered)
{
    float square_A2[HT_LEGS];
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        square_A2[leg] = ht_heat_square_A2(&d->heat, leg);
    }
    ht_device_heat_step(&c->device_heat, &d->device_heat, square_A2, powered, d->in.vdc_V);
}

void ht_drive_follow_heat(ht_drive *d, const ht_drive_config *c)
{
    bool powered = (ht_state_flags(d->state) & (unsigned)HT_GATES_ON) != 0u;
    float winding;
    float device;
    hear_build(d, c);
    ht_heat_take(&c->heat, &d->heat);
    follow_look(d, c);
    ht_heat_step(&c->heat, &d->heat, powered, frame_W(d, c), telling_ohm(d, c));
    read_sensors(d, c);
    heat_devices(d, c, powered);
    winding = ht_heat_share(&c->heat, ht_heat_winding_degC(&c->heat, &d->heat));
    device = device_share(d, c);
    d->heat_share = (winding < device) ? winding : device;
    d->heat_warnings = (uint16_t)(((winding < 1.0f) ? (unsigned)HT_WARNING_WINDING : 0u)
                                  | ((device < 1.0f) ? (unsigned)HT_WARNING_DEVICE : 0u));
    /* It need not be so that there is a limit before the trip. */
    d->heat_faults = broken_sensors(d) | ((winding > 0.0f) ? 0u : HT_FAULT_WINDING)
                     | ((device > 0.0f) ? 0u : HT_FAULT_DEVICE);
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
