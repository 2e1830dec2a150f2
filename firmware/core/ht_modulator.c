#include "ht_modulator.h"

#include "ht_toggled.h"
#include "ht_winding.h"

#include <math.h>

#define COS_30 0.866025404f
#define COS_15 0.965925826f
/* The carriers go back in phase below this share of the voltage from which they turn, squared. */
#define TURN_HOLD2 0.9025f

void ht_modulator_centre(ht_modulator_config *cfg, bool turned)
{
    cfg->kappa = 0.0f;
    cfg->kappa_from_pu = 0.0f;
    cfg->turn_pu = turned ? 0.0f : HT_NEVER_PU;
    cfg->alternate = false;
}

void ht_modulator_wind(ht_modulator_config *cfg, ht_winding winding)
{
    cfg->winding = winding;
    cfg->opposite_from = (winding == HT_WINDING_60) ? -HT_NEVER_PU : 0.0f;
    if (winding != HT_WINDING_30) {
        cfg->turn_pu = (winding == HT_WINDING_60) ? 0.0f : HT_NEVER_PU;
        cfg->alternate = false;
        cfg->kappa_from_pu *= COS_15; /* what ht_modulator_legs leaves of alpha-beta */
    }
}

bool ht_modulator_check(const ht_modulator_config *cfg)
{
    return (cfg->kappa >= 0.0f) && (cfg->kappa <= 1.0f) && (cfg->kappa_from_pu >= 0.0f)
           && (cfg->turn_pu >= 0.0f); /* NaN is not */
}

void ht_modulator_reset(ht_modulator_state *st)
{
    st->falling = false;
    st->opposite = false;
}

/* Commands of a set's three legs: p, q - p/2 and -q - p/2. Their sum is 0. */
typedef struct {
    float p;
    float q;
} three_phase;

/* Legs 0, 2, 4 lie at 0, 120, 240 degrees; in x-y at five times these angles. */
static three_phase set1_of(const ht_vsd *v)
{
    three_phase u;
    u.p = v->ab.alpha + v->xy.x;
    u.q = COS_30 * (v->ab.beta - v->xy.y);
    return u;
}

/* Legs 5, 1, 3 lie at 270, 30, 150 degrees. */
static three_phase set2_of(const ht_vsd *v)
{
    three_phase u;
    u.p = -(v->ab.beta + v->xy.y);
    u.q = COS_30 * (v->ab.alpha - v->xy.x);
    return u;
}

/* Range, and largest plus smallest command. The difference of the second and third leg is 2 q,
 * so these two span |q| to either side of -p/2, and the first leg lies 1.5 p from there. */
typedef struct {
    float range;
    float sum;
} extremes;

static extremes extremes_of(three_phase u)
{
    float half = fabsf(u.q);
    float first = 1.5f * u.p;
    float above = fabsf(first + half);
    float below = fabsf(first - half);
    extremes e;
    e.range = half + 0.5f * (above + below);
    /* The three add up to 0: largest and smallest add up to the middle one, negated. */
    e.sum = 0.5f * (u.p + (below - above));
    return e;
}

/* Share of x and y with which a set fits between the rails. */
static float fitting_share(three_phase without, three_phase with)
{
    float rest = 1.0f - extremes_of(without).range;
    float range = extremes_of(with).range;
    if (range <= 1.0f) {
        return 1.0f;
    }
    return (rest > 0.0f) ? (rest / (range - 1.0f + rest)) : 0.0f; /* NaN: 0 */
}

/* A set does not fit: less of x and y. */
static void fit(ht_vsd *v, ht_winding winding)
{
    ht_vsd without = {{0.0f, 0.0f}, {0.0f, 0.0f}};
    ht_vsd with = ht_of_legs(winding, *v);
    float share;
    float other;
    without.ab = v->ab;
    without = ht_of_legs(winding, without);
    share = fitting_share(set1_of(&without), set1_of(&with));
    other = fitting_share(set2_of(&without), set2_of(&with));
    share = (other < share) ? other : share;
    v->xy.x *= share;
    v->xy.y *= share;
}

/* v cubed, as a complex number. Its angle tells sectors of v. */
static ht_ab cubed(ht_ab v, float alpha2, float beta2)
{
    ht_ab c;
    c.alpha = v.alpha * (alpha2 - 3.0f * beta2);
    c.beta = v.beta * (3.0f * alpha2 - beta2);
    return c;
}

/* Share of the clamped zero sequence at a voltage squared: no step where it begins. */
static float kappa_at(const ht_modulator_config *cfg, float size2)
{
    float from = cfg->kappa_from_pu;
    if (from > 0.0f) {
        float above = size2 - from * from;
        float full = from + HT_KAPPA_RAMP_PU;
        float ramp = full * full - from * from;
        if (above <= 0.0f) {
            return 0.0f;
        }
        if (above < ramp) {
            return cfg->kappa * above / ramp;
        }
    }
    return cfg->kappa; /* NaN too */
}

/* Zero sequence of a set, with the middle between the rails at 0. Clamped, the legs are away
 * from centred by half of what they leave free: towards the rail of the leg with the largest
 * command, or, with a negative kappa, towards the other rail. */
static float zero_sequence(extremes e, float kappa)
{
    float zero = -0.5f * e.sum;
    if (kappa != 0.0f) {
        float away = kappa * (0.5f - 0.5f * e.range);
        zero += (e.sum > 0.0f) ? away : -away;
    }
    return zero;
}

/* The common part of all legs in a period. */
typedef struct {
    float dead_half_pu2; /* a quarter of the dead time ... */
    float dead_per_A;    /* ... and the same over the current from which it acts fully */
    float middle;        /* counts to the middle of the period, with what rounds them */
    float early;         /* counts of half the dead time: every edge is that much earlier */
    float most;          /* toggles lie within this many counts from the middle */
    float per_count;
    uint16_t period;
} timing;

/* The common part of a set's legs. */
typedef struct {
    float slope;     /* counts per command: > 0 falling, < 0 rising */
    float per_count; /* high time of a toggle's counts: from 0 if falling, from 1 if rising */
    float low;       /* high time of a leg that stays low, from the same */
} carrier;

static carrier carrier_of(bool falling, const timing *t)
{
    carrier c;
    c.slope = falling ? (float)t->period : -(float)t->period;
    c.per_count = falling ? t->per_count : -t->per_count;
    c.low = falling ? 0.0f : -1.0f;
    return c;
}

/* Masks of legs, as state words. */
typedef struct {
    unsigned high;  /* stay high */
    unsigned moves; /* toggle */
} legs;

/* What the dead time takes of a leg's high time, mean of a rising and a falling edge: half the
 * dead time against the current's sign, in proportion around zero. (|x + h| - |x - h| is 2 x
 * within +-h.) */
static float compensation(const timing *t, float i_A)
{
    float x = t->dead_per_A * i_A;
    return fabsf(x + t->dead_half_pu2) - fabsf(x - t->dead_half_pu2);
}

/* A toggle whose pulse would be too short moves to where the pulse is the shortest. Not so if the
 * rail is nearer to the command, or for NaN. */
static bool move_to_shortest(const timing *t, float d, float *counts)
{
    float moved = fabsf(*counts) - t->most;
    float to_rail = (0.5f - fabsf(d)) * (float)t->period;
    *counts = (*counts > 0.0f) ? t->most : -t->most;
    return moved < to_rail;
}

static void modulate(const timing *t, const carrier *c, float d, float i_A, uint16_t leg,
                     legs *found, uint16_t *ca, float *instant, float *share)
{
    unsigned bit = HT_LEG_U1 >> leg;
    float counts = c->slope * (d + compensation(t, i_A)) - t->early;
    if ((fabsf(counts) < t->most) || move_to_shortest(t, d, &counts)) {
        float edge = counts + t->middle;
        unsigned count = (unsigned)edge;
        found->moves |= bit;
        ca[leg] = (uint16_t)count;
        instant[leg] = (float)count * t->per_count;
        share[leg] = (float)count * c->per_count;
    } else { /* on a rail: the lower one for NaN */
        bool high = d > 0.0f;
        found->high |= high ? bit : 0u;
        ca[leg] = t->period;
        instant[leg] = 1.0f;
        share[leg] = high ? (c->low + 1.0f) : c->low;
    }
}

static HT_INTO_CALLERS timing timing_of(const ht_modulator_input *in)
{
    float full = (float)in->period->counts;
    uint16_t room = (uint16_t)(in->period->counts - 2u * in->period->shortest);
    timing t;
    t.period = in->period->counts;
    t.per_count = 1.0f / full;
    t.dead_half_pu2 = 0.25f * in->dead->dead_pu;
    t.dead_per_A = t.dead_half_pu2 / in->dead->i_zero_A;
    t.middle = 0.5f * full + 0.5f;
    t.early = 0.5f * full * in->dead->dead_pu;
    t.most = 0.5f * (float)room;
    return t;
}

/* Both sets, between the rails. */
typedef struct {
    three_phase one;
    three_phase two;
    extremes first;
    extremes second;
} both_sets;

static HT_INTO_CALLERS both_sets sets_of(const ht_vsd *v)
{
    both_sets s;
    s.one = set1_of(v);
    s.two = set2_of(v);
    s.first = extremes_of(s.one);
    s.second = extremes_of(s.two);
    return s;
}

static HT_INTO_CALLERS bool both_fit(const both_sets *s)
{
    return (s->first.range <= 1.0f) && (s->second.range <= 1.0f); /* NaN does not */
}

HT_SELDOM ht_vsd ht_modulator_legs(ht_winding winding, ht_vsd *v_pu)
{
    ht_vsd legs_pu = ht_of_legs(winding, *v_pu);
    both_sets set = sets_of(&legs_pu);
    if (!both_fit(&set)) {
        fit(v_pu, winding);
        legs_pu = ht_of_legs(winding, *v_pu);
    }
    return legs_pu;
}

/* Shares of the clamped zero sequences of both sets. */
typedef struct {
    float one;
    float two;
} shares;

static HT_INTO_CALLERS shares shares_of(const ht_modulator_config *cfg, float size2, ht_ab v3)
{
    shares k;
    k.one = kappa_at(cfg, size2);
    k.two = k.one;
    if (cfg->alternate && (k.one > 0.0f)) {
        if (fabsf(v3.alpha) > fabsf(v3.beta)) { /* within 15 degrees of 0, 60, 120, ... */
            k.one = -k.one;
        } else {
            k.two = -k.two;
        }
    }
    return k;
}

ht_sets ht_modulator_alternating(float kappa, float kappa_from_pu, ht_ab v_pu)
{
    float alpha2 = v_pu.alpha * v_pu.alpha;
    float beta2 = v_pu.beta * v_pu.beta;
    ht_ab v3 = cubed(v_pu, alpha2, beta2);
    ht_modulator_config cfg;
    shares k;
    ht_sets s;
    cfg.kappa = kappa;
    cfg.kappa_from_pu = kappa_from_pu;
    cfg.alternate = true;
    k = shares_of(&cfg, alpha2 + beta2, v3);
    /* Within 30 degrees of one of a set's legs, its command is the largest. */
    s.kappa[0] = (v3.alpha > 0.0f) ? k.one : -k.one;
    s.kappa[1] = (v3.beta > 0.0f) ? k.two : -k.two;
    s.opposite = v3.alpha * v3.beta > 0.0f;
    return s;
}

/* The commands of a set's legs: their registers, and the same as instants. */
typedef struct {
    const timing *t;
    const ht_six *i_A;
    legs *found;
    uint16_t *ca;
    float *instant;
} told;

/* A set whose legs are `a`, `b` and `c`, in the order of the commands p, q, -q. */
static HT_INTO_CALLERS void modulate_set(const told *to, bool falling, three_phase u, float zero,
                                         uint16_t a, uint16_t b, uint16_t c, float *share)
{
    carrier k = carrier_of(falling, to->t);
    float middle = zero - 0.5f * u.p;
    modulate(to->t, &k, zero + u.p, to->i_A->p[a], a, to->found, to->ca, to->instant, share);
    modulate(to->t, &k, middle + u.q, to->i_A->p[b], b, to->found, to->ca, to->instant, share);
    modulate(to->t, &k, middle - u.q, to->i_A->p[c], c, to->found, to->ca, to->instant, share);
}

void ht_modulator_step(const ht_modulator_config *cfg, ht_modulator_state *st, ht_vsd *v_pu,
                       const ht_modulator_input *in, ht_compare *out, ht_applied *applied,
                       ht_toggles *toggles)
{
    float alpha2 = v_pu->ab.alpha * v_pu->ab.alpha;
    float beta2 = v_pu->ab.beta * v_pu->ab.beta;
    float size2 = alpha2 + beta2;
    float turn2 = cfg->turn_pu * cfg->turn_pu * (st->opposite ? TURN_HOLD2 : 1.0f);
    ht_ab v3 = cubed(v_pu->ab, alpha2, beta2);
    shares kappa = shares_of(cfg, size2, v3);
    both_sets set = sets_of(v_pu);
    legs found = {0u, 0u};
    ht_six share; /* of the period that a leg is high, with a zero of each set's own */
    timing t;
    told to;
    bool falling = st->falling;
    bool other; /* set 2 falls */
    unsigned rises;
    uint16_t leg;

    if (!both_fit(&set) && (cfg->winding == HT_WINDING_30)) {
        fit(v_pu, HT_WINDING_30);
        set = sets_of(v_pu);
    }
    st->opposite = (size2 > turn2) && (v3.alpha * v3.beta > cfg->opposite_from);
    other = falling != st->opposite;
    st->falling = !falling;

    t = timing_of(in);
    to.t = &t;
    to.i_A = in->i_A;
    to.found = &found;
    to.ca = out->ca;
    to.instant = toggles->t;
    modulate_set(&to, falling, set.one, zero_sequence(set.first, kappa.one), 0u, 2u, 4u, share.p);
    modulate_set(&to, other, set.two, zero_sequence(set.second, kappa.two), 5u, 1u, 3u, share.p);

    rises = found.moves & ((falling ? 0u : HT_SET1) | (other ? 0u : HT_SET2));
    ht_applied_toggles(applied, in->before, found.high, found.moves, rises);
    applied->mean_pu = ht_vsd_from_six(&share);
    out->start = applied->s[0];
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        out->cb[leg] = t.period;
    }
}
