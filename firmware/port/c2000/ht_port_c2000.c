/* The port of the C2000 targets: which driver does what, and in what order. */
#include "ht_port_c2000.h"

#include "ht_cmpss.h"
#include "ht_dead_man.h"

/* Without a right clock: the internal oscillator makes no better rate. */
#define EMERGENCY_BAUD 115200u
#define EQEP_STRIDE 0x40u /* from one module to the next, on both families */

void ht_port_bind(ht_port *port, ht_io *io, const ht_board *board)
{
    uint16_t leg;
    port->io = io;
    port->board = board;
    port->map = board->map;
    port->shadow = true;
    port->clock = HT_CLOCK_RIGHT;
    port->reset_cause = 0u;
    port->sci_clock_Hz = board->map->sci_clock_Hz;
    port->eqep = board->map->eqep + ((uint32_t)board->eqep * EQEP_STRIDE);
    port->counter = board->map->epwm + board->map->tbctr; /* ePWM1 starts the conversion */
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        port->leg[leg] = board->map->epwm + ((uint32_t)board->module[leg] * board->map->stride);
    }
}

bool ht_board_start(ht_port *port)
{
    ht_pins_release(port); /* a debugger may have started it anew while the gates were on */
    port->reset_cause = ht_watchdog_cause(port);
    ht_watchdog_hold(port);
    ht_flash_start(port); /* before the clock that needs it */
    if (port->map->clock_pllcr) {
        port->clock = ht_clock_start_f28335(port);
    } else {
        port->clock = ht_clock_start_f28377s(port);
    }
    ht_pins_line(port);
    if (port->clock == HT_CLOCK_RIGHT) {
        ht_pins_start(port);
        ht_pins_start_outputs(port);
        ht_adc_start(port);
        (void)ht_sci_start(port, port->board->baud);
    } else {
        (void)ht_sci_start(port, EMERGENCY_BAUD);
    }
    return port->clock == HT_CLOCK_RIGHT;
}

ht_dead_range ht_port_dead_range(const ht_port *port)
{
    ht_dead_range range;
    range.min_us = port->board->dead_min_us;
    range.max_us = (float)port->map->dead_max_counts * 1.0e6f / port->map->pwm_clock_Hz;
    return range;
}

float ht_port_min_pulse_us(const ht_port *port)
{
    return port->board->min_pulse_us;
}

bool ht_port_accepts(const ht_port *port, const ht_pwm_setup *setup)
{
    float least = port->board->dead_min_us * 1.0e-6f * port->map->pwm_clock_Hz;
    return (setup->period_counts >= 8u) && (setup->dead_counts <= port->map->dead_max_counts)
           && (((float)setup->dead_counts + HT_DEAD_TOLERANCE_COUNTS) >= least);
}

static void run_counters(ht_port *port, bool run)
{
    if (port->map->clock_pllcr) {
        ht_clock_pwm_f28335(port, run);
    } else {
        ht_clock_pwm_f28377s(port, run);
    }
}

bool ht_port_init(ht_port *port, const ht_pwm_setup *setup)
{
    if (!ht_port_accepts(port, setup)) {
        ht_port_gates_off(port);
        return false;
    }
    if (port->clock != HT_CLOCK_RIGHT) {
        return true; /* no time of the PWM's would be right: nothing is set up, the pins stay inputs */
    }
    port->shadow = setup->shadow;
    run_counters(port, false);
    ht_pwm_start(port, setup);
    ht_dead_man_start(port, setup->period_counts);
    ht_cmpss_start(port);
    ht_eqep_start(port);
    ht_timer_start(port, setup->slow_Hz);
    ht_watchdog_start(port, setup->slow_Hz);
    ht_pins_pwm(port);        /* tripped: all switches off */
    run_counters(port, true); /* last: all counters start together */
    return true;
}

float ht_port_pwm_clock_Hz(const ht_port *port)
{
    return port->map->pwm_clock_Hz;
}

void ht_port_outputs(ht_port *port, uint16_t which, uint16_t on)
{
    ht_pins_outputs(port, which, on);
}
