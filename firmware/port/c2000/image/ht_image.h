/** @file ht_image.h
 *  What a complete image does around the drive: start, interrupts, background.
 *  One drive on one chip, so its state is static here.
 */
#ifndef HT_IMAGE_H
#define HT_IMAGE_H

#include "ht_service.h"
#include "ht_port_c2000.h"

/** Commands of the mailbox, for a debugger. No watchdog guards a drive that it starts. */
enum {
    HT_COMMAND_NONE = 0,
    HT_COMMAND_START = 1,
    HT_COMMAND_STOP = 2,
    HT_COMMAND_CLEAR = 3,
    HT_COMMAND_SET = 4,   /**< parameter `id` becomes `value` */
    HT_COMMAND_GET = 5,   /**< `value` becomes parameter `id` */
    HT_COMMAND_SAVE = 6,  /**< keep the parameters in force over a power-off */
    HT_COMMAND_FORGET = 7 /**< forget those that are kept */
};

/** For a debugger's expression window: write `id` and `value`, then `command`. The
 *  background executes it, leaves an `ht_result` in `result` and HT_COMMAND_NONE in
 *  `command`. After HT_COMMAND_SET and HT_COMMAND_GET `smallest` and `largest` are the
 *  allowed range of parameter `id`. */
typedef struct {
    volatile uint16_t command;
    volatile uint16_t id;
    volatile float value;
    volatile uint16_t result;
    volatile float smallest;
    volatile float largest;
} ht_mailbox;

/** The result of the start, for a debugger, if a drive does not start. */
enum {
    HT_START_DONE = 0,
    HT_START_CLOCK_MISSING = 1, /**< the crystal does not oscillate; 1..3 as in ht_clock */
    HT_START_NO_LOCK = 2,       /**< the PLL does not lock */
    HT_START_CLOCK_WRONG = 3,   /**< it locks at another frequency */
    HT_START_REFUSED = 4,       /**< the parameters do not fit together or the hardware */
    HT_START_UNDER_WAY = 99
};

/** Handle of the image's only chip. On the host the test around the image has it. */
#ifdef __TMS320C2000__
#define HT_TARGET_IO ((ht_io *)0)
#else
extern ht_regfile ht_image_registers;
#define HT_TARGET_IO (&ht_image_registers)
#endif

extern volatile uint16_t ht_image_start_result;
extern ht_mailbox ht_image_mailbox;
extern ht_port ht_image_port;
extern ht_drive ht_image_drive;
extern ht_service ht_image_service;
extern ht_store ht_image_store;
extern ht_drive_log ht_image_log;
extern ht_reset_memory ht_image_reset_memory; /**< kept over a reset */

/** The memory for parameters that this image is built with: flash sectors (folder store/), or
 *  none (ht_no_store.c), then `memory` is left alone and the answer is false. */
bool ht_image_memory(ht_port *port, ht_store_port *memory);
/** The same for the log. */
bool ht_image_log_memory(ht_port *port, ht_store_port *memory);

/** From reset to a drive in IDLE with both interrupts running. With a wrong system clock: to a
 *  drive in FAULT without interrupts and without pins to switch a gate on, which answers on the
 *  serial line. Does not return if the parameters are refused: the watchdog then resets the chip. */
void ht_image_start(void);

/** One turn of the background loop. */
void ht_image_background(void);

int main(void);

#endif
