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
/* Of the slope, the share that one leg in three goes. */
#define SLOPE 6.0f
/* What a position moves by in a half, at most: 0.025 at a carrier of 4 kHz. */
#define CAP_HZ 100.0f
#define CAP_MOST 0.06f
/* Where pulses lie at low voltage: their edges are then in the middle of a period. */
#define EARLY 0.125f
/* Beyond this share pulses of set 2 go to the other side. */
#define CARRIER_2 0.25f

/* Legs of a set. The first lies at 0 or 270 degrees, the others 120 and 240 behind. */
static const uint16_t leg_of[2][3] = {{0u, 2u, 4u}, {5u, 1u, 3u}};
static const ht_ab direction[2][3] = {
    {{1.0f, 0.0f}, {-0.5f, COS_30}, {-0.5f, -COS_30}},
    {{0.0f, -1.0f}, {COS_30, 0.5f}, {-COS_30, 0.5f}},
};
/* Of two legs of different sets: +1 where 30 degrees lie between, -1 where 150 do, 0 where 90 do. */
static const float sense[3][3] = {
    {0.0f, 1.0f, -1.0f}, {-1.0f, 0.0f, 1.0f}, {1.0f, -1.0f, 0.0f}};

void ht_interleaved_configure(ht_interleaved_config *cfg, float weight, float rho, float f_isr_Hz,
                              float in_phase)
{
    float rho2 = rho * rho;
    float cap = CAP_HZ * HT_CARRIER_PERIODS / f_isr_Hz;
    cfg->weight = weight;
    cfg->alike = COS_30 * (1.0f - rho2) / (1.0f + rho2);
    cfg->cap = (cap < CAP_MOST) ? cap : CAP_MOST;
    cfg->early[0] = EARLY;
    cfg->early[1] = EARLY - 2.0f * EARLY * in_phase;
}

bool ht_interleaved_check(const ht_interleaved_config *cfg)
{
    return (cfg->weight >= 0.0f) && (cfg->weight < 1.0e3f) && (fabsf(cfg->alike) <= 1.0f)
           && (cfg->cap > 0.0f) && (cfg->cap <= CAP_MOST) && (fabsf(cfg->early[0]) <= EARLY)
           && (fabsf(cfg->early[1]) <= EARLY); /* NaN is not */
}

void ht_interleaved_reset(ht_interleaved_state *st)
{
    unsigned a;
    unsigned k;
    for (a = 0u; a < 2u; a++) {
        for (k = 0u; k < 3u; k++) {
            st->set[a].d[k] = 0.5f;
            st->set[a].delta[k] = 0.0f;
            st->set[a].next[k] = 0u;
        }
        st->set[a].moves = 0u;
    }
    st->quarter = 0u;
    st->turn = 0u;
}

/* Duty ratios of a set: its commands, with the middle of largest and smallest at half. NaN: 0. */
static HT_INTO_CALLERS void duties(unsigned a, ht_ab v, float d[3])
{
    float p = (a == 0u) ? v.alpha : -v.beta;
    float q = COS_30 * ((a == 0u) ? v.beta : v.alpha);
    float half = fabsf(q);
    float above = fabsf(1.5f * p + half);
    float below = fabsf(1.5f * p - half);
    float zero = 0.5f - 0.25f * (p + (below - above));
    float middle = zero - 0.5f * p;
    d[0] = ht_between(zero + p, 0.0f, 1.0f);
    d[1] = ht_between(middle + q, 0.0f, 1.0f);
    d[2] = ht_between(middle - q, 0.0f, 1.0f);
}

/* x squared where x is above 0. */
static HT_INTO_CALLERS float above2(float x)
{
    return (x > 0.0f) ? (x * x) : 0.0f;
}

/* By what two pulses of the duty ratios d and e, whose middles are `apart`, want to change their distance.
 * `apart`: -1 .. 1. */
static HT_INTO_CALLERS float pull(float d, float e, float apart)
{
    float y = apart + ((apart < 0.0f) ? 0.5f : -0.5f);
    float size = fabsf(y) - 0.5f;
    float differ = 0.5f * fabsf(d - e);
    float mean = 0.5f * (d + e);
    float p = 3.0f
              * (above2(size + mean) - above2(size + differ) - above2(mean - 1.0f - size)
                 - 2.0f * (size + 0.5f) * d * e);
    return (y < 0.0f) ? -p : p;
}

/* The slope of J in the position of leg k of set a, downwards. */
static HT_INTO_CALLERS float slope(const ht_interleaved_config *cfg, const ht_interleaved_state *st,
                                   unsigned a, unsigned k, ht_ab quad)
{
    const ht_interleaved_set *own = &st->set[a];
    const ht_interleaved_set *other = &st->set[1u - a];
    ht_ab e = direction[a][k];
    float torque = cfg->weight * (e.alpha * quad.alpha + e.beta * quad.beta);
    float d = own->d[k];
    float delta = own->delta[k];
    float behind = (a == 0u) ? (delta - CARRIER_2) : (delta + CARRIER_2);
    float sum = 0.0f;
    unsigned n;
    for (n = 0u; n < 3u; n++) {
        ht_ab f = direction[1u - a][n];
        float s = (a == 0u) ? sense[k][n] : sense[n][k];
        float weight = cfg->alike * s + torque * (f.alpha * quad.alpha + f.beta * quad.beta);
        sum += weight * pull(d, other->d[n], behind - other->delta[n]);
        if (n != k) {
            f = direction[a][n];
            weight = torque * (f.alpha * quad.alpha + f.beta * quad.beta) - 0.5f;
            sum += weight * pull(d, own->d[n], delta - own->delta[n]);
        }
    }
    return sum / (1.0f + cfg->weight);
}

/* Counts from the half's begin at which a leg toggles. 0: it is on its rail before that already; all:
 * it stays where it starts. */
static HT_INTO_CALLERS uint32_t edge_counts(float at, const ht_period *p)
{
    float full = (float)p->counts;
    float whole = HT_HALF_PERIODS * full;
    float half_shortest = 0.5f * (float)p->shortest;
    float counts = at * full + 0.5f;
    uint32_t count;
    uint32_t end = p->counts;
    uint32_t shortest = p->shortest;
    uint32_t least;
    if (!(counts > half_shortest)) { /* NaN is not */
        return 0u;
    }
    if (counts > (whole - half_shortest)) {
        return 2u * end;
    }
    count = (uint32_t)counts;
    least = (count < end) ? 0u : end;
    if (count < (least + shortest)) {
        count = least + shortest;
    }
    if ((count + shortest) > (least + end)) {
        count = least + end - shortest;
    }
    return count;
}

/* Pattern that is being made. */
typedef struct {
    unsigned high;
    unsigned moves;
    unsigned rises;
    ht_six share; /* of the period that a leg is high */
    float per_count;
    uint16_t end;
} making;

static HT_INTO_CALLERS void stays(making *m, unsigned leg, bool high, ht_compare *out,
                                  ht_toggles *toggles)
{
    m->high |= high ? (HT_LEG_U1 >> leg) : 0u;
    m->share.p[leg] = high ? 1.0f : 0.0f;
    out->ca[leg] = m->end;
    toggles->t[leg] = 1.0f;
}

static HT_INTO_CALLERS void toggles_at(making *m, unsigned leg, uint16_t count, bool rising,
                                       ht_compare *out, ht_toggles *toggles)
{
    unsigned bit = HT_LEG_U1 >> leg;
    float t = (float)count * m->per_count;
    m->moves |= bit;
    m->rises |= rising ? bit : 0u;
    m->share.p[leg] = rising ? (1.0f - t) : t;
    out->ca[leg] = count;
    toggles->t[leg] = t;
}

/* Where a pulse goes: where it was, improved, within what its room and the voltage allow. */
static HT_INTO_CALLERS float placed(const ht_interleaved_config *cfg, float d, float delta,
                                    float better, float act, float early, float dead)
{
    float least = (d < 0.5f) ? d : (1.0f - d);
    float room = ROOM_SHARE * least - 0.25f * dead;
    float wanted = (1.0f - act) * early;
    float around = act * room;
    float to = ht_between(better, wanted - around, wanted + around);
    room = (room > 0.0f) ? room : 0.0f;
    return ht_limited(ht_between(to, delta - cfg->cap, delta + cfg->cap), room);
}

/* The half of set `a` begins. */
static HT_INTO_CALLERS ht_ab begin(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                                   unsigned a, const ht_interleaved_command *command,
                                   const ht_modulator_input *in, making *m, ht_compare *out,
                                   ht_toggles *toggles)
{
    ht_interleaved_set *set = &st->set[a];
    bool rising = st->quarter < 2u;
    float dead = in->dead->dead_pu;
    float half_per_A = 0.5f * dead / in->dead->i_zero_A;
    float act = ht_between((command->steady2 - FROM_PU2) * (1.0f / (FULL_PU2 - FROM_PU2)), 0.0f,
                           1.0f);
    unsigned own = st->turn;
    float better;
    float d[3];
    ht_ab off = {0.0f, 0.0f};
    unsigned k;
    duties(a, command->v_pu, d);
    set->d[0] = d[0];
    set->d[1] = d[1];
    set->d[2] = d[2];
    better = set->delta[own];
    if (act > 0.0f) {
        better += ht_limited(SLOPE * slope(cfg, st, a, own, command->quad), cfg->cap);
    }
    set->moves = 0u;
    for (k = 0u; k < 3u; k++) {
        unsigned leg = leg_of[a][k];
        float was = set->delta[k];
        float low = 1.0f - d[k];
        float delta =
            placed(cfg, d[k], was, (k == own) ? better : was, act, cfg->early[a], dead);
        float shift = ht_limited(half_per_A * in->i_A->p[leg], 0.5f * dead);
        float moved = rising ? (low * delta + d[k] * was) : (d[k] * delta + low * was);
        float at = HT_HALF_PERIODS * (rising ? low : d[k]) + HT_CARRIER_PERIODS * moved
                   + (rising ? -shift : shift) - 0.5f * dead;
        float c = rising ? -low : d[k];
        uint32_t count = edge_counts(at, in->period);
        if (!(d[k] > 0.0f)) {
            count = rising ? (2u * (uint32_t)m->end) : 0u;
        } else if (d[k] >= 1.0f) {
            count = rising ? 0u : (2u * (uint32_t)m->end);
        } else {
            /* between the rails */
        }
        set->delta[k] = delta;
        off.alpha += c * delta * direction[a][k].alpha;
        off.beta += c * delta * direction[a][k].beta;
        if ((count == 0u) || (count >= 2u * (uint32_t)m->end)) {
            stays(m, leg, rising == (count == 0u), out, toggles);
        } else if (count < m->end) {
            toggles_at(m, leg, (uint16_t)count, rising, out, toggles);
        } else {
            set->next[k] = (uint16_t)(count - m->end);
            set->moves |= HT_LEG_U1 >> leg;
            stays(m, leg, !rising, out, toggles);
        }
    }
    off.alpha *= TWO_THIRDS * HT_CARRIER_PERIODS;
    off.beta *= TWO_THIRDS * HT_CARRIER_PERIODS;
    return off;
}

/* The half of set `b` goes on. */
static HT_INTO_CALLERS void go_on(ht_interleaved_state *st, unsigned b, unsigned before, making *m,
                                  ht_compare *out, ht_toggles *toggles)
{
    ht_interleaved_set *set = &st->set[b];
    unsigned k;
    for (k = 0u; k < 3u; k++) {
        unsigned leg = leg_of[b][k];
        unsigned bit = HT_LEG_U1 >> leg;
        if ((set->moves & bit) != 0u) {
            toggles_at(m, leg, set->next[k], (before & bit) == 0u, out, toggles);
        } else {
            stays(m, leg, (before & bit) != 0u, out, toggles);
        }
    }
    set->moves = 0u;
}

ht_ab ht_interleaved_step(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                          const ht_interleaved_command *command, bool bare,
                          const ht_modulator_input *in, ht_compare *out, ht_applied *applied,
                          ht_toggles *toggles)
{
    unsigned a = st->quarter & 1u;
    unsigned before = bare ? 0u : in->before;
    ht_ab off;
    making m;
    unsigned leg;
    m.high = 0u;
    m.moves = 0u;
    m.rises = 0u;
    m.end = in->period->counts;
    m.per_count = 1.0f / (float)m.end;
    off = begin(cfg, st, a, command, in, &m, out, toggles);
    go_on(st, 1u - a, before, &m, out, toggles);
    if (st->quarter == 3u) {
        st->turn = (st->turn == 2u) ? 0u : (uint16_t)(st->turn + 1u);
    }
    st->quarter = (uint16_t)((st->quarter + 1u) & 3u);
    ht_applied_toggles(applied, in->before, m.high, m.moves, m.rises);
    applied->mean_pu = ht_vsd_from_six(&m.share);
    out->start = applied->s[0];
    for (leg = 0u; leg < (unsigned)HT_LEGS; leg++) {
        out->cb[leg] = m.end;
    }
    return off;
}
