/** @file ht_line.h
 *  A serial line as the link sees it: two functions that never wait. A cell of 16 bits holds one
 *  octet (ht_octets.h).
 */
#ifndef HT_LINE_H
#define HT_LINE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    /** Take up to `n` octets that have arrived; returns how many. `lost`: some were lost. */
    uint16_t (*read)(void *at, uint16_t *octets, uint16_t n, bool *lost);
    /** Hand over up to `n` octets; returns how many were taken. */
    uint16_t (*write)(void *at, const uint16_t *octets, uint16_t n);
    void *at;              /**< the calls' first argument */
    uint32_t octets_per_s; /**< what the line carries in each direction */
} ht_line;

#endif
