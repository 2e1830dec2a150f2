#include "ht_pattern.h"

#define LEG_U1 0x20u /* bit of leg 0 in a state word */

void ht_pattern_counts(const uint16_t s[3], ht_action_points p, uint16_t period, uint16_t first,
                       ht_compare *counts, ht_applied *applied)
{
    float full = (float)period;
    uint16_t low1 = (uint16_t)(first + 1u);
    uint16_t high1 = (uint16_t)(period - 2u);
    uint16_t high2 = (uint16_t)(period - 1u);
    /* Limit in float first: the conversion of a value out of range is undefined. */
    float f1 = (float)first + p.t1 * full + 0.5f;
    float f2 = (float)first + p.t2 * full + 0.5f;
    uint16_t c1 = (uint16_t)((f1 < full) ? f1 : full);
    uint16_t c2 = (uint16_t)((f2 < full) ? f2 : full);
    uint16_t toggle1 = (uint16_t)(s[0] ^ s[1]);
    uint16_t toggle2 = (uint16_t)(s[1] ^ s[2]);
    float per_count = 1.0f / full;
    uint16_t bit = LEG_U1;
    int leg;

    c1 = (c1 < low1) ? low1 : ((c1 > high1) ? high1 : c1);
    c2 = (c2 <= c1) ? (uint16_t)(c1 + 1u) : ((c2 > high2) ? high2 : c2);

    counts->start = s[0];
    for (leg = 0; leg < HT_LEGS; leg++) {
        counts->ca[leg] = ((toggle1 & bit) != 0u) ? c1 : period;
        counts->cb[leg] = ((toggle2 & bit) != 0u) ? c2 : period;
        bit = (uint16_t)(bit >> 1);
    }
    applied->s[0] = s[0];
    applied->s[1] = s[1];
    applied->s[2] = s[2];
    applied->t[0] = (float)first * per_count;
    applied->t[1] = (float)c1 * per_count;
    applied->t[2] = (float)c2 * per_count;
}

static void add(ht_vsd *sum, const ht_vsd *v, float weight)
{
    sum->ab.alpha += weight * v->ab.alpha;
    sum->ab.beta += weight * v->ab.beta;
    sum->xy.x += weight * v->xy.x;
    sum->xy.y += weight * v->xy.y;
}

/* First edge of a leg in the period, or 1. */
static float first_edge(const ht_applied *a, uint16_t bit)
{
    if (((a->before ^ a->s[0]) & bit) != 0u) {
        return a->t[0];
    }
    if (((a->s[0] ^ a->s[1]) & bit) != 0u) {
        return a->t[1];
    }
    return (((a->s[1] ^ a->s[2]) & bit) != 0u) ? a->t[2] : 1.0f;
}

/* Delays left over from the period before: they count in this one until the leg
 * is switched back. */
static void apply_spill(const ht_applied *a, ht_spill *spill, ht_vsd *v)
{
    uint16_t bit = LEG_U1;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        if ((spill->legs & bit) != 0u) {
            float shift = spill->shift[leg];
            float room = first_edge(a, bit);
            shift = (shift < room) ? shift : room;
            add(v, &ht_transform[leg], ((a->before & bit) != 0u) ? -shift : shift);
        }
        bit = (uint16_t)(bit >> 1);
    }
    spill->legs = 0u;
}

/* Time from edge `e` of a leg to its next one in the same period. */
static float gap_to_next_edge(const ht_applied *a, int e, uint16_t bit)
{
    if ((e < 1) && (((a->s[0] ^ a->s[1]) & bit) != 0u)) {
        return a->t[1] - a->t[0];
    }
    if ((e < 2) && (((a->s[1] ^ a->s[2]) & bit) != 0u)) {
        return a->t[2] - a->t[e];
    }
    return 1.0f;
}

static void apply_edge(const ht_applied *a, int e, int leg, uint16_t bit, const ht_dead_time *dead,
                       float i_A, ht_spill *spill, ht_vsd *v)
{
    bool rising = (a->s[e] & bit) != 0u;
    float outward = 0.5f + i_A * dead->inv_2i_zero; /* 1: current flows out of the leg */
    float shift;
    float gap = gap_to_next_edge(a, e, bit);
    float room = 1.0f - a->t[e];
    outward = (outward > 0.0f) ? outward : 0.0f;
    outward = (outward < 1.0f) ? outward : 1.0f;
    shift = dead->dead_pu * (rising ? outward : (1.0f - outward));
    shift = (shift < gap) ? shift : gap;
    if (shift > room) {
        spill->legs |= bit;
        spill->shift[leg] = shift - room;
        shift = room;
    }
    add(v, &ht_transform[leg], rising ? -shift : shift);
}

ht_vsd ht_volt_seconds(const ht_applied *a, const ht_dead_time *dead, const ht_six *i_begin,
                       const ht_six *i_end, ht_spill *spill)
{
    ht_vsd v = {{0.0f, 0.0f}, {0.0f, 0.0f}};
    uint16_t before = a->before;
    int e;
    if (a->t[0] > 0.0f) {
        add(&v, &ht_vector[a->before], a->t[0]);
    }
    if ((a->s[0] == a->s[1]) && (a->s[1] == a->s[2])) {
        add(&v, &ht_vector[a->s[0]], 1.0f - a->t[0]);
    } else {
        add(&v, &ht_vector[a->s[0]], a->t[1] - a->t[0]);
        add(&v, &ht_vector[a->s[1]], a->t[2] - a->t[1]);
        add(&v, &ht_vector[a->s[2]], 1.0f - a->t[2]);
    }
    if (spill->legs != 0u) {
        apply_spill(a, spill, &v);
    }
    for (e = 0; e < 3; e++) {
        uint16_t changed = (uint16_t)(before ^ a->s[e]);
        uint16_t bit = LEG_U1;
        int leg = 0;
        while (changed != 0u) {
            if ((changed & bit) != 0u) {
                float i = i_begin->p[leg] + a->t[e] * (i_end->p[leg] - i_begin->p[leg]);
                apply_edge(a, e, leg, bit, dead, i, spill, &v);
                changed = (uint16_t)(changed & (uint16_t)~bit);
            }
            bit = (uint16_t)(bit >> 1);
            leg++;
        }
        before = a->s[e];
    }
    return v;
}
