/** @file ht_xy_regulator.h
 *  Dual PI regulation of the x-y currents to zero (paper A, Fig. 4): one PI in
 *  the frame that turns with the stator flux, one in the counter-rotating frame,
 *  outputs added.
 */
#ifndef HT_XY_REGULATOR_H
#define HT_XY_REGULATOR_H

#include "ht_types.h"

typedef struct {
    float kp_pu_A;    /**< proportional gain of each PI, units of Vdc per ampere */
    float ki_ts_pu_A; /**< integral gain times the sampling period */
} ht_xy_config;

/** Integrators, each in its own rotating frame, in units of Vdc. */
typedef struct {
    ht_xy with;    /**< synchronous frame */
    ht_xy against; /**< counter-synchronous frame */
} ht_xy_state;

void ht_xy_reset(ht_xy_state *st);

/** Voltage command in units of Vdc, each axis within +-limit_pu (TMVCL). `turn` = (cos, sin) of the
 *  flux angle, taken from the flux vector itself. `hold` freezes the integrators: for periods with
 *  a zero vector, in which no x-y voltage can be injected. Anti-windup: an axis at its limit
 *  integrates only errors that lead away from it, and no integrator exceeds the limit. */
ht_xy ht_xy_step(const ht_xy_config *cfg, ht_xy_state *st, ht_xy i_A, ht_ab turn, float limit_pu,
                 bool hold);

#endif
