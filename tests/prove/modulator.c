#include "ht_contracts.h"
#include "ht_modulator.c"
#include "ht_vsd.c"
#include "prove.h"

/* One leg, with the timing as ht_modulator_step makes it of any period and dead time. */
void prove_modulate(void)
{
    timing t;
    carrier c;
    legs found = {0u, 0u, 0u};
    uint16_t ca[HT_LEGS];
    float instant[HT_LEGS];
    float share[HT_LEGS];
    uint16_t leg = nondet_uint16();
    uint16_t period = nondet_uint16();
    float dead = nondet_float();
    float full = (float)period;
    float d = nondet_float();
    bool moves;
    GIVEN((leg < 6u) && (period >= 8u));
    t.period = period;
    t.per_count = 0.0f; /* no register depends on it */
    t.dead_half_pu2 = nondet_float();
    t.dead_per_A = nondet_float(); /* times 1 A: any product with any current */
    t.middle = 0.5f * full + 0.5f;
    t.early = 0.5f * dead;
    t.open = 0.5f * full - dead - 1.5f;
    GIVEN(dead >= 0.0f);
    c = carrier_of(nondet_bool(), &t);
    modulate(&t, &c, d, 1.0f, leg, &found, ca, instant, share);
    moves = found.moves != 0u;
    MUST(moves || (ca[leg] == period));
    MUST(!moves || ((ca[leg] >= 1u) && (ca[leg] <= (period - 1u))));
    MUST(((found.moves | found.high | found.close) & ~(0x20u >> leg)) == 0u);
    MUST((found.moves & found.high) == 0u);
    MUST((found.close & ~found.moves) == 0u);
    MUST(IMPLIES(is_nan(d), !moves && (found.high == 0u)));
}

static void any_modulator_config(ht_modulator_config *cfg)
{
    cfg->kappa = nondet_float();
    cfg->kappa_from_pu = nondet_float();
    cfg->turn_pu = nondet_float();
    cfg->alternate = nondet_bool();
}

void prove_modulator_check(void)
{
    ht_modulator_config cfg;
    any_modulator_config(&cfg);
    GIVEN(ht_modulator_check(&cfg));
    MUST((cfg.kappa >= 0.0f) && (cfg.kappa <= 1.0f));
    MUST((cfg.kappa_from_pu >= 0.0f) && (cfg.turn_pu >= 0.0f));
}
