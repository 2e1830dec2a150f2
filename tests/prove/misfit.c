/* Every set of parameters, each in its range, on a board with any PWM clock that a chip has.
 * ht_lost_legs_of has no body here: it may answer anything. */
#include "ht_contracts.h"
#include "ht_misfit.c"
#define table params_table /* a name of several files */
#include "ht_params.c"
#undef table
#define table schemes_table
#include "ht_schemes.c"
#undef table
#include "prove.h"

void prove_misfit(void)
{
    ht_params p;
    const float *v = p.v;
    float clock_Hz = nondet_float();
    uint16_t k;
    for (k = 0u; k < (uint16_t)(HT_MISFITS - 1); k++) { /* those that a rule is about */
        GIVEN(ht_param_valid(table[k].first, v[table[k].first]));
        GIVEN(ht_param_valid(table[k].second, v[table[k].second]));
    }
    GIVEN(ht_param_valid((uint16_t)HT_P_load_mode, v[HT_P_load_mode]));
    GIVEN((clock_Hz >= 1.0e6f) && (clock_Hz <= 4.0e8f));
    ht_most[0][0] = 45.0f;
    ht_most[0][1] = 1.0e-6f;
    ht_most[1][0] = 4.6e-5f;
    ht_most[1][1] = 4.0e8f;
    GIVEN(ht_misfit_of(&p, clock_Hz) == HT_MISFIT_NONE);
    MUST(v[HT_P_torque_inner_Nm] <= v[HT_P_torque_band_Nm]);
    MUST(v[HT_P_flux_min_Wb] <= v[HT_P_flux_ref_Wb]);
    MUST(v[HT_P_flux_ref_Wb] < v[HT_P_flux_trip_Wb]);
    MUST(v[HT_P_vdc_min_V] < v[HT_P_vdc_max_V]);
    MUST(v[HT_P_i_trip_A] < v[HT_P_i_full_A]);
    MUST(v[HT_P_vdc_max_V] < v[HT_P_vdc_full_V]);
    MUST(v[HT_P_comparator_above_pu] > 0.0f);
    MUST((v[HT_P_torque_release_Nm] == 0.0f)
         || HT_IS_WITHIN(v[HT_P_torque_release_Nm], v[HT_P_torque_band_Nm]));
}

/* 20 microseconds at 400 MHz at most. `ht_last_sum` is what was asked for, less the tolerance, in
 * counts. */
void prove_counts_up(void)
{
    float time_us = nondet_float();
    float clock = nondet_float();
    uint16_t counts;
    GIVEN((time_us >= 0.0f) && (time_us <= 20.0f) && (clock >= 1.0e6f) && (clock <= 4.0e8f));
    ht_most[0][0] = 20.0f;
    ht_most[0][1] = 1.0e-6f;
    ht_most[1][0] = 2.1e-5f;
    ht_most[1][1] = 4.0e8f;
    counts = ht_counts_up(time_us, clock);
    MUST((float)counts >= ht_last_sum);
}
