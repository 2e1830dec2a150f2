#include "ht_interleaved.h"

#include "ht_limited.h"
#include "ht_toggled.h"
#include "ht_vsd.h"

#include <math.h>

#define COS_30 0.866025404f
#define TWO_THIRDS 0.666666667f

/* Positions count from this voltage on, and in full from that one on, squared, units of Vdc. */
#define FROM_PU2 0.0484f
#define FULL_PU2 0.1225f
/* Share of its room that a pulse may move by, on either side of the middle. */
#define ROOM_SHARE 0.45f
/* Half of the way between the rails and a little more: rounding leaves a clamped leg no pulse. */
#define BEYOND_RAIL 0.500001f
/* Weight of the torque's ripple. */
#define WEIGHT 2.0f
/* Of the slope, what one leg in three goes; `pull` gives the slope over 0.75. */
#define SCALE (6.0f * 0.75f / (1.0f + WEIGHT))
/* What a position moves by in a half, at most: down the slope 0.025 at a carrier of 4 kHz. */
#define CAP_HZ 100.0f
#define CAP_MOST 0.06f
/* Where pulses lie at low voltage: their edges are then in the middle of a period. */
#define EARLY 0.125f
/* Below this voltage, squared, units of Vdc, its direction is uncertain, and set 2's carrier keeps its sense:
 * each turn takes three transitions. Clamped legs go with the sense. */
#define TURN_PU2 0.0025f
/* The lag of set 2's carrier behind set 1's. */
#define CARRIER_2 0.25f

/* Legs of a set. The first lies at 0 or 270 degrees, the others 120 and 240 behind. */
static const uint16_t leg_of[2][3] = {{0u, 2u, 4u}, {5u, 1u, 3u}};
static const uint16_t legs_of[2] = {0x2au, 0x15u}; /* as state words */

void ht_interleaved_configure(ht_interleaved_config *cfg, float rho, float f_isr_Hz, float together,
                              float kappa, float kappa_from_pu)
{
    float rho2 = rho * rho;
    float cap = CAP_HZ * HT_CARRIER_PERIODS / f_isr_Hz;
    float carriers = (float)HT_TURN_CARRIERS * ht_between(together, 0.0f, 1.0f) + 0.5f;
    cfg->alike = COS_30 * (1.0f - rho2) / (1.0f + rho2);
    cfg->cap = (cap < CAP_MOST) ? cap : CAP_MOST;
    cfg->together = (uint16_t)carriers;
    cfg->kappa = kappa;
    cfg->kappa_from_pu = kappa_from_pu;
}

bool ht_interleaved_check(const ht_interleaved_config *cfg)
{
    return (fabsf(cfg->alike) <= 1.0f) && (cfg->cap > 0.0f) && (cfg->cap <= CAP_MOST)
           && (cfg->together <= HT_TURN_CARRIERS) && (cfg->kappa >= 0.0f) && (cfg->kappa <= 1.0f)
           && (cfg->kappa_from_pu >= 0.0f); /* NaN is not */
}

void ht_interleaved_reset(ht_interleaved_state *st)
{
    unsigned a;
    unsigned k;
    for (a = 0u; a < 2u; a++) {
        for (k = 0u; k < 3u; k++) {
            st->set[a].half_d[k] = 0.25f;
            st->set[a].delta[k] = 0.0f;
            st->set[a].next[k] = 0u;
        }
        st->set[a].moves = 0u;
    }
    st->steady_pu.alpha = 0.0f;
    st->steady_pu.beta = 0.0f;
    st->carrier = 0u;
    st->together = false;
    st->joined = false;
    st->brief = false;
    st->opposite = false;
    st->quarter = 0u;
    st->turn = 0u;
}

/* `value` within `half` of `centre`, without a comparison. NaN stays. */
static HT_INTO_CALLERS float within(float value, float centre, float half)
{
    float x = value - centre;
    return centre + 0.5f * (fabsf(x + half) - fabsf(x - half));
}

/* Where the legs of a set toggle, share of the half: its commands, with the middle of largest and smallest
 * at half, or, by the share `kappa`, such that one of them is on a rail: below 0 on the lower one. NaN: 0. */
static HT_INTO_CALLERS void shares_of(unsigned a, float sense, ht_ab v, float kappa, float share[3])
{
    float p = sense * ((a == 0u) ? v.alpha : -v.beta);
    float q = sense * (COS_30 * ((a == 0u) ? v.beta : v.alpha));
    float half = fabsf(q);
    float first = 1.5f * p;
    float less = fabsf(first - half);
    float more = fabsf(first + half);
    float zero = 0.5f - 0.25f * (p + (less - more));
    float range = 0.5f * (less + more) + half; /* largest less smallest command */
    bool within_rails = range <= 1.0f;         /* NaN is not */
    float middle;
    if (within_rails && (kappa != 0.0f)) {
        zero += sense * kappa * (BEYOND_RAIL - 0.5f * range);
        within_rails = false;
    }
    middle = zero - 0.5f * p;
    share[0] = zero + p;
    share[1] = middle + q;
    share[2] = middle - q;
    if (!within_rails) {
        unsigned k;
        for (k = 0u; k < 3u; k++) {
            share[k] = ht_between(share[k], 0.0f, 1.0f);
        }
    }
}

/* Twice x where x is above 0, squared. */
static HT_INTO_CALLERS float above2(float x)
{
    float twice = x + fabsf(x);
    return twice * twice;
}

/* By what a pulse wants to be later than another one, whose middle is `ahead` of its own, or behind where
 * `ahead` is negative, at most half a carrier's period; over PULL. d, e: half of their duty ratios. Then this
 * is odd. */
static HT_INTO_CALLERS float pull(float d, float e, float ahead)
{
    float mean = d + e;
    return above2(mean - ahead) - above2(fabsf(d - e) - ahead) - above2(mean - 1.0f + ahead)
           + (ahead - 0.5f) * (32.0f * d * e);
}

/* The same where it is not known which is ahead. */
static HT_INTO_CALLERS float pull_either(float d, float e, float ahead)
{
    float p = pull(d, e, fabsf(ahead));
    return (ahead < 0.0f) ? -p : p;
}

/* Parts of the legs of a set along a vector. */
static HT_INTO_CALLERS void parts(unsigned a, ht_ab v, float part[3])
{
    float p = (a == 0u) ? v.alpha : -v.beta;
    float q = COS_30 * ((a == 0u) ? v.beta : v.alpha);
    part[0] = p;
    part[1] = q - 0.5f * p;
    part[2] = -q - 0.5f * p;
}

/* The slope of J in the position of leg k of set a, downwards. Of the other set's legs the one of the same
 * number lies 90 degrees away, the next one of set 2 30 degrees from a leg of set 1, the third one 150. */
static HT_INTO_CALLERS float slope(const ht_interleaved_config *cfg, const ht_interleaved_state *st,
                                   unsigned a, unsigned k, ht_ab quad)
{
    static const uint16_t after[3] = {1u, 2u, 0u};
    const ht_interleaved_set *own = &st->set[a];
    const ht_interleaved_set *other = &st->set[1u - a];
    float alike = (a == 0u) ? cfg->alike : -cfg->alike;
    float ahead = (a == 0u) ? 1.0f : -1.0f; /* the other set's carrier is, or it is behind */
    float ours[3];
    float theirs[3];
    float torque;
    float d = own->half_d[k];
    float delta = own->delta[k];
    unsigned m = after[k];
    unsigned n = after[m];
    float sum;
    parts(a, quad, ours);
    parts(1u - a, quad, theirs);
    torque = WEIGHT * ours[k];
    sum = (torque * theirs[k])
          * pull(d, other->half_d[k], CARRIER_2 + ahead * (other->delta[k] - delta));
    sum += (alike + torque * theirs[m])
           * pull(d, other->half_d[m], CARRIER_2 + ahead * (other->delta[m] - delta));
    sum += (torque * theirs[n] - alike)
           * pull(d, other->half_d[n], CARRIER_2 + ahead * (other->delta[n] - delta));
    sum *= ahead;
    sum += (torque * ours[m] - 0.5f) * pull_either(d, own->half_d[m], own->delta[m] - delta);
    sum += (torque * ours[n] - 0.5f) * pull_either(d, own->half_d[n], own->delta[n] - delta);
    return SCALE * sum;
}

/* Pattern that is being made. */
typedef struct {
    unsigned high;
    unsigned moves;
    unsigned rises;
    ht_six share; /* of the period that a leg is high */
    float per_count;
    uint16_t end;
    float kappa[2]; /* share of each set's clamped zero sequence */
} making;

/* The common part of a set's legs in a half, in which dead time counts as a share of it. */
typedef struct {
    float sense;        /* 1 falling, -1 rising */
    float at_0;         /* 1 rising, else 0 */
    float doubt;        /* 0 where positions count in full, else 1 */
    float act;          /* share with which positions are optimised */
    float centre;       /* where a pulse lies else, times the rest */
    float room;         /* either side of the middle for a pulse of half a carrier's period */
    float per_half;     /* a carrier's period, in halves */
    float full;         /* counts of the half; of a brief one, one less, so all toggle in it */
    float dead_half;    /* half of the dead time */
    float dead_quarter; /* a quarter of it ... */
    float dead_per_A; /* ... and the same over the current from which it acts fully, to be added */
    uint32_t end;     /* counts of a period */
    uint32_t shortest;
    unsigned now;   /* legs that toggle in the first period ... */
    unsigned later; /* ... in the second one */
    unsigned after; /* legs that are on the half's second level all along the first period */
} half_of;

/* Where a pulse goes: to where it is better, within what its room and the voltage allow. `better` is near
 * `was`, so where positions count in full the room is all that limits it. */
static HT_INTO_CALLERS float placed(const half_of *h, float share, float was, float better)
{
    float room = h->room - ROOM_SHARE * fabsf(share - 0.5f);
    float to = better;
    if (!(fabsf(to) <= (room - h->doubt))) { /* NaN is not */
        room = 0.5f * (room + fabsf(room));
        if (h->doubt > 0.0f) {
            to = within(within(to, h->centre, h->act * room), was, CAP_MOST);
        }
        to = within(to, 0.0f, room);
    }
    return to;
}

/* Counts from a period's begin, the shortest pulse away from its ends. */
static HT_INTO_CALLERS uint32_t away_from_ends(const half_of *h, uint32_t count)
{
    uint32_t most = h->end - h->shortest;
    return (count < h->shortest) ? h->shortest : ((count > most) ? most : count);
}

/* Counts from the half's begin at which a leg toggles, the shortest pulse away from its periods' ends, `at`
 * is a share of the half. 0: it is on its rail before that already, also for NaN; `2 end`: it stays where it
 * starts. */
static HT_INTO_CALLERS uint32_t edge_counts(const half_of *h, float share, float at)
{
    uint32_t end = h->end;
    float counts = ht_between(at, 0.0f, 1.0f) * h->full + 0.5f;
    uint32_t count = (uint32_t)counts;
    if (count < end) {
        return ((2u * count) < h->shortest) ? 0u : away_from_ends(h, count);
    }
    if ((count > (2u * end - h->shortest))
        && ((share >= 1.0f) || (2u * count > (4u * end - h->shortest)))) {
        return 2u * end;
    }
    return end + away_from_ends(h, count - end);
}

/* A leg begins its half. Returns its part of what the flux will be off. */
static HT_INTO_CALLERS float begin_leg(half_of *h, ht_interleaved_set *set, unsigned k,
                                       unsigned leg, const float shares[3], const float better[3],
                                       const float i_A[], making *m, ht_compare *out,
                                       ht_toggles *toggles)
{
    unsigned bit = HT_LEG_U1 >> leg;
    float share = shares[k];
    float was = set->delta[k];
    float delta = placed(h, share, was, better[k]);
    float x = h->dead_per_A * i_A[leg];
    float shift = fabsf(x + h->dead_quarter) - fabsf(x - h->dead_quarter);
    float moved = share * (delta - was) + was;
    float at = share + h->per_half * moved + shift - h->dead_half;
    uint32_t count = edge_counts(h, share, at);
    float first = 1.0f; /* share of the period before the edge */
    out->ca[leg] = m->end;
    toggles->t[leg] = 1.0f;
    set->delta[k] = delta;
    if (count == 0u) {
        h->after |= bit;
        first = 0.0f;
    } else if (count < h->end) {
        h->now |= bit;
        first = (float)count * m->per_count;
        out->ca[leg] = (uint16_t)count;
        toggles->t[leg] = first;
    } else if (count < (2u * h->end)) {
        set->next[k] = (uint16_t)(count - h->end);
        h->later |= bit;
    } else {
        /* stays as long as the half lasts */
    }
    m->share.p[leg] = h->at_0 + h->sense * first;
    return share * delta;
}

/* The half of set `a` begins. */
static HT_INTO_CALLERS ht_ab begin(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                                   unsigned a, const ht_interleaved_command *command,
                                   const ht_modulator_input *in, making *m, ht_compare *out,
                                   ht_toggles *toggles)
{
    ht_interleaved_set *set = &st->set[a];
    const float *i_A = in->i_A->p;
    float share[3];
    float better[3];
    float part[3];
    float p;
    float q;
    ht_ab off;
    half_of h;
    unsigned k;
    float size2 = command->steady_pu.alpha * command->steady_pu.alpha
                  + command->steady_pu.beta * command->steady_pu.beta;
    bool turned = (a == 1u) && st->opposite;
    bool first = st->quarter < 2u;
    bool rising = first != turned;
    float sense = rising ? -1.0f : 1.0f;
    bool brief = (a == 1u) && st->brief;
    float per_period = brief ? 1.0f : (1.0f / HT_HALF_PERIODS); /* halves */
    h.sense = sense;
    h.at_0 = rising ? 1.0f : 0.0f;
    h.act = ht_between((size2 - FROM_PU2) * (1.0f / (FULL_PU2 - FROM_PU2)), 0.0f, 1.0f);
    h.centre = (1.0f - h.act) * EARLY;
    if (st->together) {
        h.centre = (h.act > 0.0f) ? 0.0f : EARLY;
        h.act = 0.0f;
    }
    h.doubt = (h.act < 1.0f) ? 1.0f : 0.0f;
    if (a == 0u) {
        st->steady_pu = command->steady_pu;
    }
    h.end = in->period->counts;
    h.shortest = in->period->shortest;
    h.per_half = HT_CARRIER_PERIODS * per_period;
    h.full = brief ? ((float)h.end - 1.0f) : (HT_HALF_PERIODS * (float)h.end);
    h.dead_half = (0.5f * per_period) * in->dead->dead_pu;
    h.dead_quarter = 0.5f * h.dead_half;
    h.dead_per_A = sense * h.dead_quarter / in->dead->i_zero_A;
    h.room = brief ? 0.0f : (0.5f * ROOM_SHARE - h.dead_half); /* the next pulse is at its middle */
    h.now = 0u;
    h.later = 0u;
    h.after = 0u;
    shares_of(a, sense, command->v_pu, m->kappa[a], share);
    for (k = 0u; k < 3u; k++) {
        float half = 0.5f * share[k];
        set->half_d[k] = rising ? (0.5f - half) : half;
        better[k] = set->delta[k];
    }
    if (h.act > 0.0f) {
        k = st->turn;
        better[k] += ht_limited(slope(cfg, st, a, k, command->quad), cfg->cap);
    }
    /* One by one: what depends on the leg are constants then. */
    part[0] = begin_leg(&h, set, 0u, leg_of[a][0], share, better, i_A, m, out, toggles);
    part[1] = begin_leg(&h, set, 1u, leg_of[a][1], share, better, i_A, m, out, toggles);
    part[2] = begin_leg(&h, set, 2u, leg_of[a][2], share, better, i_A, m, out, toggles);
    set->moves = h.later;
    m->moves |= h.now;
    if (rising) {
        m->rises |= h.now;
        m->high |= h.after;
    } else {
        m->high |= legs_of[a] & ~(h.now | h.after);
    }
    p = sense * ((TWO_THIRDS * HT_CARRIER_PERIODS) * (part[0] - 0.5f * (part[1] + part[2])));
    q = sense * ((TWO_THIRDS * HT_CARRIER_PERIODS * COS_30) * (part[1] - part[2]));
    off.alpha = (a == 0u) ? p : q;
    off.beta = (a == 0u) ? q : -p;
    return off;
}

/* Each set with constants in place of what depends on it, and once in the memory. */
HT_APART static ht_ab begin_set1(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                                 const ht_interleaved_command *command,
                                 const ht_modulator_input *in, making *m, ht_compare *out,
                                 ht_toggles *toggles)
{
    return begin(cfg, st, 0u, command, in, m, out, toggles);
}

HT_APART static ht_ab begin_set2(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                                 const ht_interleaved_command *command,
                                 const ht_modulator_input *in, making *m, ht_compare *out,
                                 ht_toggles *toggles)
{
    return begin(cfg, st, 1u, command, in, m, out, toggles);
}

/* The half of set `b` goes on; if it is over, the legs stay. */
static HT_INTO_CALLERS void go_on(ht_interleaved_state *st, unsigned b, unsigned before, making *m,
                                  ht_compare *out, ht_toggles *toggles)
{
    ht_interleaved_set *set = &st->set[b];
    unsigned moves = set->moves;
    unsigned k;
    for (k = 0u; k < 3u; k++) {
        unsigned leg = leg_of[b][k];
        unsigned bit = HT_LEG_U1 >> leg;
        float first = 1.0f;
        out->ca[leg] = m->end;
        toggles->t[leg] = 1.0f;
        if ((moves & bit) != 0u) {
            first = (float)set->next[k] * m->per_count;
            out->ca[leg] = set->next[k];
            toggles->t[leg] = first;
        }
        m->share.p[leg] = ((before & bit) != 0u) ? first : (1.0f - first);
    }
    m->moves |= moves;
    m->rises |= moves & ~before;
    m->high |= legs_of[b] & before & ~moves;
    set->moves = 0u;
}

unsigned ht_interleaved_begins(const ht_interleaved_config *cfg, ht_interleaved_state *st)
{
    bool was = st->joined;
    if ((st->quarter & 1u) != 0u) {
        st->brief = st->together && !was;
        st->joined = st->together;
        st->opposite = st->opposite && st->together;
        return was ? 0u : 2u;
    }
    if (st->quarter == 0u) {
        st->together = st->carrier < cfg->together;
        st->carrier = (uint16_t)((st->carrier + 1u) % HT_TURN_CARRIERS);
    }
    if (was) { /* set 2 goes on with set 1, or leaves it from the level at which it is */
        st->joined = st->together;
        st->brief = !st->together;
        return 3u;
    }
    if (st->together) {
        st->opposite = ht_modulator_alternating(0.0f, 0.0f, st->steady_pu).opposite;
    }
    return 1u;
}

static HT_INTO_CALLERS void nothing_yet(making *m, const ht_modulator_input *in)
{
    m->high = 0u;
    m->moves = 0u;
    m->rises = 0u;
    m->end = in->period->counts;
    m->per_count = 1.0f / (float)m->end;
    m->kappa[0] = 0.0f;
    m->kappa[1] = 0.0f;
}

static HT_INTO_CALLERS void finish(ht_interleaved_state *st, const making *m,
                                   const ht_modulator_input *in, ht_compare *out,
                                   ht_applied *applied)
{
    unsigned leg;
    if (st->quarter == 3u) {
        st->turn = (st->turn == 2u) ? 0u : (uint16_t)(st->turn + 1u);
    }
    st->quarter = (uint16_t)((st->quarter + 1u) & 3u);
    ht_applied_toggles(applied, in->before, m->high, m->moves, m->rises);
    applied->mean_pu = ht_vsd_from_six(&m->share);
    out->start = applied->s[0];
    for (leg = 0u; leg < (unsigned)HT_LEGS; leg++) {
        out->cb[leg] = m->end;
    }
}

ht_ab ht_interleaved_step(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                          const ht_interleaved_command *command, unsigned a, bool bare,
                          const ht_modulator_input *in, ht_compare *out, ht_applied *applied,
                          ht_toggles *toggles)
{
    unsigned before = bare ? 0u : in->before;
    making m;
    ht_ab off;
    nothing_yet(&m, in);
    if (a == 0u) {
        off = begin_set1(cfg, st, command, in, &m, out, toggles);
        go_on(st, 1u, before, &m, out, toggles);
    } else {
        off = begin_set2(cfg, st, command, in, &m, out, toggles);
        go_on(st, 0u, before, &m, out, toggles);
    }
    finish(st, &m, in, out, applied);
    return off;
}

HT_APART void ht_interleaved_both(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                                  const ht_interleaved_command command[2], bool begins,
                                  const ht_modulator_input *in, ht_ab off_pu[2], ht_compare *out,
                                  ht_applied *applied, ht_toggles *toggles)
{
    making m;
    nothing_yet(&m, in);
    if (begins) {
        if (st->joined) {
            ht_sets sets;
            ht_ab v = command[0].steady_pu;
            sets = ht_modulator_alternating(cfg->kappa, cfg->kappa_from_pu, v);
            if (((v.alpha * v.alpha + v.beta * v.beta) > TURN_PU2) || (sets.kappa[0] != 0.0f)) {
                st->opposite = sets.opposite;
            }
            m.kappa[0] = sets.kappa[0];
            m.kappa[1] = sets.kappa[1];
        }
        off_pu[0] = begin_set1(cfg, st, &command[0], in, &m, out, toggles);
        off_pu[1] = begin_set2(cfg, st, &command[1], in, &m, out, toggles);
    } else {
        go_on(st, 0u, in->before, &m, out, toggles);
        go_on(st, 1u, in->before, &m, out, toggles);
    }
    finish(st, &m, in, out, applied);
}
