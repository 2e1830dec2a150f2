/** @file ht_duty.h
 *  Duty ratios of a virtual vector for given x-y voltage commands: paper A,
 *  eqs. (9), (13), (16).
 */
#ifndef HT_DUTY_H
#define HT_DUTY_H

#include "ht_tables.h"

/** Action points in per unit of the period, eq. (16): the first vector until T1,
 *  the second until T2, the third for the rest. 0 <= T1 <= T2 <= 1 always. */
typedef struct {
    float t1;
    float t2;
} ht_action_points;

/** Solve for virtual vector `k` (0..11) of `group` (HT_L or HT_ML); `v_pu` is the
 *  commanded x-y voltage in units of Vdc. Inside the TMVCL box of the group all
 *  three duties are >= 0 for every k; outside they are clamped, NaN gives 0. */
ht_action_points ht_duty(unsigned group, unsigned k, ht_xy v_pu);

#endif
