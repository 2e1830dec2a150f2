#include "ht_device_heat.h"

#include <math.h>

void ht_device_heat_reset(ht_device_heat_state *st)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->rise_K[leg] = 0.0f;
    }
}

void ht_device_heat_step(const ht_device_heat_config *cfg, ht_device_heat_state *st,
                         const float *square_A2, bool powered, float vdc_V)
{
    int leg;
    if (!(cfg->K_W > 0.0f)) {
        ht_device_heat_reset(st);
        return;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        float loss_W = 0.0f;
        if (powered) {
            float i_A = sqrtf(square_A2[leg]);
            loss_W = (cfg->drop_V + cfg->share_V * vdc_V) * i_A + cfg->ohm * square_A2[leg];
        }
        st->rise_K[leg] += cfg->gain * (cfg->K_W * loss_W - st->rise_K[leg]);
    }
}

float ht_device_heat_degC(const ht_device_heat_state *st, float sink_degC)
{
    float most_K = st->rise_K[0];
    int leg;
    for (leg = 1; leg < HT_LEGS; leg++) {
        most_K = (st->rise_K[leg] > most_K) ? st->rise_K[leg] : most_K;
    }
    return sink_degC + most_K;
}
