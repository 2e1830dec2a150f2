#include "ht_leg_loss.h"

#include "ht_tables.h"

#include <math.h>

#define HARMONIC 6.0f
/* From a ninth of its square on, the sum of a set shows an error that may be a sensor's. Then the
 * residual must be 1.5 times as large. */
#define DOUBTFUL 9.0f
#define CLEAR 2.25f
/* Once it has been large, the residual counts until it is below half of its limit, squared. */
#define STILL_LARGE 0.25f
/* Beyond 0.4 of its smallest limit, squared, the residual may be a small arc's. */
#define MAYBE 0.16f
/* Without a leg the x-y current across its axis is zero, so wrong parameters hardly make a residual
 * there: half of the limit, squared. */
#define WITHOUT_LEG 0.25f
/* The evidence for one switch must exceed that for any other by what a residual of this many
 * limits adds up to in the time `hold`. */
#define ENOUGH 2.5f
/* And by so many times what the residual of a period is, r.m.s.: where wrong parameters make it
 * large, it meets a leg without current by chance. */
#define CHANCE 5.0f
/* Of the limit: what noise and wrong parameters make of a single period's residual. */
#define ROOM 2.0f
/* What a terminal's voltage does to the residual along the leg's axis. */
#define SHARE 0.333333333f
/* A residual is a leg's own if its low pass is within 20 degrees of the leg's axis: square of the
 * cosine. The axes are 30 degrees apart. */
#define OWN 0.883022f
/* The dead leg's share of the current of the leg that has the next least. */
#define DEAD 0.3f

/* One L_xy explains the residual if it leaves less than this share of its square and what noise makes. */
#define UNEXPLAINED 0.05f
/* In the few periods of the evidence the noise of x-y may by chance be twice what the sums show,
 * squared. */
#define NOISY 2.0f
/* But it leaves less than this share in any case. An arc is small, and noise may explain all of it. */
#define MOST_REST 0.2f
/* Noise of the x-y current, both axes, over that of the two sums, squared: x and y have a third of a
 * sensor's each, either sum has three times it. */
#define NOISE_XY 0.111111111f
/* L_xy is learnt all the time only from changes whose square is beyond so many times that of the sums
 * of the sets. Two samples' noise in x-y is 2/9 of that, so L_xy is learnt 11 % too small at most. */
#define LOUD 2.0f
/* A period whose residual is beyond so many times the usual one, squared, may be a lost leg's. */
#define UNUSUAL 4.0f

/* Sums of the phase currents of set 1 and set 2. They are 0 but for what is wrong with the sensors. */
typedef struct {
    float one_A;
    float two_A;
} ht_set_sums;

static ht_set_sums sums_of(const ht_six *i_A)
{
    const float *i = i_A->p;
    ht_set_sums sums;
    sums.one_A = i[0] + i[2] + i[4];
    sums.two_A = i[1] + i[3] + i[5];
    return sums;
}

/* The path of a leg's current during a period. */
typedef enum { FLOWS_IN = -1, NO_FLOW = 0, FLOWS_OUT = 1 } way;

static way way_of(float begin_A, float end_A, float zero_A)
{
    if ((begin_A > zero_A) && (end_A > zero_A)) {
        return FLOWS_OUT;
    }
    return ((begin_A < -zero_A) && (end_A < -zero_A)) ? FLOWS_IN : NO_FLOW;
}

/* How much one period speaks for a lost upper switch. `short_V` is the residual that shows a
 * terminal too low, `low_V` its low pass, and `swing_V` what it would be if the terminal was low for
 * the whole period. `own`: the low pass has the leg's direction.
 *
 * Without the upper switch, current out of the leg flows through the lower diode: the terminal is
 * low, so the residual is `swing_V`. Current into the leg flows as ever: there is no residual. In
 * between the terminal may have any voltage, but the residual is the leg's own. So it is while an
 * arc takes a voltage of any size from the current of a phase that opens. */
static float evidence(way flow, float short_V, float low_V, bool own, float swing_V, float limit_V)
{
    float room_V = ROOM * limit_V - fabsf(short_V);
    float diode_V = 2.0f * short_V - swing_V; /* half of it: neither for nor against */
    switch (flow) {
    case FLOWS_OUT:
        diode_V = (diode_V < swing_V) ? diode_V : swing_V;
        return (own && (low_V > 0.0f) && (short_V > diode_V)) ? short_V : diode_V;
    case FLOWS_IN:
        return (room_V < 0.0f) ? room_V : 0.0f;
    case NO_FLOW:
    default:
        return (own || (short_V < 0.0f)) ? short_V : 0.0f;
    }
}

static float at_least_0(float value)
{
    return (value > 0.0f) ? value : 0.0f; /* NaN: 0 */
}

/* One period's residual and currents. The lower switch is the upper one with all signs turned. */
static void gather(const ht_leg_loss_config *cfg, ht_leg_loss_state *st,
                   const ht_leg_loss_period *in, ht_xy now, float limit_V)
{
    float swing_V = SHARE * in->vdc_V;
    ht_xy low = st->low_V;
    float own2 = OWN * (low.x * low.x + low.y * low.y);
    ht_six high;
    int n;
    ht_applied_high(in->applied, in->toggles, &high);
    for (n = 0; n < HT_LEGS; n++) {
        ht_leg_evidence *leg = &st->leg[n];
        ht_xy b = ht_transform[cfg->winding][n].xy;
        float long_V = 3.0f * (b.x * now.x + b.y * now.y);
        float low_V = 3.0f * (b.x * low.x + b.y * low.y);
        bool own = (low_V * low_V) > own2;
        float end_A = in->end_A->p[n];
        way flow = way_of(in->begin_A->p[n], end_A, cfg->zero_A);
        way turned = way_of(-in->begin_A->p[n], -end_A, cfg->zero_A);
        float swing_high_V = swing_V * high.p[n];
        float upper_V = evidence(flow, -long_V, -low_V, own, swing_high_V, limit_V);
        float lower_V = evidence(turned, long_V, low_V, own, swing_V - swing_high_V, limit_V);
        leg->upper_V = at_least_0(leg->upper_V + upper_V);
        leg->lower_V = at_least_0(leg->lower_V + lower_V);
        leg->sum_A += fabsf(end_A);
    }
}

static void begin(ht_leg_loss_state *st)
{
    static const ht_leg_evidence nothing = {0.0f, 0.0f, 0.0f};
    int leg;
    st->count = 1u;
    st->fit.both_VA = 0.0f;
    st->fit.change_A2 = 0.0f;
    st->fit.residual_V2 = 0.0f;
    st->fit.sums_A2 = 0.0f;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->leg[leg] = nothing;
    }
}

/* The switch for which there is enough evidence, as ht_leg_loss_of explains; 0 if there is none. */
static uint16_t judged(const ht_leg_loss_state *st, float enough_V)
{
    float most_V = 0.0f;
    float next_V = 0.0f;
    unsigned most = 0u;
    unsigned n;
    for (n = 0u; n < HT_SWITCHES; n++) {
        const ht_leg_evidence *leg = &st->leg[n >> 1];
        float size_V = ((n & 1u) != 0u) ? leg->lower_V : leg->upper_V;
        if (size_V > most_V) {
            next_V = most_V;
            most_V = size_V;
            most = n + 1u;
        } else if (size_V > next_V) {
            next_V = size_V;
        } else {
            /* one with less */
        }
    }
    return ((most_V - next_V) > enough_V) ? (uint16_t)most : (uint16_t)0;
}

uint16_t ht_leg_loss_dead(const ht_leg_loss_state *st)
{
    float least = 1.0e30f;
    float next = 1.0e30f;
    uint16_t dead = 0u;
    uint16_t leg;
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        float sum = st->leg[leg].sum_A;
        unsigned bit = HT_LEG_U1 >> leg;
        if ((st->without & bit) != 0u) {
            continue;
        }
        if (sum < least) {
            next = least;
            least = sum;
            dead = (uint16_t)bit;
        } else if (sum < next) {
            next = sum;
        } else {
            /* one with more current */
        }
    }
    return (least < DEAD * next) ? dead : (uint16_t)0;
}

void ht_leg_loss_reset(ht_leg_loss_state *st)
{
    st->low_V.x = 0.0f;
    st->low_V.y = 0.0f;
    st->low_V2 = 0.0f;
    st->low_A2 = 0.0f;
    st->tolerance_ohm2 = 0.0f;
    begin(st);
    st->count = 0u;
    st->wait = 0u;
    st->found = 0u;
    st->without = 0u;
    st->sum_V.x = 0.0f;
    st->sum_V.y = 0.0f;
    st->more_ohm = 0.0f;
    st->learnt = false;
    st->now_V = st->low_V;
    st->change_A.x = 0.0f;
    st->change_A.y = 0.0f;
    st->slow = st->fit;
}

/* Take this much more for L_xy / Ts, if it is within HT_LEG_LOSS_MOST_FACTOR of the parameter. */
static bool take(const ht_leg_loss_config *cfg, ht_leg_loss_state *st, float more_ohm)
{
    float l = cfg->l_per_ts_ohm;
    if (((l + more_ohm) < (HT_LEG_LOSS_MOST_FACTOR * l))
        && ((HT_LEG_LOSS_MOST_FACTOR * (l + more_ohm)) > l)) { /* NaN is not */
        st->more_ohm = more_ohm;
        return true;
    }
    return false;
}

/* A wrong L_xy makes a residual in every period, along the change of the x-y current, in the same
 * proportion. If that explains the residual of all periods, it is learnt.
 *
 * The noise of the sensors is in the change, and L_xy times it in the residual. This is no error of
 * L_xy. How large it is, the sums of the sets show, which would be 0 without it: their change has
 * what is random in six sensors, converter included, and what stays, like an offset, is not in it. */
static bool explained(const ht_leg_loss_config *cfg, ht_leg_loss_state *st)
{
    const ht_leg_loss_fit *fit = &st->fit;
    float noise_A2 = NOISE_XY * fit->sums_A2;
    float l = cfg->l_per_ts_ohm + st->more_ohm;
    float change_A2 = fit->change_A2 - noise_A2;
    float more_ohm;
    float rest_V2;
    if (!(change_A2 > 0.0f)) {
        return false; /* nothing but noise */
    }
    more_ohm = (l * noise_A2 - fit->both_VA) / change_A2;
    rest_V2 = fit->residual_V2 + more_ohm * (2.0f * fit->both_VA + more_ohm * fit->change_A2);
    l += more_ohm;
    return (rest_V2 < (UNEXPLAINED * fit->residual_V2 + NOISY * noise_A2 * l * l))
           && (rest_V2 < (MOST_REST * fit->residual_V2)) && take(cfg, st, st->more_ohm + more_ohm);
}

/* The low pass of the residual is large: `clear2` is its square over that of its limit. The residual
 * itself is `now`. */
static void suspect(const ht_leg_loss_config *cfg, ht_leg_loss_state *st,
                    const ht_leg_loss_period *in, ht_xy now, ht_xy change, float clear2,
                    float limit_V)
{
    ht_set_sums sums = sums_of(in->end_A);
    ht_set_sums was = sums_of(in->begin_A);
    float sum2 = sums.one_A * sums.one_A + sums.two_A * sums.two_A;
    float wrong2 = cfg->sum_A * cfg->sum_A;
    bool doubtful = (DOUBTFUL * sum2 > wrong2) && (clear2 < CLEAR);
    if (!(sum2 < wrong2)) { /* NaN too */
        st->wait = cfg->wait;
    }
    if ((st->wait != 0u) || doubtful) {
        st->count = 0u;
        return;
    }
    if (st->found != 0u) {
        return; /* the first one counts */
    }
    if (st->count == 0u) {
        begin(st);
        st->sum_V.x = st->low_V.x / cfg->gain; /* of the few periods before */
        st->sum_V.y = st->low_V.y / cfg->gain;
    } else {
        st->sum_V.x += now.x;
        st->sum_V.y += now.y;
    }
    gather(cfg, st, in, now, limit_V);
    st->fit.both_VA += now.x * change.x + now.y * change.y;
    st->fit.change_A2 += change.x * change.x + change.y * change.y;
    st->fit.residual_V2 += now.x * now.x + now.y * now.y;
    was.one_A -= sums.one_A;
    was.two_A -= sums.two_A;
    st->fit.sums_A2 += was.one_A * was.one_A + was.two_A * was.two_A;
    if (st->count <= cfg->hold) {
        st->count++;
    } else if (st->without != 0u) {
        st->found = 1u; /* which one, the currents may tell */
    } else {
        float enough_V = ENOUGH * (float)cfg->hold * limit_V;
        float chance_V = CHANCE * sqrtf(st->low_V2);
        uint16_t found = judged(st, (enough_V > chance_V) ? enough_V : chance_V);
        if ((found != 0u) && !st->learnt && explained(cfg, st)) {
            begin(st);
            st->learnt = true;
        } else {
            st->found = found;
        }
    }
}

void ht_leg_loss_step(const ht_leg_loss_config *cfg, ht_leg_loss_state *st,
                      const ht_leg_loss_period *in, ht_xy v_V, ht_xy from, ht_xy to)
{
    float l = cfg->l_per_ts_ohm + st->more_ohm;
    ht_xy change = {to.x - from.x, to.y - from.y};
    float x = in->rs_ohm * to.x + l * change.x - v_V.x;
    float y = in->rs_ohm * to.y + l * change.y - v_V.y;
    float size2;
    float limit2;
    float least2;
    st->now_V.x = x;
    st->now_V.y = y;
    st->change_A = change;
    st->low_V.x += cfg->gain * (x - st->low_V.x);
    st->low_V.y += cfg->gain * (y - st->low_V.y);
    st->low_V2 += cfg->gain * ((x * x + y * y) - st->low_V2);
    st->low_A2 += cfg->gain * ((to.x * to.x + to.y * to.y) - st->low_A2);
    if (st->wait != 0u) {
        st->wait--;
    }
    size2 = st->low_V.x * st->low_V.x + st->low_V.y * st->low_V.y;
    limit2 = cfg->least_V2 + st->tolerance_ohm2 * st->low_A2;
    if (st->without != 0u) {
        limit2 *= WITHOUT_LEG;
    }
    least2 = limit2;
    if ((st->count != 0u) && (st->without == 0u)) {
        least2 *= STILL_LARGE;
    }
    if (size2 > least2) {
        ht_xy now = {x, y};
        suspect(cfg, st, in, now, change, size2 / limit2, sqrtf(limit2));
    } else {
        st->count = 0u;
        st->learnt = false;
    }
}

void ht_leg_loss_learn(const ht_leg_loss_config *cfg, ht_leg_loss_state *st, const ht_six *i_A,
                       float gain)
{
    ht_leg_loss_fit *fit = &st->slow;
    ht_set_sums sums = sums_of(i_A);
    float sums_A2 = sums.one_A * sums.one_A + sums.two_A * sums.two_A;
    ht_xy v = st->now_V;
    ht_xy i = st->change_A;
    float residual_V2 = v.x * v.x + v.y * v.y;
    float most_V2 = UNUSUAL * fit->residual_V2 + cfg->least_V2;
    float change_A2 = i.x * i.x + i.y * i.y;
    float shows_ohm = HT_LEG_LOSS_TOLERANCE * cfg->l_per_ts_ohm;
    bool usual = residual_V2 < most_V2; /* NaN is not */
    if ((st->count != 0u) || (st->without != 0u)) {
        return;
    }
    fit->residual_V2 += gain * ((usual ? residual_V2 : most_V2) - fit->residual_V2);
    if (!usual) {
        return;
    }
    /* The residual as it would be if nothing had been learnt. */
    fit->both_VA += gain * ((v.x * i.x + v.y * i.y - st->more_ohm * change_A2) - fit->both_VA);
    fit->change_A2 += gain * (change_A2 - fit->change_A2);
    fit->sums_A2 += gain * (sums_A2 - fit->sums_A2);
    if (((shows_ohm * shows_ohm * fit->change_A2) > cfg->least_V2)
        && (fit->change_A2 > (LOUD * fit->sums_A2))) {
        (void)take(cfg, st, -fit->both_VA / fit->change_A2);
    }
}

void ht_leg_loss_tolerate(ht_leg_loss_state *st, float rs_ohm, float lxy_H, float omega_rad_s)
{
    float harmonic = HARMONIC * omega_rad_s;
    float reactance = lxy_H * harmonic;
    float filter = HT_LEG_LOSS_FILTER_S * harmonic;
    st->tolerance_ohm2 = HT_LEG_LOSS_TOLERANCE * HT_LEG_LOSS_TOLERANCE
                         * (rs_ohm * rs_ohm + reactance * reactance / (1.0f + filter * filter));
}

bool ht_leg_loss_maybe(const ht_leg_loss_config *cfg, const ht_leg_loss_state *st)
{
    ht_xy low = st->low_V;
    bool beyond = (cfg->least_V2 > 0.0f)
                  && ((low.x * low.x + low.y * low.y) > (MAYBE * cfg->least_V2));
    return beyond || (st->count != 0u);
}

ht_leg_loss ht_leg_loss_of(uint16_t found)
{
    ht_leg_loss loss;
    unsigned place = (unsigned)found - 1u;
    loss.leg = (uint16_t)(place >> 1);
    loss.lower = (place & 1u) != 0u;
    return loss;
}
