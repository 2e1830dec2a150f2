#include "ht_ntc.h"

#include "port.h"

#define KELVIN_0_DEGC 273.15f
#define KELVIN_25_DEGC 298.15f
#define LN_2 0.69314718f
#define ROOT_2 1.41421356f
/* Time constant of the readings' low pass, against noise, and for how long a reading may tell nothing. */
#define LOW_PASS_S 0.1f
#define PATIENCE_S 0.1f
#define LEAST_PATIENCE 3.0f
#define HIGHEST ((uint16_t)((uint16_t)HT_ADC_FULL - (uint16_t)HT_NTC_END_COUNTS))
/* Hotter than any: 1/T does not become 0 or less. */
#define LEAST_PER_K 0.001f

/* So often a positive number is halved or doubled at most: beyond 2^64 there is no thermistor. */
#define MOST_HALVES 64u

/* Natural logarithm of a positive number, within 1e-7: the same bits on every processor. */
static float logarithm(float of)
{
    float x = of;
    float halves = 0.0f;
    float z;
    float z2;
    uint16_t k;
    for (k = 0u; k < MOST_HALVES; k++) {
        if (x > ROOT_2) {
            x *= 0.5f;
            halves += 1.0f;
        } else if (x < (0.5f * ROOT_2)) {
            x *= 2.0f;
            halves -= 1.0f;
        } else {
            break;
        }
    }
    z = (x - 1.0f) / (x + 1.0f);
    z2 = z * z;
    return LN_2 * halves + 2.0f * z * (1.0f + z2 * (0.33333333f + z2 * (0.2f + z2 * 0.14285714f)));
}

void ht_ntc_reset(ht_ntc_state *st)
{
    st->counts = 0.0f;
    st->missed = 0.0f;
    st->degC = 0.0f;
}

void ht_ntc_configure(ht_ntc_config *c, float ohm, float beta_K, float pull_up_ohm,
                      float readings_Hz)
{
    float patience = PATIENCE_S * readings_Hz;
    c->pull_share = (ohm > 0.0f) ? (pull_up_ohm / ohm) : 0.0f;
    c->per_K = 1.0f / beta_K;
    c->gain = 1.0f / (1.0f + LOW_PASS_S * readings_Hz);
    c->patience = (patience > LEAST_PATIENCE) ? patience : LEAST_PATIENCE;
}

float ht_ntc_degC(const ht_ntc_config *cfg, float counts)
{
    float share = cfg->pull_share * counts / ((float)HT_ADC_FULL - counts);
    float per_K = 1.0f / KELVIN_25_DEGC + cfg->per_K * logarithm(share);
    return 1.0f / ((per_K > LEAST_PER_K) ? per_K : LEAST_PER_K) - KELVIN_0_DEGC;
}

bool ht_ntc_reaches(const ht_ntc_config *cfg, float hot_degC)
{
    return (ht_ntc_degC(cfg, (float)HT_NTC_END_COUNTS) >= hot_degC)
           && (ht_ntc_degC(cfg, (float)HIGHEST) <= (float)HT_NTC_COLD_DEGC);
}

ht_ntc ht_ntc_take(const ht_ntc_config *cfg, ht_ntc_state *st, uint16_t reading)
{
    if ((reading >= (uint16_t)HT_NTC_END_COUNTS) && (reading <= HIGHEST)) {
        float counts = (float)reading;
        bool first = !(st->counts > 0.0f);
        st->missed = 0.0f;
        st->counts = first ? counts : (st->counts + cfg->gain * (counts - st->counts));
        st->degC = ht_ntc_degC(cfg, st->counts);
    } else if (st->missed < cfg->patience) {
        st->missed += 1.0f;
    } else {
        return (reading > HIGHEST) ? HT_NTC_OPEN : HT_NTC_SHORT;
    }
    return HT_NTC_WHOLE;
}

bool ht_ntc_tells(const ht_ntc_config *cfg, const ht_ntc_state *st)
{
    return (cfg->pull_share > 0.0f) && (st->counts > 0.0f);
}
