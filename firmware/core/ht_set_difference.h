/** @file ht_set_difference.h
 *  Learns the difference of the two sets' resistances, while no leg is lost. Without a leg it
 *  matters (ht_lost_legs): each set then has an axis of its own.
 *
 *  Set 2 drops delta more than the mean of both, and set 1 delta less. In x-y this is a voltage that
 *  the machine needs and the law did not mean to give: the residual of ht_leg_loss is
 *  delta (i_alpha, -i_beta). Its part along this vector, over the current, is delta. What wrong
 *  reactances make lies across the vector, and harmonics of the current have no mean along it.
 */
#ifndef HT_SET_DIFFERENCE_H
#define HT_SET_DIFFERENCE_H

#include "ht_types.h"

typedef struct {
    float gain; /**< of the means, per call */
    /** Gain of the result, per call. */
    float slow_gain;
    float least_A2; /**< the current from which on the residual tells anything, squared */
} ht_set_difference_config;

typedef struct {
    float power_W; /**< mean of the residual times the current */
    float i2_A2;   /**< mean of the current, squared */
    float ohm;     /**< the result: R_s of set 2 less the mean of both sets */
} ht_set_difference;

/** The result stays, the means begin again: the start of a run. */
void ht_set_difference_begin(ht_set_difference *st);

/** One call of the slow interrupt. `low_V`: the residual behind the low pass of ht_leg_loss;
 *  `omega_rad_s`: of the flux, for the delay of this low pass; `most_ohm`: limit of the result. */
void ht_set_difference_learn(const ht_set_difference_config *cfg, ht_set_difference *st, ht_ab i_A,
                             ht_xy low_V, float omega_rad_s, float most_ohm);

#endif
