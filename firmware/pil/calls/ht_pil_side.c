#include "ht_pil.h"

#define ALL_LEGS ((uint16_t)(((uint16_t)1u << (uint16_t)HT_LEGS) - 1u))

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
    union {
        float value;
        uint32_t bits;
    } u;
    u.value = value;
    note(port, (uint16_t)(u.bits & 0xFFFFu));
    note(port, (uint16_t)(u.bits >> 16));
}

uint16_t ht_side_registers(void)
{
    return 0u;
}

bool ht_side_take(ht_pil_side *side, ht_port *port, const uint16_t *words, uint16_t n)
{
    uint16_t i;
    if (n != (uint16_t)HT_INPUTS) {
        return false;
    }
    for (i = 0u; i < (uint16_t)HT_INPUTS; i++) {
        port->input[i] = words[i];
    }
    port->tripped = words[HT_INPUT_TRIPPED];
    side->count = 0u;
    return true;
}

bool ht_side_init(ht_pil_side *side, ht_port *port, uint16_t device, const uint16_t *words,
                  uint16_t n)
{
    (void)device;
    if (n != ((uint16_t)HT_CALLS_AT_INPUTS + (uint16_t)HT_INPUTS)) {
        return false;
    }
    port->notes = side;
    port->pwm_clock_Hz = ht_frame_float(&words[HT_CALLS_AT_PWM_CLOCK]);
    port->capture_clock_Hz = ht_frame_float(&words[HT_CALLS_AT_CAPTURE_CLOCK]);
    port->dead_min_us = ht_frame_float(&words[HT_CALLS_AT_DEAD_MIN]);
    port->dead_max_counts = words[HT_CALLS_AT_DEAD_MAX];
    return ht_side_take(side, port, &words[HT_CALLS_AT_INPUTS], HT_INPUTS);
}

void ht_side_status(ht_pil_side *side, const ht_port *port, ht_frame *reply)
{
    (void)side;
    (void)port;
    ht_frame_add32(reply, 0u);
    ht_frame_add32(reply, 0u);
    ht_frame_add32(reply, 0u);
}

void ht_side_tell(ht_pil_side *side, ht_port *port, ht_frame *reply)
{
    uint16_t i;
    (void)port;
    if (side->count > HT_CALLS_WORDS) {
        ht_frame_add(reply, 0u); /* no such call */
        return;
    }
    for (i = 0u; i < side->count; i++) {
        ht_frame_add(reply, side->word[i]);
    }
}

/* --- port.h --------------------------------------------------------------------- */

ht_dead_range ht_port_dead_range(const ht_port *port)
{
    ht_dead_range range;
    range.min_us = port->dead_min_us;
    range.max_us = (float)port->dead_max_counts * 1.0e6f / port->pwm_clock_Hz;
    return range;
}

bool ht_port_accepts(const ht_port *port, const ht_pwm_setup *setup)
{
    float least = port->dead_min_us * 1.0e-6f * port->pwm_clock_Hz;
    return (setup->period_counts >= 8u) && (setup->dead_counts <= port->dead_max_counts)
           && (((float)setup->dead_counts + HT_DEAD_TOLERANCE_COUNTS) >= least);
}

bool ht_port_init(ht_port *port, const ht_pwm_setup *setup)
{
    note(port, HT_CALL_INIT);
    note(port, setup->period_counts);
    note(port, setup->dead_counts);
    note(port, (uint16_t)(setup->shadow ? 1u : 0u));
    note_float(port, setup->slow_Hz);
    port->tripped = ALL_LEGS;
    return ht_port_accepts(port, setup);
}

float ht_port_pwm_clock_Hz(const ht_port *port)
{
    return port->pwm_clock_Hz;
}

float ht_port_capture_clock_Hz(const ht_port *port)
{
    return port->capture_clock_Hz;
}

void ht_port_read(ht_port *port, ht_samples *samples)
{
    int channel;
    note(port, HT_CALL_READ);
    for (channel = 0; channel < HT_ADC_CHANNELS; channel++) {
        samples->adc[channel] = port->input[HT_INPUT_ADC + channel];
    }
    samples->position = ht_frame_32(&port->input[HT_INPUT_POSITION]);
}

void ht_port_read_capture(ht_port *port, ht_capture *capture)
{
    uint16_t flags = port->input[HT_INPUT_FLAGS];
    note(port, HT_CALL_READ_CAPTURE);
    capture->period_ticks = port->input[HT_INPUT_PERIOD_TICKS];
    capture->age_ticks = port->input[HT_INPUT_AGE_TICKS];
    capture->event = (flags & (uint16_t)HT_FLAG_EVENT) != 0u;
    capture->overflow = (flags & (uint16_t)HT_FLAG_OVERFLOW) != 0u;
    capture->reversed = (flags & (uint16_t)HT_FLAG_REVERSED) != 0u;
    capture->forward = (flags & (uint16_t)HT_FLAG_FORWARD) != 0u;
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
    port->tripped = ALL_LEGS;
}

bool ht_port_gates_on(ht_port *port)
{
    bool allowed = port->input[HT_INPUT_TRIP_PIN_LOW] == 0u;
    note(port, HT_CALL_GATES_ON);
    note(port, allowed ? 1u : 0u);
    if (allowed) {
        port->tripped = 0u;
    }
    return allowed;
}

bool ht_port_trip_pin_low(const ht_port *port)
{
    note(port, HT_CALL_TRIP_PIN_LOW);
    note(port, port->input[HT_INPUT_TRIP_PIN_LOW]);
    return port->input[HT_INPUT_TRIP_PIN_LOW] != 0u;
}

bool ht_port_tripped(const ht_port *port)
{
    uint16_t any = (port->tripped != 0u) ? 1u : 0u;
    note(port, HT_CALL_TRIPPED);
    note(port, any);
    return any != 0u;
}

bool ht_port_leg_tripped(const ht_port *port, uint16_t leg)
{
    uint16_t answer = (uint16_t)((uint16_t)(port->tripped >> leg) & 1u);
    note(port, HT_CALL_LEG_TRIPPED);
    note(port, leg);
    note(port, answer);
    return answer != 0u;
}

void ht_port_begin_fast(ht_port *port)
{
    note(port, HT_CALL_BEGIN_FAST);
}

bool ht_port_overrun(const ht_port *port)
{
    note(port, HT_CALL_OVERRUN);
    note(port, port->input[HT_INPUT_OVERRUN]);
    return port->input[HT_INPUT_OVERRUN] != 0u;
}

void ht_port_ack_fast(ht_port *port)
{
    note(port, HT_CALL_ACK_FAST);
}
