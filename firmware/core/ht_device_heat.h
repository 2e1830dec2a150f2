/** @file ht_device_heat.h
 *  The temperatures of the power stage's legs, as their currents tell them: one body on each leg, from the
 *  devices to the heat sink. A standing machine or a lost leg heats one leg with the amplitude of its
 *  current, a turning one all of them with the root of the mean square: so the hottest one counts.
 *
 *    tau d rise/dt = R P - rise,   P = v i + r i^2 + e f v_dc i
 *
 *  The current is the root of its mean square: a bit more than the mean that a threshold and the switching
 *  see, 11 % where it is a sine.
 */
#ifndef HT_DEVICE_HEAT_H
#define HT_DEVICE_HEAT_H

#include <stdbool.h>

#include "ht_types.h"

typedef struct {
    float K_W;     /**< from a leg's devices to the heat sink; 0: no model */
    float gain;    /**< share of the way in a slow interrupt */
    float drop_V;  /**< threshold voltage */
    float ohm;     /**< resistance beyond it */
    float share_V; /**< switching: energy for an ampere and a volt, times the sampling frequency */
    float limit_degC;
    float trip_degC;
} ht_device_heat_config;

typedef struct {
    float rise_K[HT_LEGS]; /**< above the heat sink */
} ht_device_heat_state;

/** As cold as the heat sink. */
void ht_device_heat_reset(ht_device_heat_state *st);

/** Slow interrupt. `square_A2`: low pass of each squared current, which counts while `powered`. */
void ht_device_heat_step(const ht_device_heat_config *cfg, ht_device_heat_state *st,
                         const float *square_A2, bool powered, float vdc_V);

/** Temperature of the hottest leg; the heat sink's without a model. */
float ht_device_heat_degC(const ht_device_heat_state *st, float sink_degC);

#endif
