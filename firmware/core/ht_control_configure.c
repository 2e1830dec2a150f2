/* The configuration of the control: choice of the law, what follows from it, checks. Each switch over the laws
 * has a case for every row of ht_laws.def; no law is named here. */
#include "ht_control.h"

#include "ht_winding.h"

#include <stddef.h>

static bool positive(float value)
{
    return (value > 0.0f) && (value < 1.0e30f); /* NaN and infinity are not */
}

/* The choices of the scheme's row. */
static void law_select(ht_control_config *cfg, const ht_scheme_info *row)
{
    cfg->law = row->law;
    cfg->patterns = false;
    switch (row->law) {
#define HT_VECTOR_LAW(id, law)                                    \
    case HT_LAW_##id:                                             \
        ht_##law##_law_select(&cfg->law##_law, row);              \
        cfg->needs_xy = ht_##law##_law_needs_xy(&cfg->law##_law); \
        break;
#define HT_VOLTAGE_LAW(id, law) \
    case HT_LAW_##id:           \
        cfg->needs_xy = true;   \
        break;
#define HT_PATTERN_LAW(id, law) \
    case HT_LAW_##id:           \
        cfg->needs_xy = true;   \
        cfg->patterns = true;   \
        break;
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        break;
    }
}

/* Every law that commands a voltage: prediction, sampling, and what the law says of its own
 * configuration. */
static ht_config_status voltage_law_check(const ht_control_config *cfg, bool own)
{
    if (!(cfg->shadow && cfg->predict)) {
        return HT_CONFIG_PREDICTION;
    }
    if (!ht_voltage_law_fast_enough(&cfg->observer)) {
        return HT_CONFIG_SAMPLING;
    }
    return (own && ht_modulator_check(&cfg->modulator)) ? HT_CONFIG_OK : HT_CONFIG_SCHEME;
}

/* Can the law work with this configuration? */
static ht_config_status law_check(const ht_control_config *cfg)
{
    ht_config_status status = HT_CONFIG_LAW;
    switch (cfg->law) {
#define HT_VECTOR_LAW(id, law)                                                            \
    case HT_LAW_##id:                                                                     \
        status = ht_##law##_law_check(&cfg->law##_law) ? HT_CONFIG_OK : HT_CONFIG_SCHEME; \
        break;
#define HT_VOLTAGE_LAW(id, law)                                                 \
    case HT_LAW_##id:                                                           \
        status = voltage_law_check(cfg, ht_##law##_law_check(&cfg->law##_law)); \
        break;
#define HT_PATTERN_LAW HT_VOLTAGE_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        break;
    }
    return status;
}

static bool period_fits(const ht_control_config *cfg)
{
    const ht_period *p = &cfg->period;
    float dead_counts = cfg->dead.dead_pu * (float)p->counts;
    return (p->counts >= 8u) && (p->first < (uint16_t)(p->counts / 2u))
           && (!cfg->shadow || (p->first == 0u)) && (p->shortest >= 1u)
           && (p->shortest <= (uint16_t)((p->counts - p->first) / 2u))
           && (dead_counts < ((float)p->shortest + 1.0f)); /* NaN is not */
}

void ht_control_select(ht_control_config *cfg, ht_scheme scheme)
{
    const ht_scheme_info *row = ht_scheme_describe((uint16_t)scheme);
    cfg->scheme = scheme;
    if (row != NULL) {
        law_select(cfg, row);
    }
}

void ht_control_configure(ht_control_config *cfg, const ht_law_setting *given)
{
    switch (cfg->law) {
#define HT_VECTOR_LAW(id, law)                                             \
    case HT_LAW_##id:                                                      \
        ht_##law##_law_configure(&cfg->law##_law, given, &cfg->modulator); \
        break;
#define HT_VOLTAGE_LAW HT_VECTOR_LAW
#define HT_PATTERN_LAW HT_VECTOR_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        break;
    }
    ht_modulator_wind(&cfg->modulator, cfg->observer.winding);
    cfg->special = cfg->patterns || (cfg->observer.rotor != HT_ROTOR_PLAIN)
                   || (cfg->observer.winding != HT_WINDING_30);
}

float ht_control_reach_pu(const ht_control_config *cfg)
{
    float reach_pu = ht_scheme_describe((uint16_t)cfg->scheme)->reach_pu;
    switch (cfg->law) {
#define HT_VECTOR_LAW(id, law)                                         \
    case HT_LAW_##id:                                                  \
        reach_pu = ht_##law##_law_reach_pu(&cfg->law##_law, reach_pu); \
        break;
#define HT_VOLTAGE_LAW(id, law)
#define HT_PATTERN_LAW HT_VOLTAGE_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        break;
    }
    if ((cfg->observer.winding != HT_WINDING_30) && (reach_pu > HT_REACH_ALIKE_PU)) {
        reach_pu = HT_REACH_ALIKE_PU;
    }
    return reach_pu;
}

float ht_control_left_pu(const ht_control_config *cfg)
{
    float left_pu = ht_control_reach_pu(cfg);
    switch (cfg->law) {
#define HT_VECTOR_LAW(id, law)                             \
    case HT_LAW_##id:                                      \
        left_pu = ht_##law##_law_left_pu(&cfg->law##_law); \
        break;
#define HT_VOLTAGE_LAW(id, law)
#define HT_PATTERN_LAW HT_VOLTAGE_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        break;
    }
    return (left_pu < HT_REACH_ALIKE_PU) ? left_pu : HT_REACH_ALIKE_PU;
}

ht_config_status ht_control_check(const ht_control_config *cfg)
{
    if (ht_scheme_describe((uint16_t)cfg->scheme) == NULL) {
        return HT_CONFIG_SCHEME;
    }
    if (!period_fits(cfg) || !positive(cfg->observer.ts_s) || !(cfg->dead.dead_pu >= 0.0f)
        || !(cfg->dead.dead_pu <= 0.5f) || !positive(cfg->dead.i_zero_A)) {
        return HT_CONFIG_TIMING;
    }
    if (((unsigned)cfg->observer.kind >= HT_OBSERVERS)
        || ((unsigned)cfg->observer.winding >= HT_WINDINGS)
        || ((unsigned)cfg->observer.rotor >= (unsigned)HT_ROTORS) || !(cfg->observer.rs_ohm >= 0.0f)
        || !positive(cfg->observer.sigma_ls_H) || !positive(cfg->observer.inv_sigma_ls)
        || !positive(cfg->observer.lxy_H) || !(cfg->observer.rotor_decay >= 0.0f)
        || !(cfg->observer.rotor_decay < 0.5f)) {
        return HT_CONFIG_MACHINE;
    }
    return law_check(cfg);
}
