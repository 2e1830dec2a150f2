/** @file ht_turned.h
 *  Vectors that turn, and parts of vectors.
 */
#ifndef HT_TURNED_H
#define HT_TURNED_H

#include "ht_types.h"

/** `p` turned by `turn_rad`: exp(j turn) to third order, whose gain 1 - turn^4/24 stays below one.
 *  Those of first and second order would blow up by turn^2/2 and turn^4/8 a step, which at high
 *  speed is not small against the decay of what turns. */
static inline ht_ab ht_turned(ht_ab p, float turn_rad)
{
    float cosine = 1.0f - 0.5f * turn_rad * turn_rad;
    float sine = turn_rad * (1.0f - turn_rad * turn_rad * (1.0f / 6.0f));
    ht_ab q;
    q.alpha = cosine * p.alpha - sine * p.beta;
    q.beta = cosine * p.beta + sine * p.alpha;
    return q;
}

/** Sine of the angle that a flux turns in a period, and its cosine less 1. `far`: the sine with its
 *  third order. */
typedef struct {
    float sine;
    float back;
} ht_turn;

static inline ht_turn ht_turn_of(float turn_rad, bool far)
{
    ht_turn turn;
    turn.sine = turn_rad;
    turn.back = -0.5f * turn_rad * turn_rad;
    if (far) {
        turn.sine *= 1.0f + (1.0f / 3.0f) * turn.back;
    }
    return turn;
}

/** p q as complex numbers. */
static inline ht_ab ht_product(ht_ab p, ht_ab q)
{
    ht_ab r;
    r.alpha = p.alpha * q.alpha - p.beta * q.beta;
    r.beta = p.alpha * q.beta + p.beta * q.alpha;
    return r;
}

/** Part of `p` along the unit vector `u`. */
static inline float ht_along(ht_ab u, ht_ab p)
{
    return u.alpha * p.alpha + u.beta * p.beta;
}

/** p x q: part of `q` across the unit vector `p`. */
static inline float ht_across(ht_ab p, ht_ab q)
{
    return p.alpha * q.beta - p.beta * q.alpha;
}

#endif
