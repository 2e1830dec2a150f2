#include "ht_ramp.c"
#include "prove.h"

/* Any speed, rate and jerk of a drive in r/min, and any more. */
#define MOST_RPM 1.0e6f

float sqrtf(float x)
{
    float root = nondet_float();
    GIVEN(IMPLIES(is_nan(x) || (x < 0.0f), is_nan(root)));
    GIVEN(IMPLIES(x >= 1.0f, root >= 1.0f));
    GIVEN(IMPLIES(x >= 0.0f, root >= 0.0f));
    return root;
}

/* A change that can be stopped is one towards the target, and within the rate. */
void prove_ramp_stopping(void)
{
    float way = nondet_float();
    float jerk = nondet_float();
    float rate = nondet_float();
    float v;
    GIVEN((way >= 0.0f) && is_finite(way) && (jerk >= 0.0f) && (jerk <= MOST_RPM) && (rate > 0.0f));
    v = stopping_rpm(way, jerk, rate);
    MUST((v >= 0.0f) && (v <= rate));
}

static float promise_stopping_rpm(float way_rpm, float jerk_rpm, float rate_rpm)
{
    float v = nondet_float();
    (void)way_rpm;
    (void)jerk_rpm;
    GIVEN((v >= 0.0f) && (v <= rate_rpm));
    return v;
}

static float any_up_to(float least)
{
    float value = nondet_float();
    GIVEN((value >= least) && (value <= MOST_RPM));
    return value;
}

static ht_ramp_config any_rates(void)
{
    ht_ramp_config cfg;
    cfg.up_rpm = any_up_to(0.0f);
    cfg.down_rpm = any_up_to(0.0f);
    cfg.jerk_rpm = any_up_to(0.0f);
    return cfg;
}

static ht_ramp_state any_way(void)
{
    ht_ramp_state st;
    st.speed_rpm = any_up_to(-MOST_RPM);
    st.slope_rpm = any_up_to(-MOST_RPM);
    return st;
}

void prove_ramp(void)
{
    ht_ramp_config cfg = any_rates();
    ht_ramp_state st = any_way();
    ht_ramp_state was = st;
    float target = nondet_float();
    float got;
    float change;
    cfg.jerk_rpm = 0.0f;
    got = ht_ramp_step(&cfg, &st, target, 0.0f, false);
    change = fabsf(st.slope_rpm);
    MUST(IMPLIES(target >= was.speed_rpm, got >= was.speed_rpm));
    MUST(IMPLIES(target <= was.speed_rpm, got <= was.speed_rpm));
    MUST(IMPLIES((cfg.up_rpm > 0.0f) && (fabsf(got) > fabsf(was.speed_rpm)), change <= cfg.up_rpm));
    MUST(IMPLIES((cfg.down_rpm > 0.0f) && (fabsf(got) < fabsf(was.speed_rpm)),
                 change <= cfg.down_rpm));
}

/* With any jerk. */
void prove_ramp_finite(void)
{
    ht_ramp_config cfg = any_rates();
    ht_ramp_state st = any_way();
    ht_ramp_state was = st;
    float target = nondet_float();
    float got = ht_ramp_step(&cfg, &st, target, nondet_float(), nondet_bool());
    MUST(is_finite(got) && (got == st.speed_rpm) && is_finite(st.slope_rpm));
    MUST(IMPLIES(!is_finite(target), (got == was.speed_rpm) && (st.slope_rpm == was.slope_rpm)));
}

void prove_ramp_held(void)
{
    ht_ramp_config cfg = any_rates();
    ht_ramp_state st = any_way();
    ht_ramp_state was = st;
    float measured = nondet_float();
    float got = ht_ramp_step(&cfg, &st, nondet_float(), measured, true);
    MUST(IMPLIES(was.speed_rpm > measured, got <= was.speed_rpm));
    MUST(IMPLIES(was.speed_rpm < measured, got >= was.speed_rpm));
}
