/* The deadbeat law, its x-y regulator by what it promises. */
#include "ht_contracts.h"
#include "ht_deadbeat_law.c"
#include "law_input.h"
#include "xy_regulator_contract.h"

void prove_deadbeat_law(void)
{
    ht_deadbeat_law_config cfg;
    ht_observer_config machine = any_law_machine();
    ht_deadbeat_law_state st;
    ht_voltage_law_input in = any_law_input();
    cfg.gain = nondet_float();
    cfg.xy_ki_per_A = nondet_float();
    cfg.xy_free_A2 = nondet_float();
    cfg.reach_pu = nondet_float();
    GIVEN(ht_deadbeat_law_check(&cfg));
    st.xy.with = any_xy();
    st.xy.against = any_xy();
    GIVEN(HT_IS_XY_STATE(st.xy, HT_LAW_XY_LIMIT_PU));
    (void)ht_deadbeat_law_step(&cfg, &machine, &st, &in);
    MUST(HT_IS_XY_STATE(st.xy, HT_LAW_XY_LIMIT_PU));
}

void prove_deadbeat_check(void)
{
    ht_deadbeat_law_config cfg;
    cfg.gain = nondet_float();
    cfg.xy_ki_per_A = nondet_float();
    cfg.xy_free_A2 = nondet_float();
    cfg.reach_pu = nondet_float();
    GIVEN(ht_deadbeat_law_check(&cfg));
    MUST((cfg.gain > 0.0f) && (cfg.gain <= 1.0f));
    MUST((cfg.xy_ki_per_A >= 0.0f) && is_finite(cfg.xy_ki_per_A));
    MUST(cfg.xy_free_A2 > 0.0f);
    MUST((cfg.reach_pu >= 0.5f) && (cfg.reach_pu <= 1.0f));
}
