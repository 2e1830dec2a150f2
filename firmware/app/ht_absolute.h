/** @file ht_absolute.h
 *  An absolute encoder on the shaft: it tells where the incremental one, which counts, has its zero.
 *
 *  Two readings in a row at standstill that agree with the counts make the zero known. From then on every
 *  reading must agree: a reading that stands still, runs the wrong way or is missing is found as soon as the
 *  shaft has moved further than both encoders' steps and 5 electrical degrees. Single ones are noise, and
 *  tell nothing; after three in a row the zero is unknown.
 */
#ifndef HT_ABSOLUTE_H
#define HT_ABSOLUTE_H

#include <stdbool.h>
#include <stdint.h>

/** Value of the parameter `rotor_start` with which the encoder is read. */
#define HT_ROTOR_START_ABSOLUTE 3.0f

typedef struct {
    bool used;           /**< else nothing is looked at, and nothing else here is set */
    uint32_t counts_rev; /**< of the encoder that counts */
    uint32_t readings;   /**< of the absolute one in a revolution; from here on none is valid */
    float counts_per_reading; /**< negative: it reads less when the other counts up */
    uint32_t near_counts;     /**< largest distance of a reading from the counts at standstill */
} ht_absolute_config;

typedef struct {
    uint32_t reference;  /**< position of reading 0, and whole revolutions */
    uint16_t doubts;     /**< readings in a row that did not agree */
    bool seen;           /**< there was a reading to compare with */
    volatile bool known; /**< `reference` is right; written last */
} ht_absolute_state;

/** Fewest readings in a revolution: one is 5 electrical degrees. */
float ht_absolute_least(float pole_pairs);

/** All but `used`. `readings` is above 0. */
void ht_absolute_configure(ht_absolute_config *cfg, uint32_t counts_rev, float readings,
                           bool reversed, uint16_t pole_pairs);

/** Look at a reading, once in every slow period. The other encoder counts `position`, `moved` of it since
 *  the look before; the reading is from in between. */
void ht_absolute_step(const ht_absolute_config *cfg, ht_absolute_state *st, uint32_t position,
                      int32_t moved, uint32_t reading);

#endif
