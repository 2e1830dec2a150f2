/** @file ht_heat.h
 *  The temperatures of the machine, as its currents tell them: two bodies, the winding and the frame.
 *  The winding has six parts, one on each leg, because a standing rotor or a lost leg heats them
 *  unequally.
 *
 *    (C/6) d theta_k/dt = R_s(theta_k) i_k^2 - (theta_k - theta_f)/(6 R)
 *    C_f d theta_f/dt = sum of (theta_k - theta_f)/(6 R) + P_f - (theta_f - ambient)/R_f
 *    R_s(theta) = R_s (1 + alpha (theta - theta_s))
 *
 *  P_f: losses of rotor and iron. The state holds rises above the ambient, so that zeros are a cold
 *  machine. Steps are as long as the time constants allow: the many small ones of each slow interrupt
 *  would be lost in a float.
 */
#ifndef HT_HEAT_H
#define HT_HEAT_H

#include <stdbool.h>

#include "ht_types.h"

/** Change of a copper winding's resistance per kelvin, relative to that at 20 degC. */
#define HT_COPPER_PPM_K 3930
#define HT_COPPER_PER_K (1.0e-6f * (float)HT_COPPER_PPM_K)

typedef struct {
    float look_gain;      /**< low pass of a squared current, per look at it */
    float steps;          /**< slow interrupts for a step; 0: heat is not watched */
    float per_W_K;        /**< what a watt in a part heats it by in a step */
    float to_frame;       /**< share of its rise above the frame that a part loses in a step */
    float frame_per_W_K;  /**< what a watt heats the frame by in a step */
    float frame_per_rise; /**< what the parts' rises above it heat it by, each */
    float to_ambient;     /**< share of its rise that the frame loses in a step */
    float ohm;            /**< R_s at the ambient temperature */
    float ohm_per_K;
    float ambient_degC;
    float limit_degC; /**< from here on the torque is limited */
    float trip_degC;  /**< and from here on there is none */
} ht_heat_config;

typedef struct {
    float square_A2[HT_LEGS]; /**< the fast interrupt's: low pass of each squared current */
    float sum_A2[HT_LEGS];    /**< since the latest step */
    float frame_sum_W;
    float summed; /**< slow interrupts since then */
    float rise_K[HT_LEGS];
    float frame_rise_K;
} ht_heat_state;

/** A cold machine. */
void ht_heat_reset(ht_heat_state *st);

/** Slow interrupt. powered: currents may flow; frame_W: losses of rotor and iron. */
void ht_heat_step(const ht_heat_config *cfg, ht_heat_state *st, bool powered, float frame_W);

/** Temperature of the hottest part of the winding. */
float ht_heat_winding_degC(const ht_heat_config *cfg, const ht_heat_state *st);

/** Share of the torque that a winding of this temperature leaves: 1 up to the limit, 0 at the trip. */
float ht_heat_share(const ht_heat_config *cfg, float winding_degC);

#endif
