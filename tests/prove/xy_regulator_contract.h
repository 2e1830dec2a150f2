/* The x-y regulator as its callers see it: any answer that its contract allows. The contract itself
   is proved in xy_regulator.c. */
#ifndef XY_REGULATOR_CONTRACT_H
#define XY_REGULATOR_CONTRACT_H

#include "prove.h"

ht_xy ht_xy_step(const ht_xy_config *cfg, ht_xy_state *st, ht_xy i_A, ht_ab turn, float limit_pu,
                 bool hold)
{
    ht_xy v = any_xy();
    MUST(HT_IS_XY_LIMIT(limit_pu));
    MUST(HT_IS_XY_STATE(*st, limit_pu));
    GIVEN(HT_IS_XY_WITHIN(v, limit_pu));
    st->with = any_xy();
    st->against = any_xy();
    GIVEN(HT_IS_XY_STATE(*st, limit_pu));
    return v;
}

void ht_xy_reset(ht_xy_state *st)
{
    st->with = any_xy();
    st->against = any_xy();
}

#endif
