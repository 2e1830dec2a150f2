/** @file ht_store.h
 *  Parameters that survive power-off: one set, kept twice.
 *
 *  A copy fills the first blocks of an area (ht_store_port.h):
 *
 *      block 0     magic, layout, number of values, version of the table, sequence number
 *      1 ...       the values, four a block, IEEE 754 singles, low word first
 *      last        the valid mark: CRC-32 of all before, its complement, four fixed words
 *
 *  A save writes the copy that is not the latest one first: erase, values, read them back, and
 *  only then the mark. Then it writes the other copy in the same way. So at any instant one copy
 *  is whole, the former set or the new one. Afterwards both are the new one: if one of them gets
 *  damaged later, the other still has the right values, and no older set comes back. Of two whole
 *  copies the one with the later sequence number counts (modulo 2^32): they differ only where
 *  power failed between the two. To forget erases them in the same order.
 *
 *  The version of the table is a CRC-32 over what gives the values their meaning: names, units
 *  and choices of all parameters, in order. Ranges, defaults and help are not in it: a new build
 *  that only widens a range keeps its set. A set with a value out of today's range, or one that
 *  the board refuses (its shortest dead time), is refused as a whole.
 *
 *  Some parameters are commands, not settings (ht_store_is_command). A start takes
 *  their built-in values, so that no drive starts to turn because of a command from before the
 *  power-off.
 */
#ifndef HT_STORE_H
#define HT_STORE_H

#include "ht_drive.h"
#include "ht_store_port.h"

/** Which set was taken at the start (ht_sets.def). */
enum {
#define HT_SET(name, number, text) HT_SET_##name = (number),
#include "ht_sets.def"
#undef HT_SET
};

typedef struct {
    ht_store_port port; /**< `read` = NULL: this image keeps no parameters */
    uint16_t set;       /**< HT_SET_..., as it was taken at the start; saving does not change it */
} ht_store;

/** True for a parameter that is a command: what the drive follows, and how it starts. */
bool ht_store_is_command(uint16_t id);

/** Make `s` a store without a memory: nothing is kept. */
void ht_store_none(ht_store *s);

/** `ht_drive_init` with the saved set if there is one that can be used, else with `defaults`;
 *  `s->set` tells which. */
ht_result ht_store_start(ht_store *s, ht_drive *d, ht_port *port, const ht_params *defaults);

/** Read what is stored into `p`. Returns HT_SET_SAVED if it is whole and of this table; with any
 *  other answer the contents of `p` mean nothing. */
uint16_t ht_store_load(const ht_store *s, ht_params *p);

/** Keep the parameters in force. HT_ERROR_STATE unless idle or in fault, HT_ERROR_STORE: there is
 *  no store, or writing failed (the former set or the new one is whole then). Blocks, see
 *  ht_store_port.h. */
ht_result ht_store_save(const ht_store *s, const ht_drive *d);
/** Erase what is kept; the parameters in force stay. Refused as a save is. */
ht_result ht_store_forget(const ht_store *s, const ht_drive *d);

#endif
