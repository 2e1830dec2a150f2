/** @file ht_winding.h
 *  The meaning of the tables for a winding. One whose sets are 30 degrees apart takes them as they are.
 */
#ifndef HT_WINDING_H
#define HT_WINDING_H

#include "ht_angle.h"
#include "ht_tables.h"
#include "ht_vsd.h"

/** `v` as the tables and ht_vsd_from_six have it, in the winding's own alpha-beta and x-y. */
static HT_INTO_CALLERS ht_vsd ht_of_winding(ht_winding winding, ht_vsd v)
{
    return (winding == HT_WINDING_30) ? v : ht_vsd_turned(winding, v);
}

/** And back: `v` of the winding as legs must make it that lie as the tables have them. */
static HT_INTO_CALLERS ht_vsd ht_of_legs(ht_winding winding, ht_vsd v)
{
    return (winding == HT_WINDING_30) ? v : ht_vsd_turned_back(winding, v);
}

/** Group of the large vectors. */
static inline unsigned ht_large_of(ht_winding winding)
{
    return (winding == HT_WINDING_30) ? (unsigned)HT_L : ((unsigned)HT_S + (unsigned)winding);
}

/** Unit vector of one of twelve directions of direct current: 15 degrees and 30 more each, from 0 degrees on
 *  where the sets are not 30 degrees apart. */
static inline ht_ab ht_twelfth(ht_winding winding, unsigned direction)
{
    float first = (winding == HT_WINDING_30) ? 1.0f : 0.0f;
    return ht_unit((1.0f / 24.0f) * (first + 2.0f * (float)direction));
}

#endif
