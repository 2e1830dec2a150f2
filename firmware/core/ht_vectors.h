/** @file ht_vectors.h
 *  State words of one period: three of them, for the intervals that the action points divide
 *  the period into (ht_pattern.h).
 */
#ifndef HT_VECTORS_H
#define HT_VECTORS_H

#include "ht_tables.h"

/** The same vector for the whole period. */
void ht_vectors_single(uint16_t word, uint16_t s[3]);

/** Virtual vector k = 0..11 of a group: vectors k - 1, k and k + 1 (paper A, Table II). */
void ht_vectors_virtual(unsigned group, unsigned k, uint16_t s[3]);

/** Nothing of it in x-y, for a winding whose sets are 0 or 60 degrees apart: the large vector at 30 k
 *  degrees, or those on both sides of it, half of the period each (t1 = 1/2). */
void ht_vectors_alike(unsigned group, unsigned k, uint16_t s[3]);

/** A zero vector: V0 (all legs low) if `only_v0`, else the one that is reached with the fewest
 *  leg transitions from the state word `before`. */
void ht_vectors_zero(uint16_t before, bool only_v0, uint16_t s[3]);

#endif
