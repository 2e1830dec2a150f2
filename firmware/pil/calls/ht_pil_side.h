/** @file ht_pil_side.h
 *  A call target, for processors with little memory and for real boards whose own PWM must stay
 *  still. It has no register model: the functions of port.h answer from the readings that came with
 *  the request, and note every call. The host makes the same calls on its own driver.
 */
#ifndef HT_PIL_SIDE_H
#define HT_PIL_SIDE_H

#include "ht_pil_calls.h"

#define HT_CALLS_WORDS 64u /* of one request; INIT, one of the longest, takes half */

/** Calls of one request. */
typedef struct {
    uint16_t count; /**< words noted */
    uint16_t word[HT_CALLS_WORDS];
} ht_pil_side;

struct ht_port {
    ht_pil_side *notes;
    ht_pil_hardware hardware;
    ht_pil_inputs input;
};

#endif
