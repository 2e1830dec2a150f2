/** @file ht_flux_step.h
 *  The common part of the deadbeat laws: a step that is too long.
 */
#ifndef HT_FLUX_STEP_H
#define HT_FLUX_STEP_H

#include "ht_limited.h"
#include "ht_voltage_law.h"

/** The least share of the largest step that torque gets, squared. */
#define HT_TORQUE_SHARE2 0.25f

/** A step that the voltage cannot make: the length first, as far as torque's share lets it,
 *  then as much torque as is left. */
static HT_INTO_CALLERS ht_ab ht_flux_step_within(ht_ab e, ht_ab along, float inv_size, float radial,
                                                 float most)
{
    float left = most * most - radial * radial;
    float least = HT_TORQUE_SHARE2 * most * most;
    float tangential = ht_limited(along.alpha * e.beta - along.beta * e.alpha,
                                  sqrtf((left > least) ? left : least));
    /* along the circle, not its tangent */
    float outward = radial - 0.5f * tangential * tangential * inv_size;
    ht_ab step;
    step.alpha = outward * along.alpha - tangential * along.beta;
    step.beta = outward * along.beta + tangential * along.alpha;
    return step;
}

#endif
