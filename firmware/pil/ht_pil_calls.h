/** @file ht_pil_calls.h
 *  What host and call target (docs/pil.md) exchange: the hardware's inputs one way, the
 *  driver calls the other.
 */
#ifndef HT_PIL_CALLS_H
#define HT_PIL_CALLS_H

#include "ht_packet.h"
#include "ht_reader.h"
#include "port.h"

/** Rate of a board's serial line, baud, unless both ends are set to another one. It is the fastest
 *  that both C2000 clocks (75 and 50 MHz / 8) make exactly. */
#ifndef HT_PIL_BAUD
#define HT_PIL_BAUD 625000u
#endif

/** Calls of port.h, in the order they were made. A call is its code (16 bits), then its
 *  arguments, then what the drive was answered, where there is an answer. */
enum {
    HT_CALL_INIT = 1,  /**< period_counts, dead_counts, shadow, slow_Hz (float) */
    HT_CALL_WRITE = 2, /**< start, ca of each leg, cb of each leg */
    HT_CALL_GATES_OFF = 3,
    HT_CALL_GATES_ON = 4, /**< legs, answer */
    HT_CALL_TRIPPED = 5,  /**< legs, answer */
    HT_CALL_BEGIN_FAST = 6,
    HT_CALL_READ = 7,
    HT_CALL_READ_CAPTURE = 8,
    HT_CALL_OVERRUN = 9, /**< answer */
    HT_CALL_ACK_FAST = 10,
    HT_CALL_TRIP_PIN_LOW = 11,   /**< answer */
    HT_CALL_LEG_TRIPPED = 12,    /**< leg, answer */
    HT_CALL_LEG_OFF = 13,        /**< leg */
    HT_CALL_INTERRUPT_LOST = 14, /**< answer */
    HT_CALL_COUNTS = 15,         /**< answer, a number */
    HT_CALL_TRIP_LEVELS = 16,    /**< low of each channel, high of each channel */
    HT_CALL_BEYOND = 17,         /**< answer, channels */
    HT_CALL_SHORT_CIRCUIT = 18,
    HT_CALL_OUTPUTS = 19,   /**< which, on: HT_OUT_... */
    HT_CALL_READ_SLOW = 20, /**< channel, next, answer */
    HT_CALL_READ_ABSOLUTE = 21
};

/** The hardware's fixed properties. They come with INIT. */
typedef struct {
    float pwm_clock_Hz;
    float capture_clock_Hz;
    float dead_min_us;        /**< shortest dead time */
    float min_pulse_us;       /**< shortest gate pulse */
    uint16_t dead_max_counts; /**< longest dead time, counts of the PWM clock */
} ht_pil_hardware;

void ht_pil_hardware_add(ht_packet *p, const ht_pil_hardware *hardware);
void ht_pil_hardware_take(ht_reader *r, ht_pil_hardware *hardware);

/** The answers of the target's port to the drive. They come with every request that a drive
 *  carries out. */
typedef struct {
    ht_samples samples;
    ht_capture capture;
    uint16_t tripped; /**< legs whose trip latch is set, a state word */
    bool overrun;
    bool trip_pin_low;
    bool interrupt_lost;
    uint16_t beyond;                 /**< channels whose comparators have tripped */
    uint16_t slow[HT_SLOW_CHANNELS]; /**< readings; of one whose turn it is not: of the other */
    uint32_t absolute;               /**< reading, HT_NO_READING: none */
} ht_pil_inputs;

void ht_pil_inputs_add(ht_packet *p, const ht_pil_inputs *in);
void ht_pil_inputs_take(ht_reader *r, ht_pil_inputs *in);

#endif
