#include "ht_pil.h"

#include "ht_octets.h"

#define NO_CALL 0u /* no call has this code */

static void note(const ht_port *port, uint16_t word)
{
    ht_pil_side *notes = port->notes;
    if (notes->count < HT_CALLS_WORDS) {
        notes->word[notes->count] = word;
    }
    notes->count++; /* beyond the end: too many, and the reply says so */
}

static void note_float(const ht_port *port, float value)
{
    uint32_t bits = ht_float_bits(value);
    note(port, (uint16_t)(bits & 0xFFFFu));
    note(port, (uint16_t)(bits >> 16));
}

/* A call that the drive gets an answer to: the host checks that its driver gives the same. */
static bool note_answer(const ht_port *port, bool answer)
{
    note(port, answer ? 1u : 0u);
    return answer;
}

uint16_t ht_side_registers(void)
{
    return 0u;
}

bool ht_side_take(ht_pil_side *side, ht_port *port, ht_reader *request)
{
    ht_pil_inputs_take(request, &port->input);
    side->count = 0u;
    return ht_reader_done(request);
}

bool ht_side_init(ht_pil_side *side, ht_port *port, uint16_t device, ht_reader *request)
{
    (void)device;
    port->notes = side;
    ht_pil_hardware_take(request, &port->hardware);
    return ht_side_take(side, port, request);
}

void ht_side_tell(ht_pil_side *side, ht_port *port, uint16_t number, ht_packet *reply)
{
    uint16_t i;
    (void)port;
    (void)number;
    if (side->count > HT_CALLS_WORDS) {
        ht_packet_add16(reply, NO_CALL);
        return;
    }
    for (i = 0u; i < side->count; i++) {
        ht_packet_add16(reply, side->word[i]);
    }
}

/* --- port.h --------------------------------------------------------------------- */

ht_dead_range ht_port_dead_range(const ht_port *port)
{
    ht_dead_range range;
    range.min_us = port->hardware.dead_min_us;
    range.max_us = (float)port->hardware.dead_max_counts * 1.0e6f / port->hardware.pwm_clock_Hz;
    return range;
}

float ht_port_min_pulse_us(const ht_port *port)
{
    return port->hardware.min_pulse_us;
}

bool ht_port_accepts(const ht_port *port, const ht_pwm_setup *setup)
{
    float least = port->hardware.dead_min_us * 1.0e-6f * port->hardware.pwm_clock_Hz;
    return (setup->period_counts >= 8u) && (setup->dead_counts <= port->hardware.dead_max_counts)
           && (((float)setup->dead_counts + HT_DEAD_TOLERANCE_COUNTS) >= least);
}

bool ht_port_init(ht_port *port, const ht_pwm_setup *setup)
{
    note(port, HT_CALL_INIT);
    note(port, setup->period_counts);
    note(port, setup->dead_counts);
    note(port, (uint16_t)(setup->shadow ? 1u : 0u));
    note_float(port, setup->slow_Hz);
    port->input.tripped = (uint16_t)HT_ALL_LEGS;
    return ht_port_accepts(port, setup);
}

float ht_port_pwm_clock_Hz(const ht_port *port)
{
    return port->hardware.pwm_clock_Hz;
}

float ht_port_capture_clock_Hz(const ht_port *port)
{
    return port->hardware.capture_clock_Hz;
}

void ht_port_read(ht_port *port, ht_samples *samples)
{
    note(port, HT_CALL_READ);
    *samples = port->input.samples;
}

void ht_port_read_capture(ht_port *port, ht_capture *capture)
{
    note(port, HT_CALL_READ_CAPTURE);
    *capture = port->input.capture;
}

uint16_t ht_port_read_slow(ht_port *port, uint16_t channel, uint16_t next)
{
    uint16_t reading = port->input.slow[channel];
    note(port, HT_CALL_READ_SLOW);
    note(port, channel);
    note(port, next);
    note(port, reading);
    return reading;
}

uint32_t ht_port_read_absolute(const ht_port *port)
{
    note(port, HT_CALL_READ_ABSOLUTE);
    return port->input.absolute;
}

void ht_port_write(ht_port *port, const ht_compare *pattern)
{
    int leg;
    note(port, HT_CALL_WRITE);
    note(port, pattern->start);
    for (leg = 0; leg < HT_LEGS; leg++) {
        note(port, pattern->ca[leg]);
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        note(port, pattern->cb[leg]);
    }
}

void ht_port_gates_off(ht_port *port)
{
    note(port, HT_CALL_GATES_OFF);
    port->input.tripped = (uint16_t)HT_ALL_LEGS;
}

void ht_port_short_circuit(ht_port *port)
{
    note(port, HT_CALL_SHORT_CIRCUIT);
    port->input.tripped = (uint16_t)HT_ALL_LEGS;
}

void ht_port_outputs(ht_port *port, uint16_t which, uint16_t on)
{
    note(port, HT_CALL_OUTPUTS);
    note(port, which);
    note(port, on);
}

void ht_port_leg_off(ht_port *port, uint16_t leg)
{
    note(port, HT_CALL_LEG_OFF);
    note(port, leg);
    port->input.tripped = (uint16_t)(port->input.tripped | (uint16_t)(HT_LEG_U1 >> leg));
}

bool ht_port_gates_on(ht_port *port, uint16_t legs)
{
    note(port, HT_CALL_GATES_ON);
    note(port, legs);
    if (!port->input.trip_pin_low) {
        port->input.tripped = (uint16_t)(port->input.tripped & (uint16_t)~legs);
        port->input.interrupt_lost = false;
        port->input.beyond = 0u;
    }
    return note_answer(port, !port->input.trip_pin_low);
}

bool ht_port_trip_pin_low(const ht_port *port)
{
    note(port, HT_CALL_TRIP_PIN_LOW);
    return note_answer(port, port->input.trip_pin_low);
}

bool ht_port_tripped(const ht_port *port, uint16_t legs)
{
    note(port, HT_CALL_TRIPPED);
    note(port, legs);
    return note_answer(port, (port->input.tripped & legs) != 0u);
}

bool ht_port_leg_tripped(const ht_port *port, uint16_t leg)
{
    note(port, HT_CALL_LEG_TRIPPED);
    note(port, leg);
    return note_answer(port, (port->input.tripped & (uint16_t)(HT_LEG_U1 >> leg)) != 0u);
}

bool ht_port_interrupt_lost(const ht_port *port)
{
    note(port, HT_CALL_INTERRUPT_LOST);
    return note_answer(port, port->input.interrupt_lost);
}

void ht_port_trip_levels(ht_port *port, const ht_trip_levels *levels)
{
    int channel;
    note(port, HT_CALL_TRIP_LEVELS);
    for (channel = 0; channel < HT_ADC_CHANNELS; channel++) {
        note(port, levels->low[channel]);
    }
    for (channel = 0; channel < HT_ADC_CHANNELS; channel++) {
        note(port, levels->high[channel]);
    }
}

uint16_t ht_port_beyond(const ht_port *port)
{
    note(port, HT_CALL_BEYOND);
    note(port, port->input.beyond);
    return port->input.beyond;
}

void ht_port_begin_fast(ht_port *port)
{
    note(port, HT_CALL_BEGIN_FAST);
}

uint16_t ht_port_counts(const ht_port *port)
{
    note(port, HT_CALL_COUNTS);
    note(port, 0u); /* an interrupt takes no time of the host's PWM */
    return 0u;
}

bool ht_port_overrun(const ht_port *port)
{
    note(port, HT_CALL_OVERRUN);
    return note_answer(port, port->input.overrun);
}

void ht_port_ack_fast(ht_port *port)
{
    note(port, HT_CALL_ACK_FAST);
}
