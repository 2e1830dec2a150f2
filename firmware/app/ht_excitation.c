#include "ht_excitation.h"

#include "ht_faults.h"
#include "ht_limited.h"
#include "ht_tables.h"

#include <math.h>

#define TWO_PI_F 6.28318531f
/* Leg voltage against the middle of the dc link, units of Vdc: pulses and gaps keep 5 % of the
 * period, or more if the shortest pulse is longer. */
#define MOST_PU 0.45f
/* Least counts from the write, or the period's begin, to the first edge, and from the last one to
 * the period's end. */
#define ROOM_COUNTS 3.0f

/* Cosine and sine of an angle within +-pi/2. With additions and products only, every processor gives
 * the same bits. */
static void cosine_and_sine(float angle, float *cosine, float *sine)
{
    float x = angle * angle;
    float c = 1.0f / 40320.0f - x * (1.0f / 3628800.0f);
    float s = -1.0f / 5040.0f + x * (1.0f / 362880.0f);
    c = -1.0f / 720.0f + x * c;
    c = 1.0f / 24.0f + x * c;
    c = -1.0f / 2.0f + x * c;
    s = 1.0f / 120.0f + x * s;
    s = -1.0f / 6.0f + x * s;
    *cosine = 1.0f + x * c;
    *sine = angle * (1.0f + x * s);
}

void ht_excitation_configure(const ht_params *p, ht_excitation_config *c)
{
    const float *v = p->v;
    float most_Hz = 0.25f * v[HT_P_f_isr_Hz];
    float ticks;
    float hertz = ht_limited(v[HT_P_test_Hz], most_Hz);
    c->winding = ht_winding_of(v);
    c->wave = (ht_wave)(uint16_t)v[HT_P_test_wave];
    c->ab_V.alpha = v[HT_P_test_alpha_V];
    c->ab_V.beta = v[HT_P_test_beta_V];
    c->xy_V.x = v[HT_P_test_x_V];
    c->xy_V.y = v[HT_P_test_y_V];
    cosine_and_sine(TWO_PI_F * hertz / v[HT_P_f_isr_Hz], &c->turn_cos, &c->turn_sin);
    c->current_A = v[HT_P_test_current_A];
    c->travel_counts = v[HT_P_test_travel_rev] * v[HT_P_encoder_counts_rev];
    ticks = v[HT_P_test_s] * v[HT_P_f_isr_Hz];
    c->ticks = (uint32_t)ticks;
}

void ht_excitation_reset(ht_excitation_state *st, uint32_t position)
{
    int leg;
    ht_excitation_begin(st);
    st->on = false;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->rest[leg] = 0.0f;
    }
    st->position = position;
}

void ht_excitation_begin(ht_excitation_state *st)
{
    st->on = true;
    st->wave_cos = 1.0f;
    st->wave_sin = 0.0f;
}

uint16_t ht_excitation_faults(const ht_excitation_config *c, const ht_excitation_state *st,
                              const ht_six *i_A, uint32_t position)
{
    uint32_t counts = position - st->position;
    float moved = fabsf((float)(int32_t)counts);
    unsigned faults = 0u;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        if (!(fabsf(i_A->p[leg]) < c->current_A)) {
            faults |= HT_FAULT_OVERCURRENT;
        }
    }
    if (moved > c->travel_counts) {
        faults |= HT_FAULT_OVERSPEED;
    }
    return (uint16_t)faults;
}

/* The vector at the wave's present angle, V. */
static ht_vsd vector(const ht_excitation_config *c, const ht_excitation_state *st)
{
    ht_vsd v = {{0.0f, 0.0f}, {0.0f, 0.0f}};
    float ab = 1.0f;
    float xy = 1.0f;
    if (!st->on) {
        return v;
    }
    v.ab = c->ab_V;
    v.xy = c->xy_V;
    if (c->wave == HT_WAVE_ROTATE) {
        v.ab.alpha = st->wave_cos * c->ab_V.alpha - st->wave_sin * c->ab_V.beta;
        v.ab.beta = st->wave_sin * c->ab_V.alpha + st->wave_cos * c->ab_V.beta;
    } else if (st->wave_cos < 0.0f) {
        ab = (c->wave == HT_WAVE_SQUARE_XY) ? 1.0f : -1.0f;
        xy = (c->wave == HT_WAVE_SQUARE_AB) ? 1.0f : -1.0f;
    } else {
        /* the first half-wave's signs are those of the parameters */
    }
    v.ab.alpha *= ab;
    v.ab.beta *= ab;
    v.xy.x *= xy;
    v.xy.y *= xy;
    return v;
}

/* The angle of the next sample. The size is kept at 1: (3 - size^2)/2 is 1/size near 1. */
static void turn(const ht_excitation_config *c, ht_excitation_state *st)
{
    float cosine = st->wave_cos * c->turn_cos - st->wave_sin * c->turn_sin;
    float sine = st->wave_sin * c->turn_cos + st->wave_cos * c->turn_sin;
    float scale = 1.5f - 0.5f * (cosine * cosine + sine * sine);
    st->wave_cos = scale * cosine;
    st->wave_sin = scale * sine;
}

void ht_excitation_step(const ht_excitation_config *c, ht_excitation_state *st, float vdc_V,
                        const ht_period *period, ht_compare *out)
{
    ht_vsd v = vector(c, st);
    float full = (float)period->counts;
    float per_V = (vdc_V > 0.0f) ? (1.0f / vdc_V) : 0.0f;
    float first = (float)period->first;
    float centre = 0.5f * (full + first); /* the pulse lies behind the write */
    float room = first + 2.0f * ROOM_COUNTS;
    float shortest = (float)period->shortest + 1.0f; /* rounded down to whole counts */
    float most = 0.5f - ((room > shortest) ? room : shortest) / full;
    int leg;
    most = (most < MOST_PU) ? most : MOST_PU;
    out->start = 0u;
    for (leg = 0; leg < HT_LEGS; leg++) {
        /* The inverse of the transform is three times its transpose. */
        const ht_vsd *column = &ht_transform[c->winding][leg];
        float leg_pu = 3.0f * per_V
                       * (column->ab.alpha * v.ab.alpha + column->ab.beta * v.ab.beta
                          + column->xy.x * v.xy.x + column->xy.y * v.xy.y);
        float length; /* of the pulse */
        uint16_t whole;
        length = full * (0.5f + ht_limited(leg_pu, most)) + st->rest[leg];
        whole = (uint16_t)(length + 0.5f);
        st->rest[leg] = length - (float)whole;
        out->ca[leg] = (uint16_t)(centre - 0.5f * (float)whole);
        out->cb[leg] = (uint16_t)(out->ca[leg] + whole);
    }
    if (st->on) {
        turn(c, st);
    }
}
