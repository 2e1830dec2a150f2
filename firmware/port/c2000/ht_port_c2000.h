/** @file ht_port_c2000.h
 *  `ht_port` of the C2000 targets. One PWM module per leg, legs u1 u2 w1 w2 v1 v2.
 *
 *  Order on a target: `ht_port_bind`, `ht_board_start`, the vectors (ht_image.c),
 *  then `ht_port_init` (within `ht_drive_init`), interrupts on.
 */
#ifndef HT_PORT_C2000_H
#define HT_PORT_C2000_H

#include "../port.h"
#include "ht_board.h"
#include "ht_reg.h"

/** Result of the measurement of the system clock at the start. */
typedef enum {
    HT_CLOCK_RIGHT = 0,
    HT_CLOCK_MISSING = 1, /**< the crystal does not oscillate */
    HT_CLOCK_NO_LOCK = 2, /**< the PLL does not lock */
    HT_CLOCK_WRONG = 3    /**< it locks at another frequency than the one asked for */
} ht_clock;

struct ht_port {
    ht_io *io; /**< register file (unused on the DSP) */
    const ht_board *board;
    const ht_c2000_map *map; /**< the board's device */
    uint32_t leg[HT_LEGS];   /**< PWM module of each leg */
    uint32_t eqep;           /**< the encoder's module */
    uint32_t counter;        /**< of the PWM that starts the conversion */
    bool shadow;
    ht_clock clock;        /**< not right: pins and ADC are as after reset */
    uint32_t sci_clock_Hz; /**< LSPCLK */
    uint16_t reset_cause;  /**< of the start (ht_reset.h) */
};

/** The port of a board. Touches no register. */
void ht_port_bind(ht_port *port, ht_io *io, const ht_board *board);

/** After reset, or after a restart without one: first the PWM's pins become inputs, which takes the
 *  gates off. Then watchdog, PLL, flash, module clocks, ADC, SCI, the other pins. Takes a few ms. False if the clock is not the right one (`port->clock` says why): then
 *  only the serial line is started, at 115200 baud, and `ht_port_init` leaves the
 *  PWM's pins inputs, so that no gate can be switched on. */
bool ht_board_start(ht_port *port);

#endif
