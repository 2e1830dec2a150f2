/* Every set of parameters that are each in range, on a board with any PWM clock that a chip has. */
#include "ht_configure.c"
#include "ht_contracts.h"
#include "ht_control.c"
#include "ht_deadbeat_law.c"
#include "ht_misfit.c"
#include "ht_modulator.c"
#define table params_table /* a name of two files */
#include "ht_params.c"
#undef table
#define table schemes_table
#include "ht_schemes.c"
#undef table
#include "ht_table_law.c"
#include "ht_tables.c"
#include "prove.h"

static float clock_Hz; /* of the PWM */

float ht_port_pwm_clock_Hz(const ht_port *port)
{
    return clock_Hz;
}

static void any_params(ht_params *p)
{
    uint16_t id;
    for (id = 0u; id < HT_PARAMS; id++) {
        p->v[id] = nondet_float();
        GIVEN(ht_param_valid(id, p->v[id]));
    }
    clock_Hz = nondet_float();
    GIVEN((clock_Hz >= 1.0e6f) && (clock_Hz <= 4.0e8f));
}

void prove_misfit(void)
{
    ht_params p;
    const float *v = p.v;
    any_params(&p);
    GIVEN(ht_misfit_of(&p, clock_Hz) == HT_MISFIT_NONE);
    MUST(v[HT_P_torque_inner_Nm] <= v[HT_P_torque_band_Nm]);
    MUST(v[HT_P_flux_min_Wb] <= v[HT_P_flux_ref_Wb]);
    MUST(v[HT_P_flux_ref_Wb] < v[HT_P_flux_trip_Wb]);
    MUST(v[HT_P_vdc_min_V] < v[HT_P_vdc_max_V]);
    MUST(v[HT_P_i_trip_A] < v[HT_P_i_full_A]);
    MUST(v[HT_P_vdc_max_V] < v[HT_P_vdc_full_V]);
    MUST((v[HT_P_torque_release_Nm] == 0.0f)
         || HT_IS_WITHIN(v[HT_P_torque_release_Nm], v[HT_P_torque_band_Nm]));
}

void prove_configure(void)
{
    ht_params p;
    ht_control_config c;
    ht_pwm_setup setup;
    const ht_port *port = 0;
    any_params(&p);
    GIVEN(ht_configure(port, &p, &c, &setup) == HT_OK);
    MUST((setup.period_counts >= 8u) && (setup.period_counts == c.period_counts));
    MUST(c.first_counts < (c.period_counts / 2u));
    MUST(IMPLIES(c.shadow, c.first_counts == 0u));
    MUST(setup.shadow == c.shadow);
    MUST((uint16_t)c.scheme < (uint16_t)HT_SCHEMES);
    MUST((unsigned)c.observer.kind < HT_OBSERVERS);
    MUST((c.dead.dead_pu >= 0.0f) && (c.dead.dead_pu <= 0.5f) && (c.dead.i_zero_A > 0.0f));
    MUST(c.law == HT_LAW_TABLE ? ht_table_law_check(&c.table_law)
                               : ht_modulator_check(&c.modulator));
    MUST(IMPLIES(c.law == HT_LAW_DEADBEAT, c.shadow && c.predict));
}

void prove_dead_counts(void)
{
    float dead_us = nondet_float();
    float clock = nondet_float();
    uint16_t counts;
    GIVEN((dead_us >= 0.0f) && (dead_us <= 20.0f) && (clock >= 1.0e6f) && (clock <= 4.0e8f));
    counts = dead_counts(dead_us, clock);
    MUST((float)counts >= (dead_us * 1.0e-6f * clock - HT_DEAD_TOLERANCE_COUNTS));
}
