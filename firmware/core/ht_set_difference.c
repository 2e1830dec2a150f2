#include "ht_set_difference.h"

#include "ht_leg_loss.h"

void ht_set_difference_begin(ht_set_difference *st)
{
    st->power_W = 0.0f;
    st->i2_A2 = 0.0f;
}

void ht_set_difference_learn(const ht_set_difference_config *cfg, ht_set_difference *st, ht_ab i_A,
                             ht_xy low_V, float omega_rad_s, float most_ohm)
{
    /* The vector turns with -omega. The low pass makes it 1/(1 - j turn) of what it was. */
    float turn = HT_LEG_LOSS_FILTER_S * omega_rad_s;
    float power_W = (1.0f + turn * turn) * (low_V.x * i_A.alpha - low_V.y * i_A.beta);
    float i2_A2 = i_A.alpha * i_A.alpha + i_A.beta * i_A.beta;
    st->power_W += cfg->gain * (power_W - st->power_W);
    st->i2_A2 += cfg->gain * (i2_A2 - st->i2_A2);
    if (st->i2_A2 > cfg->least_A2) {
        float ohm = st->ohm + cfg->slow_gain * (st->power_W / st->i2_A2 - st->ohm);
        if ((ohm > -most_ohm) && (ohm < most_ohm)) { /* NaN is not */
            st->ohm = ohm;
        }
    }
}
