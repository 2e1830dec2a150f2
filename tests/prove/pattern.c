#include "ht_contracts.h"
#include "ht_pattern.c"
#include "ht_tables.c"
#include "prove.h"

/* Beyond this no count of an instant lies: the first one is in the first half of a period. */
#define MOST_COUNT 98303u

static uint32_t promise_count_at(uint16_t first, float t, float full)
{
    uint32_t count = nondet_uint32();
    MUST((first < 32768u) && (t >= 0.0f) && (t <= 1.0f) && (full >= 8.0f) && (full <= 65535.0f));
    GIVEN((count >= first) && (count <= MOST_COUNT));
    return count;
}

void prove_count_at(void)
{
    uint16_t first = nondet_uint16();
    float t = nondet_float();
    float full = nondet_float();
    uint32_t count;
    GIVEN((first < 32768u) && (t >= 0.0f) && (t <= 1.0f) && (full >= 8.0f) && (full <= 65535.0f));
    ht_most[0][0] = 1.0f;
    ht_most[0][1] = 65535.0f;
    count = count_at(first, t, full);
    MUST((count >= first) && (count <= MOST_COUNT));
}

/* Each leg of a word toggles at the count that is told, no other leg changes. */
void prove_toggle(void)
{
    ht_compare counts;
    ht_applied applied;
    uint16_t leg = nondet_uint16();
    uint16_t toggle1 = nondet_uint16();
    uint16_t toggle2 = nondet_uint16();
    uint16_t c1 = nondet_uint16();
    uint16_t c2 = nondet_uint16();
    uint16_t ca = nondet_uint16();
    uint16_t cb = nondet_uint16();
    GIVEN(HT_IS_WORD(toggle1) && HT_IS_WORD(toggle2) && (leg < 6u));
    counts.ca[leg] = ca;
    counts.cb[leg] = cb;
    toggle(&counts, &applied, toggle1, toggle2, c1, c2, nondet_float());
    MUST(counts.ca[leg] == (((toggle1 & (0x20u >> leg)) != 0u) ? c1 : ca));
    MUST(counts.cb[leg] == (((toggle2 & (0x20u >> leg)) != 0u) ? c2 : cb));
}

/* What the legs are told at the end, if any toggles. */
static bool toggled;
static ht_period the_period;

static void promise_toggle(ht_compare *counts, ht_applied *applied, unsigned toggle1,
                           unsigned toggle2, uint32_t c1, uint32_t c2, float full)
{
    uint32_t earliest = (uint32_t)the_period.first + the_period.shortest;
    MUST(!toggled); /* once a period */
    MUST(HT_IS_WORD(toggle1) && HT_IS_WORD(toggle2));
    MUST(counts->start == applied->s[0]);
    MUST(toggle1 == ((unsigned)applied->s[0] ^ applied->s[1]));
    MUST(toggle2 == ((unsigned)applied->s[1] ^ applied->s[2]));
    MUST(IMPLIES(toggle1 != 0u,
                 (c1 >= earliest) && ((c1 + the_period.shortest) <= the_period.counts)));
    MUST(IMPLIES(toggle2 != 0u,
                 (c2 >= earliest) && ((c2 + the_period.shortest) <= the_period.counts)));
    MUST(IMPLIES((toggle1 != 0u) && (toggle2 != 0u), (c1 + the_period.shortest) <= c2));
    toggled = true;
}

/* Every pattern that the table law can ask for becomes toggles where its words differ and nowhere
 * else, and no pulse is shorter than the shortest. */
void prove_pattern(void)
{
    uint16_t s[3];
    ht_action_points p;
    ht_compare counts;
    ht_applied applied;
    uint16_t leg = nondet_uint16();
    int n;
    for (n = 0; n < 3; n++) {
        s[n] = nondet_uint16();
        GIVEN(HT_IS_WORD(s[n]));
    }
    p.t1 = nondet_float();
    p.t2 = nondet_float();
    GIVEN(HT_ARE_ACTION_POINTS(p));
    the_period.counts = nondet_uint16();
    the_period.first = nondet_uint16();
    the_period.shortest = nondet_uint16();
    GIVEN(HT_IS_PERIOD(the_period) && (leg < 6u));
    toggled = false;
    ht_pattern_counts(s, p, &the_period, &counts, &applied);
    for (n = 0; n < 3; n++) { /* none but what was asked for */
        MUST((applied.s[n] == s[0]) || (applied.s[n] == s[1]) || (applied.s[n] == s[2]));
    }
    MUST(counts.start == applied.s[0]);
    MUST(toggled || ((applied.s[0] == applied.s[1]) && (applied.s[1] == applied.s[2])));
    MUST((counts.ca[leg] == the_period.counts) && (counts.cb[leg] == the_period.counts));
}

void prove_applied_high(void)
{
    ht_applied a;
    ht_toggles toggles[2];
    ht_six high;
    int n;
    a.before = nondet_uint16();
    a.own = nondet_uint16();
    for (n = 0; n < 3; n++) {
        a.s[n] = nondet_uint16();
        a.t[n] = nondet_float();
    }
    for (n = 0; n < HT_LEGS; n++) {
        toggles[0].t[n] = nondet_float();
        toggles[1].t[n] = nondet_float();
    }
    GIVEN(a.own <= 2u);
    ht_applied_high(&a, toggles, &high);
    for (n = 0; n < HT_LEGS; n++) {
        unsigned words = (unsigned)a.before | a.s[0] | a.s[1] | a.s[2];
        MUST(IMPLIES((words & (0x20u >> n)) == 0u, high.p[n] == 0.0f));
    }
}

void prove_applied_finish(void)
{
    ht_applied a;
    ht_dead_time dead;
    uint16_t before = nondet_uint16();
    unsigned edges;
    int n;
    for (n = 0; n < 3; n++) {
        a.s[n] = nondet_uint16();
        a.t[n] = nondet_float();
        GIVEN(HT_IS_WORD(a.s[n]));
    }
    dead.dead_pu = nondet_float();
    dead.i_zero_A = nondet_float();
    GIVEN(HT_IS_WORD(before));
    ht_applied_finish(&a, before, &dead);
    edges = (before ^ a.s[0]) | (a.s[0] ^ a.s[1]) | (a.s[1] ^ a.s[2]);
    MUST(HT_IS_WORD(edges));
    MUST((a.rising | a.falling | a.close) == edges);
    MUST(((a.rising | a.falling) & a.close) == 0u);
    MUST((a.later & ~edges) == 0u);
    MUST((((a.s[0] ^ a.s[1]) | (a.s[1] ^ a.s[2])) & ~a.later) == 0u);
    MUST((a.before == before) && (a.own == 0u));
}

void prove_flow(void)
{
    ht_six i_A = any_six();
    ht_dead_time dead;
    ht_flow flow;
    uint16_t leg = nondet_uint16();
    unsigned bit;
    dead.dead_pu = nondet_float();
    dead.i_zero_A = nondet_float();
    GIVEN((dead.i_zero_A > 0.0f) && (leg < 6u));
    bit = 0x20u >> leg;
    flow = ht_flow_of(&i_A, &dead);
    MUST(HT_IS_WORD(flow.out | flow.in));
    MUST(((flow.out & bit) != 0u) == (i_A.p[leg] >= dead.i_zero_A));
    MUST(((flow.in & bit) != 0u) == (i_A.p[leg] <= -dead.i_zero_A));
}

static void any_pattern(ht_applied *a, ht_toggles toggles[2])
{
    int n;
    a->before = nondet_uint16();
    for (n = 0; n < 3; n++) {
        a->s[n] = nondet_uint16();
        a->t[n] = nondet_float();
    }
    for (n = 0; n < 2; n++) {
        int leg;
        for (leg = 0; leg < HT_LEGS; leg++) {
            toggles[n].t[leg] = nondet_float();
        }
    }
    a->later = nondet_uint16();
    a->close = nondet_uint16();
    a->rising = nondet_uint16();
    a->falling = nondet_uint16();
    a->mean_pu.ab = any_ab();
    a->mean_pu.xy = any_xy();
    a->own = nondet_uint16();
    GIVEN(HT_IS_PATTERN(*a));
}

/* One leg of any pattern. */
void prove_lost(void)
{
    ht_applied a;
    ht_toggles toggles[2];
    ht_dead_time dead;
    float over = nondet_float();
    uint16_t leg = nondet_uint16();
    dead.dead_pu = nondet_float();
    dead.i_zero_A = nondet_float();
    GIVEN(leg < 6u);
    any_pattern(&a, toggles);
    (void)lost_pu(&a, toggles, &dead, leg, nondet_float(), nondet_float(), &over);
}

/* Any pattern; its delays go where those of the period before came from. */
void prove_volt_seconds(void)
{
    ht_applied a;
    ht_toggles toggles[2];
    ht_dead_time dead;
    ht_flow flow;
    ht_six begin = any_six();
    ht_six end = any_six();
    ht_carry carry;
    int n;
    any_pattern(&a, toggles);
    flow.out = nondet_uint16();
    flow.in = nondet_uint16();
    for (n = 0; n < HT_LEGS; n++) {
        carry.shift[n] = nondet_float();
    }
    carry.legs = nondet_uint16();
    dead.dead_pu = nondet_float();
    dead.i_zero_A = nondet_float();
    GIVEN(HT_IS_WORD(flow.out) && HT_IS_WORD(flow.in) && HT_IS_WORD(carry.legs));
    (void)ht_volt_seconds(&a, toggles, &dead, flow, &begin, &end, &carry, &carry, nondet_bool());
    MUST(HT_IS_WORD(carry.legs));
}

static float promise_lost_pu(const ht_applied *a, const ht_toggles *toggles,
                             const ht_dead_time *dead, unsigned leg, float i_begin, float i_end,
                             float *over)
{
    MUST(leg < 6u);
    *over = nondet_float();
    return nondet_float();
}
