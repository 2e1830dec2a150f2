/** @file ht_drivers.h
 *  The drivers of the C2000 targets, one file each. The functions of port.h are with
 *  the module that they talk to. All may be called again.
 *
 *  A register's macro is its word address, of four digits or more. Two digits are words from the first
 *  register of a module that is elsewhere on another chip, or of which there are several; where the
 *  module is, the map says (ht_c2000_map.h). Registers have TI's names, with HT_ before those that
 *  several files use.
 */
#ifndef HT_DRIVERS_H
#define HT_DRIVERS_H

#include "ht_line.h"
#include "ht_port_c2000.h"

/** Pins of a GPIO port, and words from its levels to the next port's. */
#define HT_PORT_PINS 32u
#define HT_PORT_WORDS 8u

/* ht_watchdog.c. Both halves are needed to keep it from resetting the device. */

/** The cause of the chip's reset (ht_reset.h), from flags that are cleared then. A watchdog's flag counts
 *  before the pin's, because a watchdog's reset pulls the pin, and before power-on's, because power-on
 *  clears all others: what is there beside it came later. */
uint16_t ht_watchdog_cause(ht_port *port);
/** On, with its longest time: for the start. */
void ht_watchdog_hold(ht_port *port);
/** On, with the shortest time that is longer than 2.5 slow periods. */
void ht_watchdog_start(ht_port *port, float slow_Hz);
/** First half, from the slow interrupt. */
void ht_watchdog_first(ht_port *port);
/** Second half, from the background. */
void ht_watchdog_second(ht_port *port);

/* ht_clock_f28335.c, ht_clock_f28377s.c */

/** Crystal, PLL, prescalers, clocks of the modules in use. SYSCLKOUT is measured against the
 *  crystal (and on the F28377S against the internal oscillator). If it is not right in
 *  several tries: a clock without PLL that is good enough for the serial line, with
 *  `port->sci_clock_Hz` to go by. */
ht_clock ht_clock_start_f28335(ht_port *port);
ht_clock ht_clock_start_f28377s(ht_port *port);
/** TBCLKSYNC: stop or start all PWM counters together. */
void ht_clock_pwm_f28335(ht_port *port, bool run);
void ht_clock_pwm_f28377s(ht_port *port, bool run);

/* ht_flash.c */

/** Wait states for the full clock; pump, checks and caches as a running image has them. Must run
 *  from RAM. */
void ht_flash_start(ht_port *port);
/** To be called before erasing, programming, or reading what may be half programmed. The flash
 *  pump belongs to bank 0 then; reads do not check the ECC, whose errors would be non-maskable
 *  interrupts, and bypass the caches. Lasts until `ht_flash_start`. Must run from RAM. F28335:
 *  nothing to do. */
void ht_flash_unchecked(ht_port *port);

/* ht_pins.c */

/** Encoder, trip pin. */
void ht_pins_start(ht_port *port);
/** SCI. */
void ht_pins_line(ht_port *port);
/** Outputs high or low (ht_port_outputs). */
void ht_pins_outputs(ht_port *port, uint16_t which, uint16_t on);
/** From now on their pins are outputs, and low. */
void ht_pins_start_outputs(ht_port *port);
/** The PWM's twelve pins. Only with the trip latched: from here on they drive the gates. */
void ht_pins_pwm(ht_port *port);
/** The PWM's twelve pins as inputs, as after reset: they drive nothing. */
void ht_pins_release(ht_port *port);

/* ht_adc.c */

/** Calibrate, power up, wait until it is settled, set up the sequence: ePWM1's SOCA
 *  starts it, its end raises the fast interrupt. */
void ht_adc_start(ht_port *port);

/* ht_pwm.c */

/** All legs, tripped and with the counters stopped. */
void ht_pwm_start(ht_port *port, const ht_pwm_setup *setup);

/* ht_eqep.c */

/** Quadrature counter and capture unit. Nothing in here moves the counter. */
void ht_eqep_start(ht_port *port);
/** Position counter. */
uint32_t ht_eqep_position(const ht_port *port);

/** Digital compare of an ePWM module, F28377S: ht_dead_man.c uses event A, ht_cmpss.c event B. */
#define HT_TZDCSEL 0x82u
#define HT_DCTRIPSEL 0xC0u

/* ht_timer.c */

/** First registers of the CPU timers. 0: the slow interrupt. 1: measures the system clock at the start;
 *  F28335: the dead-man timer (ht_dead_man.h). 2: another clock's periods, for that measurement. */
#define HT_TIMER0 0x0C00u
#define HT_TIMER1 0x0C08u
#define HT_TIMER2 0x0C10u
/** A timer's period, 32 bits, and its control: words from its first register. */
#define HT_TIMER_PRD 0x02u
#define HT_TCR 0x04u
/** Let the timer begin anew; its interrupt stays enabled. */
#define HT_TCR_WIND 0x4020u /* TIE, TRB */

void ht_timer_start(ht_port *port, float slow_Hz);
/* A CPU timer, given by its first register, as a counter without interrupt. */
/** Stop it and let it begin at `from`; it counts down. */
void ht_counter_prepare(ht_port *port, uint32_t timer, uint32_t from);
/** Start it. */
void ht_counter_run(ht_port *port, uint32_t timer);
/** Has it passed 0? */
bool ht_counter_passed(const ht_port *port, uint32_t timer);
/** Stop it. Returns how many counts it has made. */
uint32_t ht_counter_stop(ht_port *port, uint32_t timer);

/* ht_sci.c: 8 data bits, no parity, one stop bit, FIFOs of 16 */

/** False, and nothing changed, for a rate that the divider cannot make. */
bool ht_sci_start(ht_port *port, uint32_t baud);
/** Rate in force, baud. */
float ht_sci_baud(const ht_port *port);
/** Take up to `n` bytes that have arrived, without waiting. Returns how many. */
uint16_t ht_sci_read(ht_port *port, uint16_t *octets, uint16_t n);
/** Hand over up to `n` bytes, without waiting. Returns how many were taken. */
uint16_t ht_sci_write(ht_port *port, const uint16_t *octets, uint16_t n);

/** Let the receiver go on after a break, a framing error or an overflow, which stop it. Settings
 *  stay. True if bytes were lost. */
bool ht_sci_recover(ht_port *port);
/** The SCI as the link's line, at the rate in force. */
ht_line ht_sci_line(ht_port *port);

/* ht_pie.c */

/** The image's interrupt functions. */
typedef struct {
    ht_isr fast;
    ht_isr slow;
    ht_isr lost; /**< the dead-man timer has expired (F28335) */
    ht_isr unexpected;
} ht_isrs;

/** Vectors, and the interrupts enabled at the interrupt controller. */
void ht_pie_start(ht_port *port, const ht_isrs *isrs);
/** Enable interrupts at the CPU. */
void ht_pie_enable(ht_port *port);
/** First in the slow interrupt: lets the fast one interrupt it. */
void ht_pie_begin_slow(ht_port *port);
/** Last in the slow interrupt. */
void ht_pie_end_slow(ht_port *port);
#endif
