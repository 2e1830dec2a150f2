/** @file ht_ramp.h
 *  The way of a speed reference to its new value: at once, at a constant rate, or with a rate that
 *  itself changes at a limited rate (jerk). Speeds in r/min; a period is one call of the step.
 */
#ifndef HT_RAMP_H
#define HT_RAMP_H

#include <stdbool.h>

typedef struct {
    float up_rpm;   /**< the size of the speed grows by this in a period at most; 0: at once */
    float down_rpm; /**< it falls by this at most; 0: at once */
    float jerk_rpm; /**< two successive changes differ by this at most; 0: no limit */
} ht_ramp_config;

typedef struct {
    float speed_rpm;
    float slope_rpm; /**< change in the latest period */
} ht_ramp_state;

/** Go on from this speed, with a slope of 0. */
void ht_ramp_reset(ht_ramp_state *st, float speed_rpm);

/** One period on the way to `target_rpm`; returns the reference. It arrives without overshoot unless
 *  the target comes nearer than the jerk lets it stop. While the drive cannot follow (`held`), the
 *  reference goes no further away from `measured_rpm`. A target that is NaN or infinite leaves it
 *  where it is. */
float ht_ramp_step(const ht_ramp_config *cfg, ht_ramp_state *st, float target_rpm,
                   float measured_rpm, bool held);

#endif
