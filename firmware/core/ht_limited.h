/** @file ht_limited.h
 *  A value within limits. NaN gives the lower one: what goes on from here is a number.
 */
#ifndef HT_LIMITED_H
#define HT_LIMITED_H

#include <math.h>

/** `value` from `least` to `most`. */
static inline float ht_between(float value, float least, float most)
{
    return (value > most) ? most : ((value > least) ? value : least);
}

/** `value` from -`limit` to `limit`, by one comparison if it is within. */
static inline float ht_limited(float value, float limit)
{
    if (fabsf(value) <= limit) {
        return value;
    }
    return (value > 0.0f) ? limit : -limit;
}

#endif
