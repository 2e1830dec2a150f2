/* Processor in the loop on the DSP: the chip around the drive, in place of ht_image.c. The
 * plant is on the PC, and so is the driver that the drive's calls reach: no PWM may
 * leave this chip. Its twelve pins are inputs all the time, so the gate drivers' own
 * pull-downs keep the switches off; the PWM's counters stand still and no interrupt is
 * enabled. The background does all: watchdog, serial line, requests. */
#include "ht_drivers.h"
#include "ht_image.h"
#include "ht_pil_calls.h"
#include "ht_pil_server.h"

#ifndef HT_BOARD
#error "HT_BOARD: name of the board's table, e.g. ht_board_f28335"
#endif

static ht_port chip;

volatile uint16_t ht_image_start_result = (uint16_t)HT_START_UNDER_WAY;

static bool start(ht_port *port)
{
    bool started;
    ht_pins_release(port); /* whatever ran here before, a debugger's load may follow it */
    ht_watchdog_hold(port);
    ht_flash_start(port); /* before the clock that needs it */
    port->clock = port->map->clock_pllcr ? ht_clock_start_f28335(port)
                                         : ht_clock_start_f28377s(port);
    ht_image_start_result = (uint16_t)port->clock;
    started = port->clock == HT_CLOCK_RIGHT;
    if (started) {
        ht_pins_start(port);
        ht_pins_line(port);
        started = ht_sci_start(port, HT_PIL_BAUD);
    }
    return started;
}

/* Both halves here: no interrupt runs that could stand still by itself. */
static void feed(void)
{
    ht_watchdog_first(&chip);
    ht_watchdog_second(&chip);
}

void ht_image_start(void)
{
    chip.io = HT_TARGET_IO;
    chip.board = &HT_BOARD;
    chip.map = chip.board->map;
    chip.sci_clock_Hz = chip.map->sci_clock_Hz;
    HT_DINT(chip.io);
    if (!start(&chip)) {
        for (;;) { /* ht_image_start_result says why; no reset would help */
            feed();
            HT_IDLE(chip.io);
        }
    }
    ht_pil_server_reset();
}

void ht_image_background(void)
{
    uint16_t octet;
    feed();
    if (ht_pil_server_give(&octet)) {
        if (ht_sci_write(&chip, &octet, 1u) == 1u) {
            ht_pil_server_sent();
        }
    } else if (ht_sci_read(&chip, &octet, 1u) == 1u) {
        ht_pil_server_take(octet);
    } else {
        (void)ht_sci_recover(&chip); /* a receiver that an error stopped brings no bytes */
    }
}
