#include "ht_contracts.h"
#include "ht_speed.c"
#include "prove.h"

void prove_speed(void)
{
    ht_speed_config c;
    ht_speed_state st;
    float before = nondet_float();
    float error = nondet_float();
    float least = nondet_float();
    float most = nondet_float();
    float torque;
    c.kp_Nms_rad = nondet_float();
    c.ki_ts_Nms_rad = nondet_float();
    st.integral_Nm = before;
    /* A torque reference that was followed may lie beyond a limit. */
    GIVEN((most > 0.0f) && is_finite(most) && (least <= 0.0f) && is_finite(least)
          && is_finite(before));
    GIVEN((c.kp_Nms_rad >= 0.0f) && (c.kp_Nms_rad <= 1000.0f));
    GIVEN((c.ki_ts_Nms_rad >= 0.0f) && (c.ki_ts_Nms_rad <= 1000.0f));
    torque = ht_speed_step(&c, &st, error, least, most);
    MUST((torque >= least) && (torque <= most));
    MUST(IMPLIES(!is_finite(error), (torque == 0.0f) && (st.integral_Nm == before)));
    MUST((st.integral_Nm == before) || ((st.integral_Nm >= least) && (st.integral_Nm <= most)));
}

void prove_flux_reference(void)
{
    ht_flux_config c;
    ht_flux_input in;
    float got;
    c.flux_min_Wb = nondet_float();
    c.reach_pu = nondet_float();
    c.rs_ohm = nondet_float();
    in.flux_Wb = nondet_float();
    in.vdc_V = nondet_float();
    in.omega_sync_rad_s = nondet_float();
    in.i_A = nondet_float();
    GIVEN((c.flux_min_Wb >= 0.0005f) && (c.flux_min_Wb <= in.flux_Wb) && (in.flux_Wb <= 100.0f));
    got = ht_flux_reference(&c, &in);
    MUST(!is_nan(got));
    MUST(got >= 0.0f);
    MUST(IMPLIES(is_nan(in.omega_sync_rad_s) || is_nan(in.vdc_V) || is_nan(in.i_A),
                 got == c.flux_min_Wb));
}
