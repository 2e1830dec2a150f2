/** @file ht_tables.h
 *  Constant tables of the six-phase two-level inverter, generated from the winding geometry by
 *  firmware/tools/generate_tables.py. Voltages are normalised by Vdc.
 *
 *  Vectors are those of sets that are 30 degrees apart, where directions k = 0..11 point at
 *  15 + 30 k degrees in alpha-beta (paper A, Fig. 1 and Table I; paper B, Fig. 2). For other
 *  windings ht_of_winding turns set 2. The large vectors of these are the six with
 *  which both sets make the same voltage; nothing of it is in x-y.
 */
#ifndef HT_TABLES_H
#define HT_TABLES_H

#include "ht_types.h"

#define HT_DIRECTIONS 12u
#define HT_GROUPS 5

/** Vector groups; HT_L and HT_ML also index ht_duty_table and ht_tmvcl_pu. HT_L0 and HT_L60: the
 *  large vectors of sets that are 0 or 60 degrees apart. These lie at 60 n degrees, for k = 2 n and
 *  k = 2 n + 1. */
enum { HT_L = 0, HT_ML = 1, HT_S = 2, HT_L0 = 3, HT_L60 = 4 };

/** One virtual vector's duty solver, eq. (13) of paper A expanded:
 *  t1 = t1_0 + t1_x vx + t1_y vy, t2 likewise, t3 = 1 - t1 - t2 (eq. 9). */
typedef struct {
    float t1_0;
    float t1_x;
    float t1_y;
    float t2_0;
    float t2_x;
    float t2_y;
} ht_duty_row;

/** Column of the transform by winding and leg: contribution of 1 pu on that leg. */
extern const ht_vsd ht_transform[HT_WINDINGS][HT_LEGS];
/** All 64 voltage vectors by state word. */
extern const ht_vsd ht_vector[64];
/** State word by group and direction. */
extern const uint16_t ht_group[HT_GROUPS][HT_DIRECTIONS];
/** Zero state reached with the fewest leg transitions, by state word. */
extern const uint16_t ht_nearest_zero[64];
/** First leg, in phase order, of a set of legs given as a state word; 6 for none. */
extern const uint16_t ht_first_leg[64];
/** Duty solver rows of the virtual vectors (k-1, k, k+1), groups L and ML. */
extern const ht_duty_row ht_duty_table[2][HT_DIRECTIONS];
/** Total maximum voltage compensation limit per axis, groups L and ML
 *  (paper A, eqs. 19, 20 and 26), in units of Vdc. */
extern const float ht_tmvcl_pu[2];
/** Cosine and sine of what set 2 lies ahead of 30 degrees by. */
extern const ht_ab ht_set2_turn[HT_WINDINGS];

#endif
