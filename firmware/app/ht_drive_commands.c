/* Commands of the background, and the names of states and limits. */
#include "ht_drive_inside.h"

#include <stddef.h>

const char *ht_state_name(uint16_t state)
{
    static const char *const names[HT_STATES] = {
#define HT_STATE(name, number, text, flags) text,
#include "ht_states.def"
#undef HT_STATE
    };
    return (state < (uint16_t)HT_STATES) ? names[state] : "";
}

uint16_t ht_state_flags(uint16_t state)
{
    static const uint16_t all[HT_STATES] = {
#define HT_STATE(name, number, text, flags) flags,
#include "ht_states.def"
#undef HT_STATE
    };
    return (state < (uint16_t)HT_STATES) ? all[state] : (uint16_t)HT_ALL_FLAGS;
}

const ht_limit_info *ht_limit_describe(uint16_t row)
{
    static const ht_limit_info table[HT_LIMITS] = {
#define HT_LIMIT(name, bit, text, help) {(bit), text, help},
#include "ht_limits.def"
#undef HT_LIMIT
    };
    return (row < (uint16_t)HT_LIMITS) ? &table[row] : NULL;
}

uint16_t ht_drive_restart_wait(const ht_drive *d)
{
    uint16_t trips = d->trips; /* once: the interrupts come at any time */
    uint16_t count = (uint16_t)(trips - d->trips_forgotten);
    float most = d->params.v[HT_P_restart_count];
    float left_s = d->params.v[HT_P_restart_wait_s];
    if (!(most > 0.0f) || ((float)count < most)) {
        return 0u;
    }
    if (trips == d->trips_noticed) {
        left_s -= (float)d->quiet_s;
    }
    return (uint16_t)((left_s > 0.0f) ? (left_s + 0.999f) : 1.0f);
}

ht_result ht_drive_start(ht_drive *d)
{
    int leg;
    if (ht_port_trip_pin_low(d->port)) {
        return HT_ERROR_TRIP;
    }
    if ((d->state != (uint16_t)HT_STATE_IDLE) || (d->faults != 0u)) {
        return HT_ERROR_STATE; /* a fault that a stop overtook must be cleared first */
    }
    if (d->short_circuit.on != 0u) {
        return HT_ERROR_SHORT_CIRCUIT;
    }
    if (ht_config_in_force(d)->index.used && !d->index.known) {
        return HT_ERROR_INDEX;
    }
    if (!ht_finite_below(d->speed_rpm, d->params.v[HT_P_start_max_rpm]) && !ht_drive_can_catch(d)) {
        return HT_ERROR_TURNING;
    }
    if (d->params.v[HT_P_motion] != (float)HT_MOTION_FOLLOW) {
        return HT_ERROR_MOTION;
    }
    if (ht_drive_restart_wait(d) != 0u) {
        return HT_ERROR_RESTART;
    }
    if (!ht_outputs_charged(&ht_config_in_force(d)->outputs, &d->outputs)) {
        return HT_ERROR_CHARGE;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->offset_sum[leg] = 0u;
        d->offset_counts[leg] = (float)HT_ADC_MID;
    }
    d->warnings = 0u;
    ht_drive_enter(d, HT_STATE_CALIBRATE);
    return HT_OK;
}

void ht_drive_stop(ht_drive *d)
{
    /* State first: a fast interrupt in between must not turn the gates on again. And nothing
     * but the state: with its ticks at 0, one that still finds BUILD would begin that anew,
     * and release a latch that the pin has set. */
    if (d->state != (uint16_t)HT_STATE_FAULT) {
        d->state = (uint16_t)HT_STATE_IDLE;
    }
    ht_drive_interrupt_lost(d);
    ht_drive_close_brake(d);
}

ht_result ht_drive_clear(ht_drive *d)
{
    if ((d->faults & (uint32_t)HT_FAULT_CLOCK) != 0u) {
        return HT_ERROR_STATE; /* nothing but a reset makes another clock */
    }
    if (ht_port_trip_pin_low(d->port)) {
        return HT_ERROR_TRIP;
    }
    if ((d->state != (uint16_t)HT_STATE_FAULT) && (d->faults == 0u)) {
        return HT_ERROR_STATE;
    }
    d->faults = 0u;
    d->warnings = 0u;
    ht_drive_enter(d, HT_STATE_IDLE);
    return HT_OK;
}
