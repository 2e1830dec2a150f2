/** @file ht_derating.h
 *  What a drive can still do without some of its legs, if no phase is to carry more than its rated
 *  current.
 */
#ifndef HT_DERATING_H
#define HT_DERATING_H

#include "ht_lost_legs.h"
#include "ht_params.h"

typedef struct {
    float rated_A;     /**< amplitude of the rated phase current */
    float ls_H;        /**< stator inductance */
    float lean;        /**< 1/(2 c), c the centre of the circle diagram, units of psi/L_s */
    float best_Wb_A;   /**< flux with the most torque, per ampere in alpha-beta */
    float torque_gain; /**< 3 P */
} ht_derating_config;

void ht_derating_configure(const ht_params *p, ht_derating_config *c);

/** Current in alpha-beta, amplitude, with which the most loaded phase carries its rated current. */
float ht_derated_A(const ht_derating_config *c, const ht_lost_legs *lost);

/** Stator flux that makes the most torque of the current `i_A`. More flux leaves too little of the
 *  current for torque. */
float ht_derated_Wb(const ht_derating_config *c, float i_A);

/** Torque at this flux and current: what the circle diagram (ht_protect_slow) has. */
float ht_derated_Nm(const ht_derating_config *c, float i_A, float flux_Wb);

#endif
