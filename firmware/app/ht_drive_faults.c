/* Faults: gates off, brake closed, what is kept of them. And the chopper, which acts in every state. */
#include "ht_drive_inside.h"

#include <stddef.h>

/* Faults after which the estimate of the flux cannot be trusted. */
#define DOUBTS                                                                               \
    ((unsigned)HT_FAULT_NONFINITE | (unsigned)HT_FAULT_CALIBRATION                           \
     | (unsigned)HT_FAULT_CURRENT_SUM | (unsigned)HT_FAULT_FLUX | (unsigned)HT_FAULT_ENCODER \
     | (unsigned)HT_FAULT_STUCK | (unsigned)HT_FAULT_INTERRUPT | (unsigned)HT_FAULT_PHASE)

static void keep(ht_drive *d, uint16_t state, uint32_t bits)
{
    if ((bits & DOUBTS) != 0u) {
        d->flux_unknown = 1.0f;
    }
    d->snapshot.tick = d->tick;
    d->snapshot.state = state;
    d->snapshot.faults = bits;
    d->snapshot.warnings = ht_drive_warnings(d);
    d->snapshot.samples = d->samples;
    d->snapshot.in = d->in;
    d->snapshot.estimate = d->control.estimate;
    d->snapshot.speed_rpm = d->speed_rpm;
}

uint16_t ht_drive_warnings(const ht_drive *d)
{
    unsigned shorted = (d->short_circuit.on != 0u) ? (unsigned)HT_WARNING_SHORT_CIRCUIT : 0u;
    return (uint16_t)(d->warnings | d->heat_warnings | shorted);
}

HT_SELDOM uint16_t ht_drive_by_comparator(const ht_drive *d)
{
    uint16_t beyond = ht_port_beyond(d->port);
    unsigned faults = ((beyond >> (unsigned)HT_ADC_VDC) != 0u) ? (unsigned)HT_FAULT_VDC_HIGH : 0u;
    if ((beyond & ((1u << (unsigned)HT_ADC_VDC) - 1u)) != 0u) { /* a phase current */
        faults |= HT_FAULT_OVERCURRENT;
    }
    return (uint16_t)faults;
}

/* Faults after which the chopper stays off: the trip chain, which the resistor's thermal switch belongs to,
 * or no look at the dc link's voltage. Others need it all the more. */
#define NO_CHOPPER \
    ((uint32_t)HT_FAULT_EXTERNAL | (uint32_t)HT_FAULT_INTERRUPT | (uint32_t)HT_FAULT_CLOCK)

static void chop(ht_drive *d, bool on)
{
    d->chops = (uint16_t)(on ? HT_OUT_CHOPPER : 0);
    ht_port_outputs(d->port, HT_OUT_CHOPPER, d->chops);
    ht_drive_look(d);
}

HT_SELDOM void ht_drive_follow_chopper(ht_drive *d)
{
    bool is_on = d->chops != 0u;
    bool on = ht_outputs_chops(&d->config->outputs, is_on, d->in.vdc_V)
              && ((d->faults & NO_CHOPPER) == 0u) && !ht_port_trip_pin_low(d->port);
    if (on != is_on) {
        chop(d, on);
    }
}

void ht_drive_look(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    float above_V = (c->vdc.above_V < c->outputs.chopper_on_V) ? c->vdc.above_V
                                                               : c->outputs.chopper_on_V;
    d->look_above_V = (d->chops != 0u) ? -1.0f : above_V;
}

void ht_drive_close_brake(ht_drive *d)
{
    if ((d->outputs.on & (uint16_t)HT_OUT_BRAKE) != 0u) {
        d->outputs.on &= (uint16_t)~(unsigned)HT_OUT_BRAKE;
        ht_port_outputs(d->port, HT_OUT_BRAKE, 0u);
    }
}

void ht_drive_trip(ht_drive *d, uint32_t bits)
{
    ht_port_gates_off(d->port);
    ht_drive_close_brake(d);
    if (d->state != (uint16_t)HT_STATE_FAULT) {
        bool by_hardware = (bits & (uint32_t)HT_FAULT_EXTERNAL) != 0u;
        if ((bits & ((uint32_t)HT_FAULT_OVERCURRENT | (uint32_t)HT_FAULT_VDC_HIGH)) != 0u) {
            uint16_t found = (uint16_t)(ht_drive_by_comparator(d) & bits);
            if (found != 0u) {
                d->warnings = (uint16_t)(d->warnings | (unsigned)HT_WARNING_COMPARATOR);
            }
            by_hardware = by_hardware || ((found & (uint16_t)HT_FAULT_OVERCURRENT) != 0u);
        }
        keep(d, d->state, bits);
        if (by_hardware) {
            d->trips++;
        }
        ht_drive_enter(d, HT_STATE_FAULT);
    }
    d->faults |= bits;
}

/* The latches hold a short circuit without code. */
void ht_drive_interrupt_lost(const ht_drive *d)
{
    if (d->short_circuit.on == 0u) {
        ht_port_gates_off(d->port);
    }
}

void ht_drive_stand_in(ht_drive *d, uint32_t bits)
{
    const ht_drive_config *staged = d->staged;
    uint16_t state = d->state;
    d->state = (uint16_t)HT_STATE_FAULT; /* first, as in ht_drive_stop */
    ht_drive_interrupt_lost(d);
    ht_drive_close_brake(d);
    if (staged != NULL) {
        d->config = staged;
        d->taken_tick = d->tick;
        d->staged = NULL;
    }
    if (state != (uint16_t)HT_STATE_FAULT) {
        keep(d, state, bits);
    }
    d->faults |= bits;
    if (d->chops != 0u) {
        chop(d, false);
    }
    ht_drive_look(d);
}
