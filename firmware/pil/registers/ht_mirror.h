/** @file ht_mirror.h
 *  The registers of a drive as a numbered list, and their changes, which host and register target
 *  exchange (docs/pil.md). The list has the ePWM registers in use of each leg, ADC results, the
 *  ADC's flag and its commands, eQEP, levels of the pins of port A, interrupt acknowledge.
 */
#ifndef HT_MIRROR_H
#define HT_MIRROR_H

#include <stdbool.h>

#include "ht_c2000_map.h"
#include "ht_packet.h"
#include "ht_reader.h"
#include "ht_regfile.h"

/** Registers of a device, at most. */
enum { HT_MIRROR_MAX = 176 };

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

/** Append every change since the last exchange, as runs: number of the first register and number of
 *  registers (a byte each), then their values (16 bits each). A single unchanged register does not
 *  end a run, so all runs together take at most HT_MIRROR_BYTES. */
void ht_mirror_tell(ht_mirror *m, ht_packet *p);
enum { HT_MIRROR_BYTES = 2 + 2 * HT_MIRROR_MAX };

/** Take over what the other side changed: the rest of `r`. False if that cannot be. */
bool ht_mirror_take(ht_mirror *m, ht_reader *r);

/** Sum of registers that both sides should agree on, each turned on by 5 bits: every
 *  HT_MIRROR_TURNS-th, from number `turn` (modulo HT_MIRROR_TURNS) on. Over as many turns it
 *  covers all of them. A frame has its CRC; this notices register files that differ. */
#define HT_MIRROR_TURNS 16u
uint32_t ht_mirror_digest(const ht_mirror *m, uint16_t turn);

/** All values, in order. */
void ht_mirror_read(const ht_mirror *m, uint16_t *out);

#endif
