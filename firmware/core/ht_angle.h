/** @file ht_angle.h
 *  The direction of an angle, without functions of a library.
 */
#ifndef HT_ANGLE_H
#define HT_ANGLE_H

#include "ht_types.h"

/** Unit vector of an angle in turns, 0..1. Its error is 5e-7 at most. Other numbers, NaN too, give
 *  finite ones. */
ht_ab ht_unit(float turns);

#endif
