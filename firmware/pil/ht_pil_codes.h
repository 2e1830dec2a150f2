/** @file ht_pil_codes.h
 *  Words that host and a target that tells calls (ht_pil_calls.h) have in common.
 */
#ifndef HT_PIL_CODES_H
#define HT_PIL_CODES_H

/** Rate of a board's serial line, baud, unless both ends are told another one. The C2000
 *  boards' clocks (75 and 50 MHz / 8) have no faster one in common that is exact. */
#ifndef HT_PIL_BAUD
#define HT_PIL_BAUD 625000u
#endif

/** Calls, in the order they were made; after some of them arguments. */
enum {
    HT_CALL_INIT = 1,  /**< period_counts, dead_counts, shadow, slow_Hz (float) */
    HT_CALL_WRITE = 2, /**< start, ca of each leg, cb of each leg */
    HT_CALL_GATES_OFF = 3,
    HT_CALL_GATES_ON = 4, /**< the answer */
    HT_CALL_TRIPPED = 5,  /**< the answer */
    HT_CALL_BEGIN_FAST = 6,
    HT_CALL_READ = 7,
    HT_CALL_READ_CAPTURE = 8,
    HT_CALL_OVERRUN = 9, /**< the answer */
    HT_CALL_ACK_FAST = 10,
    HT_CALL_TRIP_PIN_LOW = 11, /**< the answer */
    HT_CALL_LEG_TRIPPED = 12   /**< leg, the answer */
};

/** Words of INIT, after the parameters: clocks and the shortest dead time (us) as floats, the
 *  longest one in counts, inputs. */
enum {
    HT_CALLS_AT_PWM_CLOCK = 0,
    HT_CALLS_AT_CAPTURE_CLOCK = 2,
    HT_CALLS_AT_DEAD_MIN = 4,
    HT_CALLS_AT_DEAD_MAX = 6,
    HT_CALLS_AT_INPUTS = 7
};

/** Words of inputs, with every request but HELLO: what the port will answer. */
enum {
    HT_INPUT_ADC = 0,
    HT_INPUT_POSITION = 7, /**< 32 bits */
    HT_INPUT_TRIPPED = 9,  /**< a bit for each leg */
    HT_INPUT_OVERRUN = 10,
    HT_INPUT_PERIOD_TICKS = 11,
    HT_INPUT_AGE_TICKS = 12,
    HT_INPUT_FLAGS = 13, /**< of the capture unit: HT_FLAG_... */
    HT_INPUT_TRIP_PIN_LOW = 14,
    HT_INPUTS = 15
};
enum { HT_FLAG_EVENT = 1, HT_FLAG_OVERFLOW = 2, HT_FLAG_REVERSED = 4, HT_FLAG_FORWARD = 8 };

#endif
