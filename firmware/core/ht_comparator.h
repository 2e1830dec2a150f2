/** @file ht_comparator.h
 *  Hysteresis comparators. Each takes its previous output, returns the new one
 *  and keeps no state of its own. A NaN error leaves the output as it was.
 */
#ifndef HT_COMPARATOR_H
#define HT_COMPARATOR_H

#include <stdint.h>

/** Two levels, for the flux and, as an option, the torque: switches to `high`
 *  above +band, to `low` below -band. */
int16_t ht_compare_two_level(int16_t last, float error, float band, int16_t low, int16_t high);

/** Three-level torque comparator (a `last` of +-2 from five levels counts as +-1, under an error of
 *  NaN too):
 *  0 -> +-1 at +-band, back to 0 where the error falls to `release`
 *  (-band < release < band; negative: beyond the reference; the papers leave it open,
 *  0 here by default). */
int16_t ht_compare_three_level(int16_t last, float error, float band, float release);

/** Five-level torque comparator of paper B, Fig. 8: 0 -> 1 at `inner` (H_A),
 *  1 -> 2 at `outer` (H_B), 2 -> 1 at `inner`, 1 -> 0 at 0, mirrored below. */
int16_t ht_compare_five_level(int16_t last, float error, float inner, float outer);

#endif
