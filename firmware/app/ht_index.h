/** @file ht_index.h
 *  An encoder's index pulse: it tells the angle of an incremental encoder, and whether its counts are right.
 *
 *  The first index since the reset tells the angle. From then on each index must come a whole number of
 *  revolutions after it, and within a revolution there must be one. Counts that slip, counts of noise and an
 *  index that is lost all break this, and which of them did cannot be told. So the angle is then unknown
 *  until two indices in a row agree.
 */
#ifndef HT_INDEX_H
#define HT_INDEX_H

#include "ht_speed_measure.h"

typedef struct {
    bool used;            /**< false: nothing is looked at */
    uint32_t counts_rev;  /**< of the encoder */
    uint32_t near_counts; /**< largest distance of an index from where the first one was */
} ht_index_config;

typedef struct {
    uint32_t newest;     /**< position of the latest index */
    uint32_t reference;  /**< position of the first one, and whole revolutions */
    bool seen;           /**< there was one */
    volatile bool known; /**< `reference` is right; written last */
} ht_index_state;

/** How much an index may be off: its width, a line, seen from either side, and 5 electrical degrees, which
 *  cost 0.4 % of the torque. */
uint32_t ht_index_near_counts(uint32_t counts_rev, uint16_t pole_pairs);

/** How far `moved` is from a whole number of revolutions. */
int32_t ht_index_off_counts(uint32_t counts_rev, uint32_t moved);

/** Look at what the capture unit shows, once in every slow period. The encoder counted `position` before
 *  that, less than an eighth of a revolution ago. */
void ht_index_step(const ht_index_config *cfg, ht_index_state *st, uint32_t position,
                   const ht_capture *capture);

#endif
