/** @file ht_log_ring.h
 *  Records in two areas of a memory (ht_store_port.h): the latest events, and the latest of some values.
 *
 *  One area is in use. It is filled slot by slot. A slot is written once, block by block, its CRC last.
 *  When the area is nearly full, what is kept goes into the other one:
 *
 *      slot 0      mark of a whole area: layout, generation. Written last
 *      1 ...       the latest HT_LOG_EVENTS events, the latest of each value
 *      then        events and values, as they come
 *
 *  So there is one whole area at any instant, and power that fails costs the slot that is being written, never an
 *  older one: the former area is erased only when the next change begins. Of two whole areas the one with the
 *  later generation counts (modulo 2^32). A slot that is torn or damaged is passed over, and counted.
 *
 *  Word 0 of a slot has its kind in the low octet: below HT_LOG_VALUE_FIRST an event, from there on a value, or the
 *  mark. The last two words are a CRC-32 of all before, the low word first.
 */
#ifndef HT_LOG_RING_H
#define HT_LOG_RING_H

#include "ht_store_port.h"

#define HT_LOG_BLOCKS 4u                              /**< of a slot */
#define HT_LOG_WORDS (HT_LOG_BLOCKS * HT_STORE_WORDS) /**< of a slot */
#define HT_LOG_PAYLOAD (HT_LOG_WORDS - 2u)            /**< words of a slot before its CRC */
#define HT_LOG_EVENTS 64u                             /**< that are kept at least */
#define HT_LOG_SLOTS (2u * HT_LOG_EVENTS)             /**< that an area must have */
#define HT_LOG_VALUE_FIRST 0xF0u
#define HT_LOG_VALUES 2u

/** The result of a turn. */
typedef enum {
    HT_LOG_NO_MEMORY = 0, /**< there is none, or it does not work */
    HT_LOG_BUSY = 1,      /**< more turns are needed */
    HT_LOG_FOUND = 2,     /**< the memory is being read: `slot` is one of its records */
    HT_LOG_FREE = 3       /**< a record may be put; `kept` tells of the one before */
} ht_log_turned;

typedef struct {
    ht_store_port port; /**< `read` = NULL: there is no memory */
    uint16_t phase;
    uint16_t slots;  /**< of an area */
    uint16_t area;   /**< in use */
    uint16_t next;   /**< slot to be written */
    uint16_t at;     /**< slot that is looked at, or record that is copied */
    uint16_t block;  /**< of `slot` that is written next */
    uint16_t failed; /**< changes of the area in a row that failed */
    uint32_t generation;
    uint16_t index[HT_LOG_EVENTS]; /**< slots of events, the oldest first */
    uint16_t events;               /**< in `index` */
    uint16_t value[HT_LOG_VALUES]; /**< slot of the latest of each; 0: none */
    uint16_t damaged;              /**< slots that were found damaged, or could not be written */
    bool writing;
    bool kept; /**< the record that was put is in the memory */
    uint16_t slot[HT_LOG_WORDS];
} ht_log_ring;

/** Without a memory. */
void ht_log_ring_none(ht_log_ring *r);
/** Begin to read the memory. */
void ht_log_ring_start(ht_log_ring *r);

/** One read of a slot, one block written, or one erase. `may_write`: a block may be written now; `may_erase`:
 *  and an area may be erased, too, which takes long. */
ht_log_turned ht_log_ring_turn(ht_log_ring *r, bool may_write, bool may_erase);

/** After HT_LOG_FREE: write this record, HT_LOG_PAYLOAD words, in the turns that follow. */
void ht_log_ring_put(ht_log_ring *r, const uint16_t *words);

/** Is everything read, and nothing being copied? */
bool ht_log_ring_settled(const ht_log_ring *r);

/** Is there a memory that works? */
bool ht_log_ring_works(const ht_log_ring *r);

/** Forget all events but the latest `but`. The memory still has them. */
void ht_log_ring_empty(ht_log_ring *r, uint16_t but);

/** Event `row`, 0 is the oldest. False: it cannot be read. */
bool ht_log_ring_read(const ht_log_ring *r, uint16_t row, uint16_t *words);

#endif
