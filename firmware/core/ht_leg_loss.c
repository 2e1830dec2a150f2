#include "ht_leg_loss.h"

#include "ht_switching.h"

#include <math.h>

#define HARMONIC 6.0f
#define NOTHING 0.02f /* of all legs' currents together: no current */
/* From a ninth of its square on, the sum of a set shows an error that may be a sensor's. Then the
 * residual must be 1.5 times as large. */
#define DOUBTFUL 9.0f
#define CLEAR 2.25f

/* The currents of this period. */
static void add_currents(ht_leg_loss_state *st, const float *i)
{
    int n;
    for (n = 0; n < HT_LEGS; n++) {
        st->all_A += fabsf(i[n]);
    }
    st->leg_A += fabsf(i[ht_leg_loss_of(st->direction).leg]);
}

static void begin_currents(ht_leg_loss_state *st)
{
    st->count = 1u;
    st->leg_A = 0.0f;
    st->all_A = 0.0f;
}

void ht_leg_loss_reset(ht_leg_loss_state *st)
{
    st->low_V.x = 0.0f;
    st->low_V.y = 0.0f;
    st->low_A2 = 0.0f;
    st->tolerance_ohm2 = 0.0f;
    st->direction = 0u;
    st->count = 0u;
    st->leg_A = 0.0f;
    st->all_A = 0.0f;
    st->wait = 0u;
    st->found = 0u;
    st->off = false;
    st->sum_V.x = 0.0f;
    st->sum_V.y = 0.0f;
}

/* The low pass of the residual is large: `clear2` is its square over that of its limit. The residual
 * itself is `now`. */
static void suspect(const ht_leg_loss_config *cfg, ht_leg_loss_state *st, const ht_six *i_A,
                    ht_xy now, float clear2)
{
    const float *i = i_A->p;
    ht_ab points = {st->low_V.x, st->low_V.y};
    uint16_t direction = (uint16_t)ht_sector(points);
    float one = i[0] + i[2] + i[4];
    float two = i[1] + i[3] + i[5];
    float sum2 = one * one + two * two;
    float wrong2 = cfg->sum_A * cfg->sum_A;
    bool doubtful = (DOUBTFUL * sum2 > wrong2) && (clear2 < CLEAR);
    if (!(sum2 < wrong2)) { /* NaN too */
        st->wait = cfg->wait;
    }
    if ((st->wait != 0u) || doubtful) {
        st->count = 0u;
        return;
    }
    if ((st->count == 0u) || (direction != st->direction)) {
        begin_currents(st);
        st->direction = direction;
        st->sum_V.x = st->low_V.x / cfg->gain; /* of the few periods before */
        st->sum_V.y = st->low_V.y / cfg->gain;
        return;
    }
    if (st->found == 0u) {
        st->sum_V.x += now.x;
        st->sum_V.y += now.y;
    }
    if (st->count <= cfg->hold) {
        add_currents(st, i);
        st->count++;
    } else if (!st->off && !(st->leg_A < cfg->sum_A + NOTHING * st->all_A)) {
        begin_currents(st); /* the leg carries current */
    } else if (st->found == 0u) {
        st->found = (uint16_t)(direction + 1u);
    } else {
        /* the first one counts */
    }
}

void ht_leg_loss_step(const ht_leg_loss_config *cfg, ht_leg_loss_state *st, ht_xy v_V, ht_xy from,
                      ht_xy to, const ht_six *i_A, float rs_ohm)
{
    float l = cfg->l_per_ts_ohm;
    float x = rs_ohm * to.x + l * (to.x - from.x) - v_V.x;
    float y = rs_ohm * to.y + l * (to.y - from.y) - v_V.y;
    float size2;
    float limit2;
    st->low_V.x += cfg->gain * (x - st->low_V.x);
    st->low_V.y += cfg->gain * (y - st->low_V.y);
    st->low_A2 += cfg->gain * ((to.x * to.x + to.y * to.y) - st->low_A2);
    if (st->wait != 0u) {
        st->wait--;
    }
    size2 = st->low_V.x * st->low_V.x + st->low_V.y * st->low_V.y;
    limit2 = cfg->least_V2 + st->tolerance_ohm2 * st->low_A2;
    if (size2 > limit2) {
        ht_xy now = {x, y};
        suspect(cfg, st, i_A, now, size2 / limit2);
    } else {
        st->count = 0u;
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

ht_leg_loss ht_leg_loss_of(uint16_t direction)
{
    /* Five times the phases' angles: u1 0, u2 150, w1 240, w2 30, v1 120, v2 270 degrees. */
    static const ht_leg_loss loss[HT_SECTORS] = {
        {0u, true},  {3u, true},  {2u, false}, {5u, false}, {4u, true},  {1u, true},
        {0u, false}, {3u, false}, {2u, true},  {5u, true},  {4u, false}, {1u, false},
    };
    return loss[direction];
}
