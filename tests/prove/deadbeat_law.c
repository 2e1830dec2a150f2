/* The deadbeat law, its x-y regulator by what it promises. */
#include "ht_contracts.h"
#include "ht_deadbeat_law.c"
#include "xy_regulator_contract.h"

void prove_deadbeat_law(void)
{
    ht_deadbeat_law_config cfg;
    ht_observer_config machine;
    ht_deadbeat_law_state st;
    ht_deadbeat_law_input in;
    cfg.gain = nondet_float();
    cfg.xy_ki_per_A = nondet_float();
    GIVEN(ht_deadbeat_law_check(&cfg));
    machine.ts_s = nondet_float();
    machine.inv_ts = nondet_float();
    machine.sigma_ls_H = nondet_float();
    machine.inv_sigma_ls = nondet_float();
    machine.torque_gain = nondet_float();
    st.xy.with = any_xy();
    st.xy.against = any_xy();
    GIVEN(HT_IS_XY_STATE(st.xy, HT_LAW_XY_LIMIT_PU));
    in.psi_Wb = any_ab();
    in.rotor_Wb = any_ab();
    in.psi_xy_Wb = any_xy();
    in.i_xy_A = any_xy();
    in.turn_rad = nondet_float();
    in.rs_ohm = nondet_float();
    in.torque_ref_Nm = nondet_float();
    in.flux_ref_Wb = nondet_float();
    in.vdc_V = nondet_float();
    (void)ht_deadbeat_law_step(&cfg, &machine, &st, &in);
    MUST(HT_IS_XY_STATE(st.xy, HT_LAW_XY_LIMIT_PU));
}

void prove_deadbeat_check(void)
{
    ht_deadbeat_law_config cfg;
    cfg.gain = nondet_float();
    cfg.xy_ki_per_A = nondet_float();
    GIVEN(ht_deadbeat_law_check(&cfg));
    MUST((cfg.gain > 0.0f) && (cfg.gain <= 1.0f));
    MUST((cfg.xy_ki_per_A >= 0.0f) && is_finite(cfg.xy_ki_per_A));
}
