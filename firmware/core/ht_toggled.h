/** @file ht_toggled.h
 *  A pattern of one toggle per leg, as the observer knows it.
 */
#ifndef HT_TOGGLED_H
#define HT_TOGGLED_H

#include "ht_pattern.h"

/** All of it but for `mean_pu` and `own`: the legs of `moves` toggle, of
 *  these `rises` upwards; of the others those of `high` are high. */
static HT_INTO_CALLERS void ht_applied_toggles(ht_applied *a, unsigned before, unsigned high,
                                               unsigned moves, unsigned rises)
{
    unsigned start = high | (moves ^ rises);
    unsigned edge0 = before ^ start; /* legs with an edge at the period's very start */
    a->before = (uint16_t)before;
    a->s[0] = (uint16_t)start;
    a->s[1] = (uint16_t)(high | rises);
    a->s[2] = a->s[1];
    a->t[0] = 0.0f;
    a->t[1] = 1.0f;
    a->t[2] = 1.0f;
    a->later = moves;
    a->close = 0u; /* edges are at least the dead time apart */
    a->rising = (edge0 & start) | rises;
    a->falling = (edge0 & before) | (moves ^ rises);
}

#endif
