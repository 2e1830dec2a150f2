#include "ht_rotor_catch.h"

#include "ht_rotor_rules.h"
#include "ht_turned.h"

#include <math.h>

/* Of `most_A`: a current that is judged at once, and one that is judged at all. */
#define ENOUGH 0.05f
#define LEAST 0.02f
/* Periods after which it is judged whatever it is. */
#define MOST_PERIODS 100.0f
/* The direction may be 30 degrees off. The size tells little: the gates go on within a period. */
#define COSINE 0.866f
#define LEAST_SIZE 0.3f

float ht_rotor_catch_least_rad_s(const ht_observer_config *machine, float most_A)
{
    return 2.0f * LEAST * most_A * machine->rs_ohm
           * HT_ROTOR_DOES(machine->rotor, inv_own, (machine));
}

void ht_rotor_catch_begin(ht_rotor_catch_state *st)
{
    st->expected_A.d = 0.0f;
    st->expected_A.q = 0.0f;
    st->periods = 0.0f;
}

ht_rotor_catch ht_rotor_catch_step(const ht_observer_config *machine, ht_rotor_catch_state *st,
                                   float omega_rad_s, ht_ab axis, ht_ab i_A, float most_A)
{
    ht_dq e;
    float along = ht_along(axis, i_A);
    float across = axis.alpha * i_A.beta - axis.beta * i_A.alpha;
    float expected;
    float size;
    e = HT_ROTOR_DOES(machine->rotor, shorted_A, (machine, omega_rad_s, st->expected_A));
    st->expected_A = e;
    st->periods += 1.0f;
    expected = sqrtf(e.d * e.d + e.q * e.q);
    size = sqrtf(along * along + across * across);
    if ((expected < ENOUGH * most_A) && (st->periods < MOST_PERIODS)) {
        return HT_CATCHING;
    }
    if ((expected >= LEAST * most_A) && (size >= LEAST_SIZE * expected)
        && ((along * e.d + across * e.q) >= COSINE * size * expected)) {
        return HT_CAUGHT;
    }
    return HT_NOT_CAUGHT;
}
