#include "ht_heat.h"

static void begin(ht_heat_state *st)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->sum_A2[leg] = 0.0f;
    }
    st->frame_sum_W = 0.0f;
    st->summed = 0.0f;
}

/* The low passes are the fast interrupt's. */
static void cool(ht_heat_state *st)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->rise_K[leg] = 0.0f;
    }
    st->frame_rise_K = 0.0f;
    begin(st);
}

void ht_heat_reset(ht_heat_state *st)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->square_A2[leg] = 0.0f;
    }
    cool(st);
}

/* Both bodies at once, from the means of the losses since the latest step. */
static void step(const ht_heat_config *cfg, ht_heat_state *st)
{
    float mean = 1.0f / st->summed;
    float frame_K = st->frame_rise_K;
    float above_K = 0.0f;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        float rise_K = st->rise_K[leg];
        float loss_W = (cfg->ohm + cfg->ohm_per_K * rise_K) * st->sum_A2[leg] * mean;
        above_K += rise_K - frame_K;
        st->rise_K[leg] += cfg->per_W_K * loss_W - cfg->to_frame * (rise_K - frame_K);
    }
    st->frame_rise_K += cfg->frame_per_W_K * st->frame_sum_W * mean + cfg->frame_per_rise * above_K
                        - cfg->to_ambient * frame_K;
}

void ht_heat_step(const ht_heat_config *cfg, ht_heat_state *st, bool powered, float frame_W)
{
    if (!(cfg->steps > 0.0f)) {
        cool(st);
        return;
    }
    if (powered) {
        int leg;
        for (leg = 0; leg < HT_LEGS; leg++) {
            st->sum_A2[leg] += st->square_A2[leg];
        }
        st->frame_sum_W += frame_W;
    }
    st->summed += 1.0f;
    if (st->summed >= cfg->steps) {
        step(cfg, st);
        begin(st);
    }
}

float ht_heat_winding_degC(const ht_heat_config *cfg, const ht_heat_state *st)
{
    float most_K = st->rise_K[0];
    int leg;
    for (leg = 1; leg < HT_LEGS; leg++) {
        most_K = (st->rise_K[leg] > most_K) ? st->rise_K[leg] : most_K;
    }
    return cfg->ambient_degC + most_K;
}

float ht_heat_share(const ht_heat_config *cfg, float winding_degC)
{
    if (!(cfg->steps > 0.0f) || (winding_degC <= cfg->limit_degC)) {
        return 1.0f;
    }
    if (winding_degC >= cfg->trip_degC) {
        return 0.0f;
    }
    return (cfg->trip_degC - winding_degC) / (cfg->trip_degC - cfg->limit_degC);
}
