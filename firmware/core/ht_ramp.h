/** @file ht_ramp.h
 *  The way of a speed reference to its new value: at once, at a constant rate, or with a rate that
 *  itself changes at a limited rate (jerk). Speeds in r/min; a period is one call of the step.
 */
#ifndef HT_RAMP_H
#define HT_RAMP_H

#include <stdbool.h>

typedef struct {
    float up_rpm;   /**< the speed's size grows by this in a period at most; 0: at once */
    float down_rpm; /**< and falls by this */
    float
        jerk_rpm; /**< by this the change of a period differs from the one before; 0: by any value */
} ht_ramp_config;

typedef struct {
    float speed_rpm;
    float slope_rpm; /**< change in the latest period */
} ht_ramp_state;

/** Go on from this speed, with a slope of 0. */
void ht_ramp_reset(ht_ramp_state *st, float speed_rpm);

/** One period on the way to `target_rpm`; returns the reference. It arrives without overshoot unless the
 *  target has come nearer than the jerk lets it stop. `held`:
 *  the drive cannot follow now, so the reference goes no further away from `measured_rpm`. A target that
 *  is NaN leaves it where it is. */
float ht_ramp_step(const ht_ramp_config *cfg, ht_ramp_state *st, float target_rpm,
                   float measured_rpm, bool held);

#endif
