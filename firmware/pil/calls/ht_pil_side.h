/** @file ht_pil_side.h
 *  A target without registers, for processors with little memory and for real boards,
 *  whose own PWM is to stay still: `port.h` answered from what the host sent along, and
 *  every call noted. The host makes the same calls on its driver.
 */
#ifndef HT_PIL_SIDE_H
#define HT_PIL_SIDE_H

#include "ht_frame.h"
#include "ht_pil_codes.h"
#include "port.h"

#define HT_CALLS_WORDS 64u /* of one request; the longest, INIT among others, takes half */

/** Calls of one request. */
typedef struct {
    uint16_t count; /**< words noted */
    uint16_t word[HT_CALLS_WORDS];
} ht_pil_side;

struct ht_port {
    ht_pil_side *notes;
    float pwm_clock_Hz;
    float capture_clock_Hz;
    float dead_min_us;
    uint16_t dead_max_counts;
    uint16_t tripped; /**< a bit for each leg */
    uint16_t input[HT_INPUTS];
};

#endif
