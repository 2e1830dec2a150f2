#include "ht_contracts.h"
#include "ht_induction_rules.c"
#include "ht_magnet_rules.c"
#include "ht_protect.c"
#include "prove.h"

float sqrtf(float x)
{
    float root = nondet_float();
    GIVEN(IMPLIES(is_nan(x) || (x < 0.0f), is_nan(root)));
    GIVEN(IMPLIES(x >= 0.0f, root >= 0.0f));
    return root;
}

static void any_config(ht_protect_config *c)
{
    c->i_trip_A = nondet_float();
    c->i_ab_trip_A = nondet_float();
    c->i_sum_trip_A = nondet_float();
    c->vdc_min_V = nondet_float();
    c->vdc_max_V = nondet_float();
    c->flux_trip_Wb = nondet_float();
    c->speed_trip_rpm = nondet_float();
    c->stuck_counts = nondet_float();
}

static void any_input(ht_control_input *in)
{
    in->i_A = any_six();
    in->vdc_V = nondet_float();
}

void prove_protect_speed_vdc(void)
{
    ht_protect_config c;
    ht_control_input in;
    float rpm = nondet_float();
    unsigned faults;
    any_config(&c);
    any_input(&in);
    faults = ht_protect_samples(&c, &in, rpm, nondet_bool());
    MUST(IMPLIES(!(fabsf(rpm) < c.speed_trip_rpm), (faults & HT_FAULT_OVERSPEED) != 0u));
    MUST(IMPLIES(!(in.vdc_V <= c.vdc_max_V), (faults & HT_FAULT_VDC_HIGH) != 0u));
    MUST(IMPLIES(!(in.vdc_V >= c.vdc_min_V), (faults & HT_FAULT_VDC_LOW) != 0u));
    /* and no trip without a reason */
    MUST(IMPLIES(fabsf(rpm) < c.speed_trip_rpm, (faults & HT_FAULT_OVERSPEED) == 0u));
    MUST(IMPLIES(in.vdc_V <= c.vdc_max_V, (faults & HT_FAULT_VDC_HIGH) == 0u));
    MUST(IMPLIES(in.vdc_V >= c.vdc_min_V, (faults & HT_FAULT_VDC_LOW) == 0u));
}

void prove_protect_sum(void)
{
    ht_protect_config c;
    ht_control_input in;
    bool powered = nondet_bool();
    unsigned faults;
    float one;
    float two;
    any_config(&c);
    any_input(&in);
    faults = ht_protect_samples(&c, &in, nondet_float(), powered);
    one = in.i_A.p[0] + in.i_A.p[2] + in.i_A.p[4];
    two = in.i_A.p[1] + in.i_A.p[3] + in.i_A.p[5];
    MUST(((faults & HT_FAULT_CURRENT_SUM) != 0u)
         == (powered && !((fabsf(one) < c.i_sum_trip_A) && (fabsf(two) < c.i_sum_trip_A))));
}

/* One phase beyond the limit, the others anything. */
void prove_overcurrent(void)
{
    ht_protect_config c;
    ht_control_input in;
    uint16_t phase = nondet_uint16();
    unsigned faults;
    any_config(&c);
    any_input(&in);
    GIVEN((phase < 6u) && (c.i_trip_A >= 0.1f) && (c.i_trip_A <= 10000.0f));
    GIVEN(!(fabsf(in.i_A.p[phase]) < c.i_trip_A));
    ht_above = c.i_trip_A;
    ht_below = c.i_trip_A;
    ht_above_square = nondet_float();
    GIVEN(ht_above_square >= 0.0f);
    ht_below_square = ht_above_square;
    faults = ht_protect_samples(&c, &in, nondet_float(), nondet_bool());
    MUST((faults & HT_FAULT_OVERCURRENT) != 0u);
}

void prove_protect_stuck(void)
{
    ht_protect_config c;
    ht_protect_state st;
    ht_samples s;
    uint16_t leg = nondet_uint16();
    uint16_t same;
    uint16_t count;
    unsigned faults;
    int n;
    any_config(&c);
    for (n = 0; n < HT_LEGS; n++) {
        st.count[n] = nondet_uint16();
        st.other[n] = nondet_uint16();
        st.same[n] = nondet_uint16();
        GIVEN(st.same[n] <= HT_STUCK_LOOKS);
    }
    for (n = 0; n < HT_ADC_CHANNELS; n++) {
        s.adc[n] = nondet_uint16();
        GIVEN(s.adc[n] < HT_ADC_FULL);
    }
    GIVEN(leg < 6u);
    same = st.same[leg];
    count = st.count[leg];
    faults = ht_protect_stuck(&c, &st, &s, leg);
    MUST(st.same[leg] <= HT_STUCK_LOOKS);
    MUST(st.count[leg] == s.adc[leg]);
    MUST(IMPLIES(faults != 0u, (same == HT_STUCK_LOOKS) && (count == s.adc[leg])));
    MUST(IMPLIES(faults != 0u, c.stuck_counts > 0.0f));
    MUST((faults == 0u) || (faults == (unsigned)HT_FAULT_STUCK));
}

void prove_protect_results(void)
{
    ht_protect_config cfg;
    ht_control_state c;
    float torque_ref = nondet_float();
    unsigned faults;
    any_config(&cfg);
    GIVEN((cfg.flux_trip_Wb > 0.0f) && (cfg.flux_trip_Wb <= 400.0f));
    GIVEN((cfg.i_ab_trip_A > 0.0f) && (cfg.i_ab_trip_A <= 10000.0f));
    c.observer.i_A = any_ab();
    c.estimate.psi_Wb = any_ab();
    c.estimate.torque_Nm = nondet_float();
    c.decided.torque_Nm = nondet_float();
    c.v_xy_pu = any_xy();
    faults = ht_protect_results(&cfg, &c, torque_ref);
    MUST(IMPLIES(!is_finite(c.estimate.psi_Wb.alpha) || !is_finite(c.estimate.psi_Wb.beta)
                     || !is_finite(c.estimate.torque_Nm) || !is_finite(c.decided.torque_Nm)
                     || !is_finite(c.v_xy_pu.x) || !is_finite(c.v_xy_pu.y)
                     || !is_finite(torque_ref),
                 (faults & HT_FAULT_NONFINITE) != 0u));
    MUST(IMPLIES(!(fabsf(c.estimate.psi_Wb.alpha) < cfg.flux_trip_Wb),
                 (faults & (HT_FAULT_FLUX | HT_FAULT_NONFINITE)) != 0u));
    MUST(IMPLIES(!(fabsf(c.estimate.psi_Wb.beta) < cfg.flux_trip_Wb),
                 (faults & (HT_FAULT_FLUX | HT_FAULT_NONFINITE)) != 0u));
    MUST(IMPLIES(!is_finite(c.observer.i_A.alpha) || !is_finite(c.observer.i_A.beta),
                 (faults & HT_FAULT_OVERCURRENT) != 0u));
}

/* The checks against the machine's model. */
void prove_protect_slow(void)
{
    ht_protect_config cfg;
    ht_protect_state st;
    ht_control_state c;
    float speed_rpm = nondet_float();
    unsigned faults;
    any_config(&cfg);
    cfg.encoder_trip_rpm = nondet_float();
    cfg.flux_check = nondet_float();
    cfg.no_load_A = nondet_float();
    cfg.ls_H = nondet_float();
    cfg.sigma = nondet_float();
    cfg.slip_gain = nondet_float();
    cfg.rpm_per_rad_s = nondet_float();
    cfg.flux_gain = nondet_float();
    cfg.rotor_gain = nondet_float();
    cfg.magnetise_A_Wb = nondet_float();
    cfg.slow_Hz = nondet_float();
    cfg.slow_turns_s = nondet_float();
    cfg.encoder_gain = nondet_float();
    cfg.rotor = nondet_bool() ? HT_ROTOR_MAGNET : HT_ROTOR_INDUCTION;
    cfg.inv_psi_f = nondet_float();
    st.circle2 = nondet_float();
    st.rotor_Wb = nondet_float();
    st.rotor_now_Wb = nondet_float();
    st.i_A = any_ab();
    st.flux_Wb = any_ab();
    st.omega_rad_s = nondet_float();
    st.speed_error_rpm = nondet_float();
    c.estimate.psi_Wb = any_ab();
    c.observer.i_A = any_ab();
    c.observer.gap_Wb = any_ab();
    c.observer.rr_scale = nondet_float();
    c.observer.omega_sync_rad_s = nondet_float();
    faults = ht_protect_slow(&cfg, &st, &c, speed_rpm);
    MUST((faults & ~((unsigned)HT_FAULT_ENCODER | (unsigned)HT_FAULT_FLUX)) == 0u);
    MUST(IMPLIES(!(cfg.encoder_trip_rpm > 0.0f), (faults & HT_FAULT_ENCODER) == 0u));
    MUST(IMPLIES(!(cfg.flux_check > 0.0f), (faults & HT_FAULT_FLUX) == 0u));
    MUST(IMPLIES((cfg.rotor == HT_ROTOR_INDUCTION) && (cfg.encoder_trip_rpm > 0.0f),
                 ((faults & HT_FAULT_ENCODER) != 0u)
                     == !(fabsf(st.speed_error_rpm) < cfg.encoder_trip_rpm)));
    MUST(IMPLIES((cfg.rotor == HT_ROTOR_INDUCTION) && (cfg.encoder_trip_rpm > 0.0f)
                     && is_nan(c.estimate.psi_Wb.alpha),
                 (faults & HT_FAULT_ENCODER) != 0u));
    MUST(IMPLIES((cfg.rotor == HT_ROTOR_INDUCTION) && (cfg.flux_check > 0.0f)
                     && (is_nan(c.estimate.psi_Wb.alpha) || is_nan(c.estimate.psi_Wb.beta)),
                 (faults & HT_FAULT_FLUX) != 0u));
    MUST(IMPLIES((cfg.rotor == HT_ROTOR_MAGNET) && (cfg.flux_check > 0.0f)
                     && (is_nan(c.observer.gap_Wb.alpha) || is_nan(c.observer.gap_Wb.beta)),
                 (faults & HT_FAULT_FLUX) != 0u));
    MUST(IMPLIES((cfg.flux_check > 0.0f) && is_nan(st.circle2), (faults & HT_FAULT_FLUX) != 0u));
}
