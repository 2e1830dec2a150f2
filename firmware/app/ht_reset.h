/** @file ht_reset.h
 *  Why the board started, and how often a watchdog has started it (ht_resets.def).
 */
#ifndef HT_RESET_H
#define HT_RESET_H

#include <stdbool.h>
#include <stdint.h>

enum {
#define HT_RESET(name, number, text, help) HT_RESET_##name = (number),
#include "ht_resets.def"
#undef HT_RESET
    HT_RESETS
};

typedef struct {
    const char *name;
    const char *help;
} ht_reset_info;

/** Table entry of a cause, or NULL if there is none. */
const ht_reset_info *ht_reset_describe(uint16_t cause);

/** The latest reset of a board. */
typedef struct {
    uint16_t cause;
    uint16_t
        watchdogs; /**< resets by a watchdog, the NMI's included, since power-on; at most 65535 */
} ht_reset;

/** The count in memory that no start clears. After power-on it holds anything: mark and inverse tell. */
typedef struct {
    uint32_t word;    /**< a mark, and the count in the low half */
    uint32_t inverse; /**< of `word` */
} ht_reset_memory;

/** Take the start after `cause` into the count, and return what is to be told. */
ht_reset ht_reset_count(ht_reset_memory *m, uint16_t cause);

#endif
