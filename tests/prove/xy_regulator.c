#include "ht_contracts.h"
#include "ht_xy_regulator.c"
#include "prove.h"

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
    v = ht_xy_step(&c, &st, any_xy(), any_ab(), limit, hold);
    MUST(HT_IS_XY_WITHIN(v, limit));
    MUST(HT_IS_XY_STATE(st, limit));
}
