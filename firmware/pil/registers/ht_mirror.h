/** @file ht_mirror.h
 *  The registers of a drive as a numbered list, and what changed in them: what host
 *  and target tell each other about the register file (docs/pil.md). All the ePWM
 *  registers in use, ADC results, flag and its commands, eQEP, levels of the pins of port A,
 *  interrupt acknowledge.
 */
#ifndef HT_MIRROR_H
#define HT_MIRROR_H

#include <stdbool.h>

#include "ht_c2000_map.h"
#include "ht_regfile.h"

/** Registers of a device, at most. */
enum { HT_MIRROR_MAX = 200 };

typedef struct {
    uint16_t count;
    uint16_t *cell[HT_MIRROR_MAX];  /**< into the register file */
    uint16_t agreed[HT_MIRROR_MAX]; /**< what the other side knows */
} ht_mirror;

/** List the registers of a freshly started `registers`: that is what both sides know. */
void ht_mirror_init(ht_mirror *m, ht_regfile *registers, const ht_c2000_map *map);

/** The list of a device: word addresses into `out`, HT_MIRROR_MAX at most. Returns their
 *  number. */
uint16_t ht_mirror_addresses(const ht_c2000_map *map, uint32_t *out);

/** Write (index, value) of every change since the last exchange to `pairs`. Returns
 *  the number of words, at most 2 HT_MIRROR_MAX. */
uint16_t ht_mirror_changes(ht_mirror *m, uint16_t *pairs);

/** Take over what the other side changed. False if that cannot be. */
bool ht_mirror_apply(ht_mirror *m, const uint16_t *pairs, uint16_t words);

/** Checksum of registers that both sides should agree on: of every HT_MIRROR_TURNS-th in
 *  turn. Over as many turns it covers all of them. */
#define HT_MIRROR_TURNS 16u
uint32_t ht_mirror_digest(const ht_mirror *m, uint16_t turn);

/** All values, in order. */
void ht_mirror_read(const ht_mirror *m, uint16_t *out);

#endif
