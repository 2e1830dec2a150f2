#include "ht_pattern.h"

static unsigned without_first(unsigned legs)
{
    return legs & ~(HT_LEG_U1 >> ht_first_leg[legs]);
}

/* The instant in low..high that is next to `at`, and from both ends as far as `shortest` or on one of
 * them. */
static uint32_t next_to(uint32_t at, uint32_t low, uint32_t high, uint32_t shortest)
{
    uint32_t found = at;
    if ((high - low) < (2u * shortest)) {
        found = ((at - low) < (high - at)) ? low : high;
    } else if ((at - low) < shortest) {
        found = ((2u * (at - low)) < shortest) ? low : (low + shortest);
    } else if ((high - at) < shortest) {
        found = ((2u * (high - at)) < shortest) ? high : (high - shortest);
    } else {
        /* far from both */
    }
    return found;
}

/* Toggles at counts c1 and c2. */
static HT_INTO_CALLERS void toggle(ht_compare *counts, ht_applied *applied, unsigned toggle1,
                                   unsigned toggle2, uint32_t c1, uint32_t c2, float full)
{
    float per_count = 1.0f / full;
    unsigned legs;
    for (legs = toggle1; legs != 0u; legs = without_first(legs)) {
        counts->ca[ht_first_leg[legs]] = (uint16_t)c1;
    }
    for (legs = toggle2; legs != 0u; legs = without_first(legs)) {
        counts->cb[ht_first_leg[legs]] = (uint16_t)c2;
    }
    applied->t[1] = (float)c1 * per_count;
    applied->t[2] = (float)c2 * per_count;
}

/* A word would last shorter than the shortest pulse: it lasts that long or not at all. */
HT_SELDOM static void toggle_apart(const ht_period *period, uint32_t c1, uint32_t c2,
                                   ht_compare *counts, ht_applied *a)
{
    uint32_t low = period->first;
    uint32_t high = period->counts;
    uint32_t second = (c2 < high) ? c2 : high;
    uint32_t first;
    second = (a->s[1] != a->s[2]) ? next_to(second, low, high, period->shortest) : high;
    first = (c1 < second) ? c1 : second;
    first = (a->s[0] != a->s[1]) ? next_to(first, low, second, period->shortest) : low;
    if (first == high) {
        a->s[1] = a->s[0];
    }
    if (second == high) {
        a->s[2] = a->s[1];
        second = first;
    }
    if (first == second) {
        a->s[1] = a->s[2];
    }
    if (first == low) {
        a->s[0] = a->s[1];
    }
    counts->start = a->s[0];
    if ((a->s[0] != a->s[1]) || (a->s[1] != a->s[2])) {
        toggle(counts, a, (unsigned)a->s[0] ^ a->s[1], (unsigned)a->s[1] ^ a->s[2], first, second,
               (float)high);
    }
}

/* Count of an instant. First count and up to a whole period: more than 16 bits. */
static HT_INTO_CALLERS uint32_t count_at(uint16_t first, float t, float full)
{
    float at = (float)first + t * full + 0.5f;
    return (uint32_t)at;
}

void ht_pattern_counts(const uint16_t s[3], ht_action_points p, const ht_period *period,
                       ht_compare *counts, ht_applied *applied)
{
    uint16_t end = period->counts;
    uint16_t first = period->first;
    unsigned toggle1 = (unsigned)s[0] ^ s[1];
    unsigned toggle2 = (unsigned)s[1] ^ s[2];
    float full = (float)end;
    int leg;

    counts->start = s[0];
    for (leg = 0; leg < HT_LEGS; leg++) {
        counts->ca[leg] = end;
        counts->cb[leg] = end;
    }
    applied->s[0] = s[0];
    applied->s[1] = s[1];
    applied->s[2] = s[2];
    applied->t[0] = 0.0f;
    applied->t[1] = 1.0f;
    applied->t[2] = 1.0f;
    if (first != 0u) {
        applied->t[0] = (float)first / full;
    }
    if ((toggle1 | toggle2) != 0u) {
        uint32_t c1 = count_at(first, p.t1, full);
        uint32_t c2 = count_at(first, p.t2, full);
        uint32_t shortest = period->shortest;
        if ((c1 < (first + shortest)) || (c2 < (c1 + shortest)) || ((c2 + shortest) > end)) {
            toggle_apart(period, c1, c2, counts, applied);
        } else {
            toggle(counts, applied, toggle1, toggle2, c1, c2, full);
        }
    }
}

static void add(ht_vsd *sum, const ht_vsd *v, float weight)
{
    sum->ab.alpha += weight * v->ab.alpha;
    sum->ab.beta += weight * v->ab.beta;
    sum->xy.x += weight * v->xy.x;
    sum->xy.y += weight * v->xy.y;
}

void ht_applied_finish(ht_applied *a, uint16_t before, const ht_dead_time *dead)
{
    unsigned s0 = a->s[0];
    unsigned s1 = a->s[1];
    unsigned s2 = a->s[2];
    float first = a->t[0];
    /* Legs with an edge at t[0], t[1], t[2]. */
    unsigned edge0 = before ^ s0;
    unsigned edge1 = s0 ^ s1;
    unsigned edge2 = s1 ^ s2;
    unsigned rising = edge0 & s0;
    unsigned falling = edge0 & before;
    unsigned later = edge1 | edge2;
    unsigned close = 0u;
    ht_vsd mean;

    a->before = before;
    mean.ab.alpha = ht_vector[s0].ab.alpha;
    mean.ab.beta = ht_vector[s0].ab.beta;
    mean.xy.x = ht_vector[s0].xy.x;
    mean.xy.y = ht_vector[s0].xy.y;
    if (later != 0u) {
        float d1 = a->t[1];
        float d2 = a->t[2] - a->t[1];
        float d3 = 1.0f - a->t[2];
        mean.ab.alpha *= d1;
        mean.ab.beta *= d1;
        mean.xy.x *= d1;
        mean.xy.y *= d1;
        add(&mean, &ht_vector[s1], d2);
        add(&mean, &ht_vector[s2], d3);
        /* Three edges: two of them in the same direction, which one bit cannot tell. (An
         * edge at t[0] alone keeps its distance: first and dead time are at most half a
         * period.) */
        close = edge0 & edge1 & edge2;
        if (d1 - first < dead->dead_pu) {
            close |= edge0 & later;
        }
        if (d2 < dead->dead_pu) {
            close |= edge1 & edge2;
        }
        if (d3 < dead->dead_pu) {
            close |= later;
        }
        rising = (rising | (edge1 & s1) | (edge2 & s2)) & ~close;
        falling = (falling | (edge1 & s0) | (edge2 & s1)) & ~close;
    }
    if (first > 0.0f) {
        add(&mean, &ht_vector[before], first);
        add(&mean, &ht_vector[s0], -first);
        later |= edge0;
    }
    a->mean_pu = mean;
    a->later = later;
    a->close = close;
    a->rising = rising;
    a->falling = falling;
    a->own = 0u;
}

ht_flow ht_flow_of(const ht_six *i_A, const ht_dead_time *dead)
{
    float zero = dead->i_zero_A;
    ht_flow flow = {0u, 0u};
    unsigned bit = 1u;
    int leg;
    for (leg = HT_LEGS - 1; leg >= 0; leg--) {
        if (i_A->p[leg] >= zero) {
            flow.out |= bit;
        } else if (i_A->p[leg] <= -zero) {
            flow.in |= bit;
        } else {
            /* no sure sign */
        }
        bit <<= 1;
    }
    return flow;
}

ht_flow ht_flow_at_edges(const ht_applied *a, ht_flow begin, ht_flow end)
{
    ht_flow flow;
    flow.out = begin.out & (end.out | ~a->later);
    flow.in = begin.in & (end.in | ~a->later);
    return flow;
}

/* Instant at which a leg takes on its bit of s[e]. */
static float instant(const ht_applied *a, const ht_toggles *toggles, int e, unsigned leg)
{
    return ((a->own != 0u) && (e == 1)) ? toggles[a->own - 1u].t[leg] : a->t[e];
}

static float high_share(const ht_applied *a, const ht_toggles *toggles, unsigned leg)
{
    unsigned bit = HT_LEG_U1 >> leg;
    unsigned word = a->before;
    float from = 0.0f;
    float share = 0.0f;
    int e;
    for (e = 0; e < 3; e++) {
        float to = instant(a, toggles, e, leg);
        share += ((word & bit) != 0u) ? (to - from) : 0.0f;
        from = to;
        word = a->s[e];
    }
    return share + (((word & bit) != 0u) ? (1.0f - from) : 0.0f);
}

void ht_applied_high(const ht_applied *a, const ht_toggles *toggles, ht_six *high)
{
    unsigned leg;
    for (leg = 0u; leg < (unsigned)HT_LEGS; leg++) {
        high->p[leg] = high_share(a, toggles, leg);
    }
}

/* Instant of a leg's first edge at t[from] or later; 1 if there is none. */
static float next_edge(const ht_applied *a, const ht_toggles *toggles, int from, unsigned leg)
{
    uint16_t bit = (uint16_t)(HT_LEG_U1 >> leg);
    uint16_t last = (from == 0) ? a->before : a->s[from - 1];
    int e;
    for (e = from; e < 3; e++) {
        if (((last ^ a->s[e]) & bit) != 0u) {
            return instant(a, toggles, e, leg);
        }
        last = a->s[e];
    }
    return 1.0f;
}

/* What late edges take from the time that a leg is high. What of the last delay is
 * left at the period's end goes to `over`. */
static float lost_pu(const ht_applied *a, const ht_toggles *toggles, const ht_dead_time *dead,
                     unsigned leg, float i_begin, float i_end, float *over)
{
    uint16_t bit = (uint16_t)(HT_LEG_U1 >> leg);
    float lost = 0.0f;
    uint16_t level = (uint16_t)(a->before & bit);
    int e;
    for (e = 0; e < 3; e++) {
        uint16_t then = (uint16_t)(a->s[e] & bit);
        if (then != level) {
            float t = instant(a, toggles, e, leg);
            float i = i_begin + t * (i_end - i_begin);
            float outward = 0.5f + 0.5f * i / dead->i_zero_A; /* 1: current flows out of the leg */
            float next = next_edge(a, toggles, e + 1, leg);
            float room = next - t;
            float late;
            outward = (outward > 0.0f) ? outward : 0.0f;
            outward = (outward < 1.0f) ? outward : 1.0f;
            late = dead->dead_pu * ((then != 0u) ? outward : (1.0f - outward));
            if (late > room) {
                if (!(next < 1.0f)) {
                    *over = late - room;
                }
                late = room;
            }
            lost += (then != 0u) ? late : -late;
            level = then;
        }
    }
    return lost;
}

/* Legs that need a look at each of their edges, and delays left over from the period
 * before, which count in this one until the leg is switched back. */
static ht_vsd leg_by_leg(const ht_applied *a, const ht_toggles *toggles, const ht_dead_time *dead,
                         unsigned legs, const ht_six *i_begin, const ht_six *i_end,
                         const ht_carry *left, ht_carry *over)
{
    unsigned left_legs = left->legs;
    unsigned over_legs = 0u;
    unsigned todo = legs | left_legs;
    ht_vsd v = {{0.0f, 0.0f}, {0.0f, 0.0f}};
    while (todo != 0u) {
        unsigned leg = ht_first_leg[todo];
        uint16_t bit = (uint16_t)(HT_LEG_U1 >> leg);
        float lost = 0.0f;
        float rest = 0.0f;
        if ((left_legs & bit) != 0u) {
            float late = left->shift[leg];
            float room = next_edge(a, toggles, 0, leg);
            late = (late < room) ? late : room;
            lost = ((a->before & bit) != 0u) ? late : -late;
        }
        if ((legs & bit) != 0u) {
            lost += lost_pu(a, toggles, dead, leg, i_begin->p[leg], i_end->p[leg], &rest);
        }
        if (rest > 0.0f) {
            over_legs |= bit;
            over->shift[leg] = rest;
        }
        add(&v, &ht_transform[HT_WINDING_30][leg], -lost);
        todo = without_first(todo);
    }
    over->legs = (uint16_t)over_legs;
    return v;
}

ht_vsd ht_volt_seconds(const ht_applied *a, const ht_toggles *toggles, const ht_dead_time *dead,
                       ht_flow flow, const ht_six *i_begin, const ht_six *i_end,
                       const ht_carry *left, ht_carry *over, bool xy)
{
    unsigned edges = a->rising | a->falling;
    ht_vsd v = a->mean_pu;
    if ((edges | a->close | left->legs) != 0u) {
        /* Where the current's direction is beyond doubt and edges keep their distance, each
         * is late by the dead time or not at all: such legs are taken together. Late
         * rising edges cost voltage, late falling ones bring it. */
        unsigned others = (edges & ~(flow.out | flow.in)) | a->close;
        const ht_vsd *lost = &ht_vector[a->rising & flow.out];
        const ht_vsd *won = &ht_vector[a->falling & flow.in];
        float late = dead->dead_pu;
        v.ab.alpha += late * (won->ab.alpha - lost->ab.alpha);
        v.ab.beta += late * (won->ab.beta - lost->ab.beta);
        if (xy) {
            v.xy.x += late * (won->xy.x - lost->xy.x);
            v.xy.y += late * (won->xy.y - lost->xy.y);
        }
        if ((others | left->legs) != 0u) {
            ht_vsd more = leg_by_leg(a, toggles, dead, others, i_begin, i_end, left, over);
            v.ab.alpha += more.ab.alpha;
            v.ab.beta += more.ab.beta;
            if (xy) {
                v.xy.x += more.xy.x;
                v.xy.y += more.xy.y;
            }
            return v;
        }
    }
    over->legs = 0u;
    return v;
}
