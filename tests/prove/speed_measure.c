#include "ht_contracts.h"
#include "ht_speed_measure.c"
#include "prove.h"

void prove_speed_measure(void)
{
    ht_speed_measure_config cfg;
    ht_speed_measure_state st;
    ht_capture c;
    int32_t moved = (int32_t)nondet_uint32();
    float got;
    float counted;
    cfg.rpm_per_count = nondet_float();
    cfg.rpm_ticks = nondet_float();
    cfg.period_rpm = nondet_float();
    st.unusable_events = nondet_uint16();
    c.period_ticks = nondet_uint16();
    c.age_ticks = nondet_uint16();
    c.event = nondet_bool();
    c.overflow = nondet_bool();
    c.reversed = nondet_bool();
    c.forward = nondet_bool();
    GIVEN(st.unusable_events <= 2u);
    /* 60 f_slow / N of the parameters' ranges */
    GIVEN((cfg.rpm_per_count >= 1.0e-4f) && (cfg.rpm_per_count <= 15000.0f));
    GIVEN((cfg.rpm_ticks >= 0.0f) && (cfg.rpm_ticks <= 1.0e11f));
    GIVEN((cfg.period_rpm >= 0.0f) && (cfg.period_rpm <= 30000.0f));
    got = ht_speed_measure_step(&cfg, &st, moved, &c);
    counted = (float)moved * cfg.rpm_per_count;
    MUST(is_finite(got));
    MUST(st.unusable_events <= 2u);
    MUST(IMPLIES(c.overflow || c.reversed, got == counted));
    MUST(IMPLIES(cfg.period_rpm == 0.0f, got == counted));
}
