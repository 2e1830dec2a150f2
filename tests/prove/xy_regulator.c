#include "ht_contracts.h"
#include "ht_xy_regulator.c"
#include "prove.h"

/* The next larger float. */
static float next(float value)
{
    union {
        float value;
        uint32_t bits;
    } both;
    both.value = value;
    both.bits++;
    return both.value;
}

/* The squares of a limit and of the next float differ: so the sum of squares tells whether one of
 * the integrators is beyond the limit. */
static void tell_squares_of(float limit)
{
    ht_below = limit;
    ht_below_square = limit * limit;
    ht_above = next(limit);
    ht_above_square = ht_above * ht_above;
    MUST(ht_above_square > ht_below_square);
}

void prove_xy_regulator(void)
{
    ht_xy_config c;
    ht_xy_state st;
    ht_xy v;
    float limit = nondet_float();
    bool hold = nondet_bool();
    c.kp_pu_A = nondet_float();
    c.ki_ts_pu_A = nondet_float();
    st.with = any_xy();
    st.against = any_xy();
    GIVEN(HT_IS_XY_LIMIT(limit));
    GIVEN(HT_IS_XY_STATE(st, limit));
    if (limit == 0.1f) {
        tell_squares_of(0.1f);
    } else if (limit == 0.0326920705f) {
        tell_squares_of(0.0326920705f);
    } else {
        tell_squares_of(0.0893163975f);
    }
    v = ht_xy_step(&c, &st, any_xy(), any_ab(), limit, hold);
    MUST(HT_IS_XY_WITHIN(v, limit));
    MUST(HT_IS_XY_STATE(st, limit));
}
