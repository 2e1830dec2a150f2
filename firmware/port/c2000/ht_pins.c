/* Pin multiplexers. After reset every pin is an input; on the F28335 the pull-ups of
 * GPIO0..11 are off, on the F28377S all are: a resistor at the gate driver's input decides. It
 * pulls down, or up where the driver inverts (`gates_active_low`). */
#include "ht_change.h"
#include "ht_drivers.h"

/* Words from a port's first register; the second half of its 32 pins is 2 further. */
#define GPYQSEL1 0x02u
#define GPYMUX1 0x06u
#define GPYDIR 0x0Au
#define GPYPUD 0x0Cu
#define GPYGMUX1 0x20u /* F28377S: upper two bits of the position */
#define GPYCTRL 0x00u
/* From a port's levels. */
#define GPYSET 0x02u
#define GPYCLEAR 0x04u
#define QUALIFY_SYNC 0u
#define QUALIFY_SIX 2u /* six samples in a row must agree */
#define QUALIFY_ASYNC 3u
#define QUALIFIED_PINS 8u /* share a sampling period, ... */
#define QUALPRD_BITS 8u   /* ... of 2 x QUALPRD system clocks */
#define QUALPRD 0x000000FFu
#define ALL_OUTPUTS 0xFFFFu

/* The registers of the port that a pin belongs to, and of the half with its two-bit fields. */
static uint32_t first_register(const ht_port *port, const ht_pin *pin)
{
    return port->map->gpio + ((uint32_t)(pin->gpio / 32u) * port->map->gpio_stride);
}

static uint32_t half_of(uint32_t first, const ht_pin *pin)
{
    return first + (((pin->gpio % 32u) < 16u) ? 0u : 2u);
}

static uint16_t shift_of(const ht_pin *pin)
{
    return (uint16_t)(2u * (pin->gpio % 16u));
}

static void set_up(ht_port *port, const ht_pin *pin, uint32_t qualify, bool pull_up)
{
    uint32_t first = first_register(port, pin);
    uint32_t half = half_of(first, pin);
    uint32_t bit = (uint32_t)1u << (pin->gpio % 32u);
    uint16_t shift = shift_of(pin);
    uint32_t field = (uint32_t)3u << shift;
    uint32_t mux = pin->mux;
    ht_change32(port->io, first + GPYPUD, bit, pull_up ? 0u : bit);
    ht_change32(port->io, half + GPYQSEL1, field, qualify << shift);
    ht_change32(port->io, first + GPYDIR, bit, 0u); /* for the pins that stay GPIO: input */
    if (port->map->gpio_groups) {                   /* group first: no other function in between */
        ht_change32(port->io, half + GPYGMUX1, field, (mux >> 2) << shift);
    }
    ht_change32(port->io, half + GPYMUX1, field, (mux & 3u) << shift);
}

/* The sampling period of a pin and its seven neighbours. */
static void qualify(ht_port *port, const ht_pin *pin)
{
    uint16_t shift = (uint16_t)(QUALPRD_BITS * ((pin->gpio % 32u) / QUALIFIED_PINS));
    ht_change32(port->io, first_register(port, pin) + GPYCTRL, (uint32_t)QUALPRD << shift,
                (uint32_t)port->map->encoder_qualprd << shift);
}

/* Pins that end inside the package float otherwise. */
static void hold_unbonded(ht_port *port)
{
    uint16_t n;
    for (n = 0u; n < (uint16_t)HT_PORTS; n++) {
        uint32_t pins = port->board->unbonded[n];
        if (pins != 0u) {
            uint32_t first = port->map->gpio + ((uint32_t)n * port->map->gpio_stride);
            ht_change32(port->io, first + GPYPUD, pins, 0u);
        }
    }
}

void ht_pins_outputs(ht_port *port, uint16_t which, uint16_t on)
{
    uint16_t n;
    for (n = 0u; n < (uint16_t)HT_OUTPUTS; n++) {
        uint32_t gpio = port->board->output[n].gpio;
        uint32_t data = port->map->gpio_data + ((gpio / HT_PORT_PINS) * HT_PORT_WORDS);
        uint32_t high = (((uint32_t)on >> n) & 1u) != 0u ? GPYSET : GPYCLEAR;
        if ((((uint32_t)which >> n) & 1u) != 0u) {
            HT_WR32(port->io, data + high, (uint32_t)1u << (gpio % HT_PORT_PINS));
        }
    }
}

void ht_pins_start_outputs(ht_port *port)
{
    uint16_t n;
    ht_pins_outputs(port, ALL_OUTPUTS, 0u); /* low before they are outputs */
    HT_EALLOW(port->io);
    for (n = 0u; n < (uint16_t)HT_OUTPUTS; n++) {
        const ht_pin *pin = &port->board->output[n];
        uint32_t bit = (uint32_t)1u << (pin->gpio % HT_PORT_PINS);
        set_up(port, pin, QUALIFY_SYNC, false);
        ht_change32(port->io, first_register(port, pin) + GPYDIR, bit, bit);
    }
    HT_EDIS(port->io);
}

void ht_pins_start(ht_port *port)
{
    const ht_board *board = port->board;
    HT_EALLOW(port->io);
    hold_unbonded(port);
    /* The trip acts without a clock. No pull-up: a broken wire trips (the board pulls down). */
    set_up(port, &board->trip, QUALIFY_ASYNC, false);
    if (port->map->trip_select != 0u) {
        HT_WR16(port->io, port->map->trip_select, board->trip.gpio);
    }
    qualify(port, &board->encoder_a);
    qualify(port, &board->encoder_b);
    qualify(port, &board->encoder_index);
    set_up(port, &board->encoder_a, QUALIFY_SIX, true);
    set_up(port, &board->encoder_b, QUALIFY_SIX, true);
    set_up(port, &board->encoder_index, QUALIFY_SIX, true);
    HT_EDIS(port->io);
}

void ht_pins_line(ht_port *port)
{
    const ht_board *board = port->board;
    HT_EALLOW(port->io);
    set_up(port, &board->receive, QUALIFY_ASYNC, true);
    set_up(port, &board->transmit, QUALIFY_SYNC, true);
    HT_EDIS(port->io);
}

void ht_pins_pwm(ht_port *port)
{
    uint16_t n;
    HT_EALLOW(port->io);
    for (n = 0u; n < (2u * (uint16_t)HT_LEGS); n++) {
        set_up(port, &port->board->pwm[n], QUALIFY_SYNC, port->board->gates_active_low);
    }
    HT_EDIS(port->io);
}

void ht_pins_release(ht_port *port)
{
    uint16_t n;
    HT_EALLOW(port->io);
    for (n = 0u; n < (2u * (uint16_t)HT_LEGS); n++) {
        const ht_pin *pin = &port->board->pwm[n];
        uint32_t first = first_register(port, pin);
        /* Input first: a pin that leaves the PWM is one at once. */
        uint32_t bit = (uint32_t)1u << (pin->gpio % 32u);
        ht_change32(port->io, first + GPYDIR, bit, 0u);
        ht_change32(port->io, first + GPYPUD, bit, port->board->gates_active_low ? 0u : bit);
        ht_change32(port->io, half_of(first, pin) + GPYMUX1, (uint32_t)3u << shift_of(pin), 0u);
    }
    for (n = 0u; n < (uint16_t)HT_OUTPUTS; n++) {
        const ht_pin *pin = &port->board->output[n];
        uint32_t bit = (uint32_t)1u << (pin->gpio % HT_PORT_PINS);
        ht_change32(port->io, first_register(port, pin) + GPYDIR, bit, 0u);
    }
    HT_EDIS(port->io);
}
