#include "ht_short_circuit.h"

#include "ht_limited.h"
#include "ht_magnet.h"

#include <math.h>

#define PI_F 3.14159265f
/* Shares of the ceiling at which it begins and ends. Below the first the magnets' voltage with all its
 * harmonics stays under the link's by what a speed changes between two slow interrupts. */
#define BEGINS 0.95f
#define ENDS HT_CLEAR_OF_CEILING
/* Time for which the short circuit lasts at least: the current's first direct part has decayed. */
#define HOLD_S 0.05f
/* Time constants: of the current's frequency; of a speed that the encoder no longer shows. */
#define STEPS_S 0.01f
#define FAST_S 0.05f

void ht_short_circuit_configure(const ht_params *p, ht_short_circuit_config *c)
{
    const float *v = p->v;
    float ticks = HOLD_S * v[HT_P_f_isr_Hz];
    c->allowed = (v[HT_P_machine] != 0.0f) && (v[HT_P_trip_state] != 0.0f);
    c->rad_s_per_V =
        1.0f / ht_magnet_terminal_Wb(v[HT_P_psi_f_Wb], v[HT_P_emf5_share], v[HT_P_emf7_share]);
    c->vdc_min_V = v[HT_P_vdc_min_V];
    c->vdc_max_V = v[HT_P_vdc_max_V];
    c->most_A2 = v[HT_P_magnets_bear_A] * v[HT_P_magnets_bear_A];
    c->ts_s = 1.0f / v[HT_P_f_isr_Hz];
    c->gain = 1.0f / (1.0f + STEPS_S * v[HT_P_f_isr_Hz]);
    c->decay = 1.0f / (1.0f + FAST_S * v[HT_P_f_slow_Hz]);
    c->hold = (uint32_t)ticks;
}

void ht_short_circuit_reset(ht_short_circuit_state *st)
{
    st->barred = 0u;
    st->fast_rad_s = 0.0f;
    ht_short_circuit_ends(st);
}

void ht_short_circuit_ends(ht_short_circuit_state *st)
{
    st->on = 0u;
    st->off = 0u;
    st->ticks = 0u;
}

void ht_short_circuit_follow(const ht_short_circuit_config *cfg, ht_short_circuit_state *st,
                             float omega_rad_s)
{
    float now = fabsf(omega_rad_s);
    float later = st->fast_rad_s + cfg->decay * (now - st->fast_rad_s);
    st->fast_rad_s = (now > later) ? now : later; /* NaN does not stay */
}

/* Speed at which the magnets induce the link's voltage. A link without a source must not keep the short
 * circuit until the shaft stands, nor a wrong sensor prevent it. */
float ht_short_circuit_ceiling_rad_s(const ht_short_circuit_config *cfg, float vdc_V)
{
    return cfg->rad_s_per_V * ht_between(vdc_V, cfg->vdc_min_V, cfg->vdc_max_V);
}

/* Follow the steps that the current makes from period to period: a direct part does not show in them. */
static void look(const ht_short_circuit_config *cfg, ht_short_circuit_state *st, ht_ab i_A)
{
    ht_ab step = {i_A.alpha - st->i_A.alpha, i_A.beta - st->i_A.beta};
    float cross = st->step_A.alpha * step.beta - st->step_A.beta * step.alpha;
    float square = step.alpha * step.alpha + step.beta * step.beta;
    float gain = (st->ticks > 2u) ? cfg->gain : 0.0f;
    st->cross_A2 += gain * (cross - st->cross_A2);
    st->square_A2 += gain * (square - st->square_A2);
    st->step_A = step;
    st->i_A = i_A;
}

/* Does the current turn more slowly than this? Two successive steps are the angle of a period apart. */
static bool turns_slower(const ht_short_circuit_config *cfg, const ht_short_circuit_state *st,
                         float omega_rad_s)
{
    float turn = ht_limited(omega_rad_s * cfg->ts_s, 0.5f * PI_F);
    float sine = turn * (1.0f - turn * turn * (1.0f / 6.0f));
    return fabsf(st->cross_A2) < (sine * st->square_A2);
}

bool ht_short_circuit_beyond(const ht_short_circuit_config *cfg, ht_ab i_A)
{
    return !((i_A.alpha * i_A.alpha + i_A.beta * i_A.beta) <= cfg->most_A2);
}

bool ht_short_circuit_step(const ht_short_circuit_config *cfg, ht_short_circuit_state *st,
                           const ht_short_circuit_input *in)
{
    float ceiling = ht_short_circuit_ceiling_rad_s(cfg, in->vdc_V);
    float omega = fabsf(in->omega_rad_s);
    bool off = st->off != 0u;
    bool slow;
    st->off = 1u;
    if (st->on != 0u) {
        st->ticks++;
        look(cfg, st, in->i_A);
        slow = (st->ticks > cfg->hold) && turns_slower(cfg, st, ENDS * ceiling)
               && (in->encoder_doubtful || (omega < ENDS * ceiling));
    } else {
        slow = !(omega > BEGINS * ceiling) && !(st->fast_rad_s > BEGINS * ceiling);
    }
    if (in->forbidden || (slow && (st->on != 0u) && in->encoder_doubtful)) {
        st->barred = 1u; /* nor does a doubtful encoder begin it again */
    } else if (omega < ENDS * ceiling) {
        st->barred = 0u;
    } else {
        /* as it was */
    }
    if (!cfg->allowed || slow || (st->barred != 0u)) {
        st->on = 0u;
    } else if (off && (st->on == 0u)) {
        st->on = 1u;
        st->ticks = 0u;
        st->i_A = in->i_A;
        st->step_A.alpha = 0.0f;
        st->step_A.beta = 0.0f;
        st->cross_A2 = 0.0f;
        st->square_A2 = 0.0f;
    } else {
        /* as it was */
    }
    return st->on != 0u;
}
