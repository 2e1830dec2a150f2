#include "ht_control.h"

#include "ht_comparator.h"

#include <math.h>

#define BUILD_DIRECTION 0u

ht_vsd ht_vsd_from_six(const ht_six *s)
{
    ht_vsd v = {{0.0f, 0.0f}, {0.0f, 0.0f}};
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        const ht_vsd *column = &ht_transform[leg];
        v.ab.alpha += column->ab.alpha * s->p[leg];
        v.ab.beta += column->ab.beta * s->p[leg];
        v.xy.x += column->xy.x * s->p[leg];
        v.xy.y += column->xy.y * s->p[leg];
    }
    return v;
}

static bool positive(float value)
{
    return (value > 0.0f) && (value < 1.0e30f); /* NaN and infinity are not */
}

ht_config_status ht_control_check(const ht_control_config *cfg)
{
    uint16_t levels = cfg->torque_levels;
    if (((unsigned)cfg->scheme >= HT_SCHEMES) || ((unsigned)cfg->table > 1u)
        || ((levels != 2u) && (levels != 3u) && (levels != 5u))) {
        return HT_CONFIG_SCHEME;
    }
    if ((cfg->period_counts < 8u) || (cfg->first_counts >= (uint16_t)(cfg->period_counts / 2u))
        || (cfg->shadow && (cfg->first_counts != 0u)) || !positive(cfg->observer.ts_s)
        || !(cfg->dead.dead_pu >= 0.0f) || !(cfg->dead.dead_pu <= 0.5f)) {
        return HT_CONFIG_TIMING;
    }
    if (((unsigned)cfg->observer.kind >= HT_OBSERVERS) || !(cfg->observer.rs_ohm >= 0.0f) || !positive(cfg->observer.sigma_ls_H)
        || !positive(cfg->observer.inv_sigma_ls) || !positive(cfg->observer.lxy_H)
        || !(cfg->observer.rotor_decay >= 0.0f) || !(cfg->observer.rotor_decay < 0.5f)) {
        return HT_CONFIG_MACHINE;
    }
    return HT_CONFIG_OK;
}

static void rest(ht_applied *a)
{
    a->before = 0u;
    a->s[0] = 0u;
    a->s[1] = 0u;
    a->s[2] = 0u;
    a->t[0] = 0.0f;
    a->t[1] = 0.0f;
    a->t[2] = 0.0f;
}

void ht_control_low_pattern(const ht_control_config *cfg, ht_compare *out)
{
    int leg;
    out->start = 0u;
    for (leg = 0; leg < HT_LEGS; leg++) {
        out->ca[leg] = cfg->period_counts;
        out->cb[leg] = cfg->period_counts;
    }
}

void ht_control_reset(const ht_control_config *cfg, ht_control_state *st, const ht_six *i_A)
{
    ht_vsd i = ht_vsd_from_six(i_A);
    ht_observer_reset(&cfg->observer, &st->observer, &i);
    ht_xy_reset(&st->xy);
    rest(&st->active);
    rest(&st->next);
    st->spill.legs = 0u;
    st->i_prev_A = *i_A;
    st->estimate.psi_Wb = st->observer.psi_Wb;
    st->estimate.torque_Nm = 0.0f;
    st->estimate.psi_xy_Wb.x = 0.0f;
    st->estimate.psi_xy_Wb.y = 0.0f;
    st->decided = st->estimate;
    st->v_xy_pu.x = 0.0f;
    st->v_xy_pu.y = 0.0f;
    st->torque_level = 0;
    st->flux_level = 1;
    st->sector = 0u;
}

static ht_vsd volts(ht_vsd v_pu, float vdc_V)
{
    v_pu.ab.alpha *= vdc_V;
    v_pu.ab.beta *= vdc_V;
    v_pu.xy.x *= vdc_V;
    v_pu.xy.y *= vdc_V;
    return v_pu;
}

/* What the devices keep of the voltage: each leg loses the threshold against its
 * current. Around zero, where the device law is steep and ripple changes the sign, a
 * share of it, as for the dead time. */
static void subtract_drops(const ht_control_config *cfg, const ht_six *from, const ht_six *to,
                           ht_vsd *v)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        const ht_vsd *column = &ht_transform[leg];
        float share = cfg->dead.inv_2i_zero * (from->p[leg] + to->p[leg]);
        float drop = cfg->drop_V
                     * ((share > 1.0f) ? 1.0f : ((share < -1.0f) ? -1.0f : share));
        v->ab.alpha -= column->ab.alpha * drop;
        v->ab.beta -= column->ab.beta * drop;
        v->xy.x -= column->xy.x * drop;
        v->xy.y -= column->xy.y * drop;
    }
}

/* Observe the period that ended and, if asked, look one period ahead. */
static void observe(const ht_control_config *cfg, ht_control_state *st, const ht_control_input *in,
                    const ht_vsd *i)
{
    ht_vsd v = volts(ht_volt_seconds(&st->active, &cfg->dead, &st->i_prev_A, &in->i_A, &st->spill),
                     in->vdc_V);
    if (cfg->drop_V > 0.0f) {
        subtract_drops(cfg, &st->i_prev_A, &in->i_A, &v);
    }
    st->estimate = ht_observer_update(&cfg->observer, &st->observer, &v, i, in->turn_rad,
                                      in->inv_flux_ref2);
    st->i_prev_A = in->i_A;
    if (cfg->shadow) {
        st->active = st->next;
    }
    if (cfg->predict) {
        ht_spill spill = st->spill;
        v = volts(ht_volt_seconds(&st->next, &cfg->dead, &in->i_A, &in->i_A, &spill), in->vdc_V);
        if (cfg->drop_V > 0.0f) {
            subtract_drops(cfg, &in->i_A, &in->i_A, &v);
        }
        st->decided = ht_observer_predict(&cfg->observer, &st->observer, &st->estimate, &v, i);
    } else {
        st->decided = st->estimate;
    }
}

/* Comparator outputs for the decided state. */
static void compare_levels(const ht_control_config *cfg, ht_control_state *st,
                           const ht_control_input *in, float psi_Wb)
{
    float error = in->torque_ref_Nm - st->decided.torque_Nm;
    int16_t last = st->torque_level;
    if (cfg->torque_levels == 5u) {
        last = ht_compare_five_level(last, error, cfg->torque_inner_Nm, cfg->torque_band_Nm);
    } else if (cfg->torque_levels == 3u) {
        last = ht_compare_three_level(last, error, cfg->torque_band_Nm, cfg->torque_release_Nm);
    } else {
        last = ht_compare_two_level(last, error, cfg->torque_band_Nm, -1, 1);
    }
    st->torque_level = last;
    st->flux_level =
        ht_compare_two_level(st->flux_level, in->flux_ref_Wb - psi_Wb, cfg->flux_band_Wb, 0, 1);
}

/* Virtual vector k of a group: three consecutive vectors (paper A, Table II). */
static void virtual_vector(unsigned group, unsigned k, uint16_t s[3])
{
    s[0] = ht_group[group][(k + HT_DIRECTIONS - 1u) % HT_DIRECTIONS];
    s[1] = ht_group[group][k];
    s[2] = ht_group[group][(k + 1u) % HT_DIRECTIONS];
}

static void single_vector(uint16_t word, uint16_t s[3])
{
    s[0] = word;
    s[1] = word;
    s[2] = word;
}

static uint16_t zero_vector(const ht_control_config *cfg, const ht_control_state *st)
{
    return cfg->only_v0 ? (uint16_t)0 : ht_nearest_zero[st->active.s[2]];
}

/* Of two vectors that point the same way in alpha-beta and opposite ways in x-y,
 * the one that drives psi_xy down (paper B, Table III): `strong` pushes along
 * the large vector's x-y direction, the medium-large one against it. */
static uint16_t pair_choice(unsigned strong, unsigned k, ht_xy psi_xy)
{
    ht_xy along = ht_vector[ht_group[HT_L][k]].xy;
    bool grows = (along.x * psi_xy.x + along.y * psi_xy.y) > 0.0f;
    return ht_group[grows ? (unsigned)HT_ML : strong][k];
}


/* State words and action points for direction k at torque level +-1 or +-2. */
static ht_action_points choose(const ht_control_config *cfg, const ht_control_state *st, unsigned k,
                               bool full_level, uint16_t s[3])
{
    ht_xy none = {0.0f, 0.0f};
    ht_action_points whole = {1.0f, 1.0f};
    switch (cfg->scheme) {
    case HT_DTC1:
        single_vector(ht_group[HT_L][k], s);
        return whole;
    case HT_DTC2:
        single_vector(pair_choice(HT_L, k, st->decided.psi_xy_Wb), s);
        return whole;
    case HT_DTC3:
        single_vector(pair_choice(full_level ? HT_L : HT_S, k, st->decided.psi_xy_Wb), s);
        return whole;
    case HT_DDR:
        virtual_vector(HT_L, k, s);
        return ht_duty(HT_L, k, st->v_xy_pu);
    case HT_DDR_ML:
        virtual_vector(HT_ML, k, s);
        return ht_duty(HT_ML, k, st->v_xy_pu);
    case HT_FDR:
    default:
        virtual_vector(HT_L, k, s);
        return ht_duty(HT_L, k, none);
    }
}

/* Turn the choice into registers and remember what the legs will do. */
static void commit(const ht_control_config *cfg, ht_control_state *st, const uint16_t s[3],
                   ht_action_points p, ht_compare *out)
{
    uint16_t before = st->active.s[2];
    ht_applied *target = cfg->shadow ? &st->next : &st->active;
    ht_pattern_counts(s, p, cfg->period_counts, cfg->first_counts, out, target);
    target->before = before;
}

static void regulate_xy(const ht_control_config *cfg, ht_control_state *st, ht_xy i_xy,
                        float psi_Wb, bool zero)
{
    float inverse = (psi_Wb > 0.0f) ? (1.0f / psi_Wb) : 0.0f;
    ht_ab turn = {st->decided.psi_Wb.alpha * inverse, st->decided.psi_Wb.beta * inverse};
    float limit = ht_tmvcl_pu[(cfg->scheme == HT_DDR_ML) ? HT_ML : HT_L];
    st->v_xy_pu = ht_xy_step(&cfg->xy, &st->xy, i_xy, turn, limit, zero && cfg->hold_on_zero);
}

void ht_control_step(const ht_control_config *cfg, ht_control_state *st, const ht_control_input *in,
                     ht_compare *out)
{
    ht_vsd i = ht_vsd_from_six(&in->i_A);
    ht_action_points p = {1.0f, 1.0f};
    uint16_t s[3];
    bool zero;
    bool raise;
    float psi_Wb;

    observe(cfg, st, in, &i);
    psi_Wb = sqrtf(st->decided.psi_Wb.alpha * st->decided.psi_Wb.alpha
                   + st->decided.psi_Wb.beta * st->decided.psi_Wb.beta);
    compare_levels(cfg, st, in, psi_Wb);
    st->sector = (uint16_t)ht_sector(st->decided.psi_Wb);
    zero = st->torque_level == 0;
    /* Under a zero vector the flux decays with R_s i; at low speed and light load
     * that can last until the machine is lost. */
    raise = zero && (cfg->flux_hold > 0.0f)
            && (psi_Wb < (1.0f - cfg->flux_hold) * in->flux_ref_Wb);
    zero = zero && !raise;

    if ((cfg->scheme == HT_DDR) || (cfg->scheme == HT_DDR_ML)) {
        regulate_xy(cfg, st, i.xy, psi_Wb, zero);
    } else {
        st->v_xy_pu.x = 0.0f;
        st->v_xy_pu.y = 0.0f;
    }
    if (zero) {
        single_vector(zero_vector(cfg, st), s);
    } else if (raise) {
        /* Along the flux, 15 degrees to the side the torque wants. */
        bool ahead = in->torque_ref_Nm > st->decided.torque_Nm;
        p = choose(cfg, st, ht_direction_along(st->sector, ahead), false, s);
    } else {
        unsigned k = ht_direction(cfg->table, st->sector, st->torque_level > 0, st->flux_level > 0);
        bool full_level = (st->torque_level == 2) || (st->torque_level == -2);
        p = choose(cfg, st, k, full_level, s);
    }
    commit(cfg, st, s, p, out);
}

void ht_control_build_step(const ht_control_config *cfg, ht_control_state *st,
                           const ht_control_input *in, ht_compare *out)
{
    ht_vsd i = ht_vsd_from_six(&in->i_A);
    ht_xy none = {0.0f, 0.0f};
    ht_action_points p = {1.0f, 1.0f};
    uint16_t s[3];
    float limit2 = cfg->build_current_A * cfg->build_current_A;
    float i2 = i.ab.alpha * i.ab.alpha + i.ab.beta * i.ab.beta;
    float psi2;

    observe(cfg, st, in, &i);
    psi2 = st->decided.psi_Wb.alpha * st->decided.psi_Wb.alpha
           + st->decided.psi_Wb.beta * st->decided.psi_Wb.beta;
    st->sector = (uint16_t)ht_sector(st->decided.psi_Wb);
    if ((i2 < limit2) && (psi2 < in->flux_ref_Wb * in->flux_ref_Wb)) {
        virtual_vector(HT_L, BUILD_DIRECTION, s);
        p = ht_duty(HT_L, BUILD_DIRECTION, none);
    } else {
        single_vector(zero_vector(cfg, st), s);
    }
    commit(cfg, st, s, p, out);
}
