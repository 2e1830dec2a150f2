/* Every set of parameters that are each in range, on a board with any PWM clock that a chip has. */
#include "ht_configure.c"
#include "ht_contracts.h"
#include "ht_control_configure.c"
#include "ht_deadbeat_law.c"
#include "ht_foc_law.c"
#include "ht_induction_rules.c"
#include "ht_interleaved.c"
#include "ht_interleaved_law.c"
#include "ht_lost_legs.c"
#include "ht_magnet_rules.c"
#include "ht_misfit.h"
#define shares_of modulator_shares_of
#include "ht_modulator.c"
#undef shares_of
#define table params_table /* a name of two files */
#include "ht_params.c"
#undef table
#define table schemes_table
#include "ht_schemes.c"
#undef table
#include "ht_table_law.c"
#include "ht_tables.c"
#include "ht_voltage_law.c"
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

/* What misfit.c proves: the period, and the write instant in counts, are in range. */
ht_misfit ht_misfit_of(const ht_params *p, float pwm_clock_Hz)
{
    float period = pwm_clock_Hz / p->v[HT_P_f_isr_Hz];
    float first = p->v[HT_P_write_delay_us] * 1.0e-6f * pwm_clock_Hz;
    GIVEN((period >= 8.0f) && (period <= 65535.0f));
    GIVEN((p->v[HT_P_load_mode] == 0.0f)
          || ((first >= 0.0f) && (first <= 18001.0f)
              && ((uint16_t)(first + 0.5f) < ((uint16_t)(period + 0.5f) / 2u))));
    return HT_MISFIT_NONE;
}

uint16_t ht_counts_up(float time_us, float clock_Hz)
{
    return nondet_uint16();
}

void prove_configure(void)
{
    ht_drive_config all;
    const ht_control_config *c = &all.control;
    ht_pwm_setup setup;
    const ht_port *port = 0;
    any_params(&all.params);
    GIVEN(ht_configure(port, &all, &setup) == HT_OK);
    MUST((setup.period_counts >= 8u) && (setup.period_counts == c->period.counts));
    MUST(HT_IS_PERIOD(c->period) && IMPLIES(c->shadow, c->period.first == 0u));
    MUST(setup.shadow == c->shadow);
    MUST((uint16_t)c->scheme < (uint16_t)HT_SCHEMES);
    MUST((unsigned)c->observer.kind < HT_OBSERVERS);
    MUST((c->dead.dead_pu >= 0.0f) && (c->dead.dead_pu <= 0.5f) && (c->dead.i_zero_A > 0.0f));
    MUST(IMPLIES(c->law == HT_LAW_TABLE, ht_table_law_check(&c->table_law)));
    MUST(IMPLIES(c->law != HT_LAW_TABLE, ht_modulator_check(&c->modulator)));
    MUST(IMPLIES(c->law == HT_LAW_DEADBEAT, ht_deadbeat_law_check(&c->deadbeat_law)));
    MUST(IMPLIES(c->law == HT_LAW_FOC, ht_foc_law_check(&c->foc_law)));
    MUST(IMPLIES(c->law == HT_LAW_INTERLEAVED, ht_interleaved_law_check(&c->interleaved_law)));
    MUST(IMPLIES(c->law != HT_LAW_TABLE, c->shadow && c->predict));
}
