/* The field-oriented law, its x-y regulator by what it promises. */
#include "ht_contracts.h"
#include "ht_foc_law.c"
#include "law_input.h"
#include "xy_regulator_contract.h"

float sqrtf(float x)
{
    return nondet_float();
}

void prove_foc_law(void)
{
    ht_foc_law_config cfg;
    ht_observer_config machine = any_law_machine();
    ht_foc_law_state st;
    ht_voltage_law_input in = any_law_input();
    ht_vsd v;
    cfg.alpha_ts = nondet_float();
    cfg.xy_ki_per_A = nondet_float();
    GIVEN(ht_foc_law_check(&cfg));
    st.xy.with = any_xy();
    st.xy.against = any_xy();
    st.along = any_ab();
    st.integral_A = any_ab();
    st.wanted_A = any_ab();
    st.begun = nondet_bool();
    GIVEN(HT_IS_XY_STATE(st.xy, HT_LAW_XY_LIMIT_PU));
    v = ht_foc_law_step(&cfg, &machine, &st, &in);
    MUST(st.begun);
    MUST(HT_IS_XY_STATE(st.xy, HT_LAW_XY_LIMIT_PU));
    /* NaN is not hidden: the modulator takes it for a leg that stays low. */
    MUST(IMPLIES(is_nan(in.psi_Wb.alpha), is_nan(v.ab.alpha) || is_nan(v.ab.beta)));
    MUST(IMPLIES(is_nan(in.psi_xy_Wb.x), is_nan(v.xy.x)));
}

void prove_foc_check(void)
{
    ht_foc_law_config cfg;
    cfg.alpha_ts = nondet_float();
    cfg.xy_ki_per_A = nondet_float();
    GIVEN(ht_foc_law_check(&cfg));
    MUST((cfg.alpha_ts > 0.0f) && (cfg.alpha_ts <= 0.5f));
    MUST((cfg.xy_ki_per_A >= 0.0f) && is_finite(cfg.xy_ki_per_A));
}
