#include "ht_derating.h"

#include <math.h>

#define ROOT_2 1.41421356f
/* Current in alpha-beta over the amplitude of the most loaded phase. The amplitude of a phase at phi
 * is |exp(-j phi) - (1 + g)/2 exp(j(4 theta - 5 phi)) - s (1 - g)/2 exp(j 5 phi)| times that current,
 * with s = 1 for a leg of set 1 and -1 for one of set 2. g is the share of the current across the
 * lost leg's axis that flows in x-y, too. */
#define ONE_LEG 0.554700196f  /* g = 0: 2/sqrt(13) */
#define TWO_LEGS 0.577350269f /* 90 degrees apart, g = 1: 1/sqrt(3) */
#define WITHOUT_SET 0.5f

void ht_derating_configure(const ht_params *p, ht_derating_config *c)
{
    const float *v = p->v;
    float sigma;
    c->ls_H = v[HT_P_sigma_ls_H] + v[HT_P_lm_H] * v[HT_P_lm_H] / v[HT_P_lr_H];
    sigma = v[HT_P_sigma_ls_H] / c->ls_H;
    c->rated_A = ROOT_2 * v[HT_P_i_rated_A];
    c->lean = sigma / (1.0f + sigma);
    c->best_Wb_A = c->ls_H * sqrtf(0.5f - c->lean + c->lean * c->lean) / (1.0f - c->lean);
    c->torque_gain = 3.0f * v[HT_P_pole_pairs];
}

float ht_derated_A(const ht_derating_config *c, const ht_lost_legs *lost)
{
    float part = TWO_LEGS;
    if (lost->set) {
        part = WITHOUT_SET;
    } else if (lost->axes == 1u) {
        part = ONE_LEG;
    } else {
        /* as it is */
    }
    return part * c->rated_A;
}

float ht_derated_Wb(const ht_derating_config *c, float i_A)
{
    return c->best_Wb_A * i_A;
}

float ht_derated_Nm(const ht_derating_config *c, float i_A, float flux_Wb)
{
    /* In units of psi/L_s: (q - c)^2 + t^2 = (c - 1)^2 and q^2 + t^2 = i^2. */
    float unit_A = flux_Wb / c->ls_H;
    float i2 = (i_A / unit_A) * (i_A / unit_A);
    float q = 1.0f + c->lean * (i2 - 1.0f);
    float t2 = i2 - q * q;
    return (t2 > 0.0f) ? (c->torque_gain * flux_Wb * unit_A * sqrtf(t2)) : 0.0f;
}
