#include "ht_pil_calls.h"

/* Flags. */
enum {
    EVENT = 0x01,
    OVERFLOW = 0x02,
    REVERSED = 0x04,
    FORWARD = 0x08,
    OVERRUN = 0x10,
    TRIP_PIN_LOW = 0x20,
    INTERRUPT_LOST = 0x40,
    INDEX = 0x80,
    ABSOLUTE = 0x100
};

void ht_pil_hardware_add(ht_packet *p, const ht_pil_hardware *hardware)
{
    ht_packet_add_float(p, hardware->pwm_clock_Hz);
    ht_packet_add_float(p, hardware->capture_clock_Hz);
    ht_packet_add_float(p, hardware->dead_min_us);
    ht_packet_add_float(p, hardware->min_pulse_us);
    ht_packet_add16(p, hardware->dead_max_counts);
}

void ht_pil_hardware_take(ht_reader *r, ht_pil_hardware *hardware)
{
    hardware->pwm_clock_Hz = ht_read_float(r);
    hardware->capture_clock_Hz = ht_read_float(r);
    hardware->dead_min_us = ht_read_float(r);
    hardware->min_pulse_us = ht_read_float(r);
    hardware->dead_max_counts = ht_read16(r);
}

static uint16_t flag(bool set, uint16_t bit)
{
    return set ? bit : 0u;
}

void ht_pil_inputs_add(ht_packet *p, const ht_pil_inputs *in)
{
    uint16_t flags = flag(in->capture.event, EVENT);
    uint16_t channel;
    flags |= flag(in->capture.overflow, OVERFLOW);
    flags |= flag(in->capture.reversed, REVERSED);
    flags |= flag(in->capture.forward, FORWARD);
    flags |= flag(in->overrun, OVERRUN);
    flags |= flag(in->trip_pin_low, TRIP_PIN_LOW);
    flags |= flag(in->interrupt_lost, INTERRUPT_LOST);
    flags |= flag(in->capture.index, INDEX);
    flags |= flag(in->absolute != HT_NO_READING, ABSOLUTE);
    for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
        ht_packet_add16(p, in->samples.adc[channel]);
    }
    ht_packet_add32(p, in->samples.position);
    ht_packet_add16(p, in->capture.period_ticks);
    ht_packet_add16(p, in->capture.age_ticks);
    ht_packet_add16(p, flags);
    ht_packet_add8(p, in->tripped);
    ht_packet_add8(p, in->beyond);
    for (channel = 0u; channel < (uint16_t)HT_SLOW_CHANNELS; channel++) {
        ht_packet_add16(p, in->slow[channel]);
    }
    if (in->capture.index) {
        ht_packet_add32(p, in->capture.index_position);
    }
    if (in->absolute != HT_NO_READING) {
        ht_packet_add32(p, in->absolute);
    }
}

void ht_pil_inputs_take(ht_reader *r, ht_pil_inputs *in)
{
    uint16_t channel;
    uint16_t flags;
    for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
        in->samples.adc[channel] = ht_read16(r);
    }
    in->samples.position = ht_read32(r);
    in->capture.period_ticks = ht_read16(r);
    in->capture.age_ticks = ht_read16(r);
    flags = ht_read16(r);
    in->tripped = ht_read8(r);
    in->beyond = ht_read8(r);
    for (channel = 0u; channel < (uint16_t)HT_SLOW_CHANNELS; channel++) {
        in->slow[channel] = ht_read16(r);
    }
    in->capture.index = (flags & (uint16_t)INDEX) != 0u;
    in->capture.index_position = in->capture.index ? ht_read32(r) : 0u;
    in->absolute = ((flags & (uint16_t)ABSOLUTE) != 0u) ? ht_read32(r) : HT_NO_READING;
    in->capture.event = (flags & (uint16_t)EVENT) != 0u;
    in->capture.overflow = (flags & (uint16_t)OVERFLOW) != 0u;
    in->capture.reversed = (flags & (uint16_t)REVERSED) != 0u;
    in->capture.forward = (flags & (uint16_t)FORWARD) != 0u;
    in->overrun = (flags & (uint16_t)OVERRUN) != 0u;
    in->trip_pin_low = (flags & (uint16_t)TRIP_PIN_LOW) != 0u;
    in->interrupt_lost = (flags & (uint16_t)INTERRUPT_LOST) != 0u;
}
