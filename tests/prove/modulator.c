#include "ht_contracts.h"
#include "ht_modulator.c"
#include "ht_tables.c"
#include "ht_vsd.c"
#include "prove.h"

static uint16_t shortest;

/* What a leg relies on: the middle of the period, and room for the shortest pulse on either side.
 * All are multiples of a half far below 2^23, so their sums are exact: middle - most is the
 * shortest pulse and a half, middle + most the period without it and a half. */
void prove_timing_of(void)
{
    ht_period period;
    ht_dead_time dead = {0.0f, 1.0f}; /* the edges do not depend on it */
    ht_modulator_input in;
    timing t;
    in.dead = &dead;
    in.period = &period;
    period.counts = nondet_uint16();
    period.first = 0u;
    shortest = nondet_uint16();
    period.shortest = shortest;
    GIVEN(HT_IS_PERIOD(period));
    t = timing_of(&in);
    MUST(t.period == period.counts);
    MUST((t.middle + t.middle) == (float)(period.counts + 1u));
    MUST((t.most + t.most) == (float)(period.counts - 2u * shortest));
}

/* One leg, with any timing on which it may rely. */
void prove_modulate(void)
{
    timing t;
    carrier c;
    legs found = {0u, 0u};
    uint16_t ca[HT_LEGS];
    float instant[HT_LEGS];
    float share[HT_LEGS];
    uint16_t leg = nondet_uint16();
    uint16_t period = nondet_uint16();
    float d = nondet_float();
    bool moves;
    GIVEN(leg < 6u);
    t.period = period;
    t.per_count = 0.0f; /* no register depends on it */
    t.dead_half_pu2 = nondet_float();
    t.dead_per_A = nondet_float(); /* times 1 A: any product with any current */
    t.middle = nondet_float();
    t.early = nondet_float();
    t.most = nondet_float();
    shortest = nondet_uint16();
    GIVEN((period >= 8u) && (shortest >= 1u) && (shortest <= (period / 2u)));
    GIVEN((t.most >= 0.0f) && (t.middle >= 0.0f));
    ht_summand = t.middle;
    ht_from[0] = -t.most;
    ht_from[1] = t.most;
    ht_sum[0] = (float)shortest + 0.5f;
    ht_sum[1] = (float)(uint16_t)(period - shortest) + 0.5f;
    c = carrier_of(nondet_bool(), &t);
    modulate(&t, &c, d, 1.0f, leg, &found, ca, instant, share);
    moves = found.moves != 0u;
    MUST(moves || (ca[leg] == period));
    MUST(!moves || ((ca[leg] >= shortest) && (ca[leg] <= (period - shortest))));
    MUST(((found.moves | found.high) & ~(0x20u >> leg)) == 0u);
    MUST((found.moves & found.high) == 0u);
    MUST(IMPLIES(is_nan(d), !moves && (found.high == 0u)));
}

static void any_modulator_config(ht_modulator_config *cfg)
{
    cfg->kappa = nondet_float();
    cfg->kappa_from_pu = nondet_float();
    cfg->turn_pu = nondet_float();
    cfg->alternate = nondet_bool();
    cfg->opposite_from = nondet_float();
    cfg->winding = (ht_winding)nondet_uint16();
    GIVEN((unsigned)cfg->winding < HT_WINDINGS);
}

void prove_modulator_check(void)
{
    ht_modulator_config cfg;
    any_modulator_config(&cfg);
    GIVEN(ht_modulator_check(&cfg));
    MUST((cfg.kappa >= 0.0f) && (cfg.kappa <= 1.0f));
    MUST((cfg.kappa_from_pu >= 0.0f) && (cfg.turn_pu >= 0.0f));
}

/* The timing of the period that is being proved. */
static timing the_timing;

static timing promise_timing_of(const ht_modulator_input *in)
{
    MUST(HT_IS_PERIOD(*in->period) && (in->period->shortest == shortest));
    the_timing.period = in->period->counts;
    the_timing.per_count = nondet_float();
    the_timing.dead_half_pu2 = nondet_float();
    the_timing.dead_per_A = nondet_float();
    the_timing.middle = 1.0f; /* no register depends on which numbers these are */
    the_timing.early = nondet_float();
    the_timing.most = 0.0f;
    return the_timing;
}

static void promise_modulate(const timing *t, const carrier *c, float d, float i_A, uint16_t leg,
                             legs *found, uint16_t *ca, float *instant, float *share)
{
    unsigned bit = HT_LEG_U1 >> leg;
    bool moves = nondet_bool();
    MUST((leg < 6u) && (t->period == the_timing.period) && (t->middle == the_timing.middle)
         && (t->most == the_timing.most));
    found->moves |= moves ? bit : 0u;
    found->high |= (!moves && !is_nan(d) && nondet_bool()) ? bit : 0u;
    ca[leg] = nondet_uint16();
    GIVEN(moves ? ((ca[leg] >= shortest) && (ca[leg] <= (t->period - shortest)))
                : (ca[leg] == t->period));
    instant[leg] = nondet_float();
    share[leg] = nondet_float();
}

/* A whole period. */
void prove_modulator_step(void)
{
    ht_modulator_config cfg;
    ht_modulator_state st;
    ht_modulator_input in;
    ht_period period;
    ht_dead_time dead;
    ht_six i_A = any_six();
    ht_vsd v;
    ht_compare out;
    ht_applied applied;
    ht_toggles toggles;
    uint16_t leg = nondet_uint16();
    bool falling = nondet_bool();
    unsigned bit;
    any_modulator_config(&cfg);
    GIVEN(ht_modulator_check(&cfg) && (leg < 6u));
    st.falling = falling;
    st.opposite = nondet_bool();
    in.dead = &dead;
    in.i_A = &i_A;
    in.before = nondet_uint16();
    in.period = &period;
    period.counts = nondet_uint16();
    period.first = 0u;
    shortest = nondet_uint16();
    period.shortest = shortest;
    dead.dead_pu = nondet_float();
    dead.i_zero_A = nondet_float();
    GIVEN(HT_IS_WORD(in.before) && HT_IS_PERIOD(period));
    GIVEN((dead.dead_pu >= 0.0f) && (dead.dead_pu <= 0.5f) && (dead.i_zero_A > 0.0f));
    v.ab = any_ab();
    v.xy = any_xy();
    ht_modulator_step(&cfg, &st, &v, &in, &out, &applied, &toggles);
    applied.own = 0u; /* the caller sets it */
    bit = 0x20u >> leg;
    MUST(HT_IS_PATTERN(applied));
    MUST((out.start == applied.s[0]) && (applied.before == in.before));
    MUST(applied.s[1] == applied.s[2]);
    MUST(out.cb[leg] == period.counts);
    MUST(HT_IS_COMPARE(out.ca[leg], period));
    /* The register toggles the leg if and only if the words say so. */
    MUST((out.ca[leg] != period.counts) == (((applied.s[0] ^ applied.s[1]) & bit) != 0u));
    /* All legs of set 1 go the same way, and every second period the other way. */
    MUST(IMPLIES(((applied.s[0] ^ applied.s[1]) & HT_SET1 & bit) != 0u,
                 ((applied.s[0] & bit) != 0u) == falling));
    MUST(st.falling != falling);
    MUST(applied.later == (applied.s[0] ^ applied.s[1]));
    MUST((applied.close & ~applied.later) == 0u);
    /* Every edge is told, and no leg has one that is not there. */
    MUST((applied.rising | applied.falling | applied.close)
         == ((applied.before ^ applied.s[0]) | applied.later));
}
