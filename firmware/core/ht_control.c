#include "ht_control.h"

#include "ht_comparator.h"

#include <math.h>

#define BUILD_DIRECTION 0u

#define THIRD 0.333333333f
#define SIXTH 0.166666667f
#define COS_30_THIRD 0.288675135f

ht_vsd ht_vsd_from_six(const ht_six *s)
{
    float u1 = s->p[0];
    float u2 = s->p[1];
    float w1 = s->p[2];
    float w2 = s->p[3];
    float v1 = s->p[4];
    float v2 = s->p[5];
    /* The columns of ht_transform come in pairs of the same size: alpha and x are sum
     * and difference of two parts, so are beta and y. */
    float even = THIRD * u1 - SIXTH * (w1 + v1);
    float odd = COS_30_THIRD * (u2 - w2);
    float cross = COS_30_THIRD * (w1 - v1);
    float along = SIXTH * (u2 + w2) - THIRD * v2;
    ht_vsd v;
    v.ab.alpha = even + odd;
    v.ab.beta = along + cross;
    v.xy.x = even - odd;
    v.xy.y = along - cross;
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
        || ((levels != 2u) && (levels != 3u) && (levels != 5u)) || !positive(cfg->xy_limit_pu)) {
        return HT_CONFIG_SCHEME;
    }
    if ((cfg->period_counts < 8u) || (cfg->first_counts >= (uint16_t)(cfg->period_counts / 2u))
        || (cfg->shadow && (cfg->first_counts != 0u)) || !positive(cfg->observer.ts_s)
        || !(cfg->dead.dead_pu >= 0.0f) || !(cfg->dead.dead_pu <= 0.5f)
        || !positive(cfg->dead.i_zero_A)) {
        return HT_CONFIG_TIMING;
    }
    if (((unsigned)cfg->observer.kind >= HT_OBSERVERS) || !(cfg->observer.rs_ohm >= 0.0f) || !positive(cfg->observer.sigma_ls_H)
        || !positive(cfg->observer.inv_sigma_ls) || !positive(cfg->observer.lxy_H)
        || !(cfg->observer.rotor_decay >= 0.0f) || !(cfg->observer.rotor_decay < 0.5f)) {
        return HT_CONFIG_MACHINE;
    }
    return HT_CONFIG_OK;
}

/* All low, no edge. */
static void rest(ht_applied *a, const ht_dead_time *dead)
{
    int n;
    for (n = 0; n < 3; n++) {
        a->s[n] = 0u;
        a->t[n] = (n == 0) ? 0.0f : 1.0f;
    }
    ht_applied_finish(a, 0u, dead);
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
    ht_observer_reset(&cfg->observer, &st->observer, i.ab);
    ht_xy_reset(&st->xy);
    rest(&st->active, &cfg->dead);
    rest(&st->next, &cfg->dead);
    st->spill.legs = 0u;
    st->i_prev_A = *i_A;
    st->flow_prev = ht_flow_of(i_A, &cfg->dead);
    st->estimate.psi_Wb = st->observer.psi_Wb;
    st->estimate.torque_Nm = 0.0f;
    st->decided = st->estimate;
    st->i_xy_A = i.xy;
    st->psi_xy_Wb.x = 0.0f;
    st->psi_xy_Wb.y = 0.0f;
    st->v_xy_pu.x = 0.0f;
    st->v_xy_pu.y = 0.0f;
    st->torque_level = 0;
    st->flux_level = 1;
    st->sector = 0u;
}

/* Less what the devices keep: each leg loses the threshold against its current. Around
 * zero, where the device law is steep and ripple changes the sign, a share of it, as
 * for the dead time. */
static ht_vsd less_drops(const ht_control_config *cfg, const ht_six *from, const ht_six *to,
                         ht_vsd v)
{
    float per_A = 0.5f / cfg->dead.i_zero_A;
    ht_six drop;
    ht_vsd lost;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        float share = per_A * (from->p[leg] + to->p[leg]);
        drop.p[leg] = cfg->drop_V
                      * ((share > 1.0f) ? 1.0f : ((share < -1.0f) ? -1.0f : share));
    }
    lost = ht_vsd_from_six(&drop);
    v.ab.alpha -= lost.ab.alpha;
    v.ab.beta -= lost.ab.beta;
    v.xy.x -= lost.xy.x;
    v.xy.y -= lost.xy.y;
    return v;
}

/* Mean voltage under a pattern, from currents `from` to `to`. */
static inline ht_vsd voltage(const ht_control_config *cfg, const ht_applied *a, ht_flow flow,
                             const ht_six *from, const ht_six *to, float vdc_V,
                             const ht_spill *left, ht_spill *over, bool xy)
{
    ht_vsd v = ht_volt_seconds(a, &cfg->dead, flow, from, to, left, over, xy);
    v.ab.alpha *= vdc_V;
    v.ab.beta *= vdc_V;
    if (xy) {
        v.xy.x *= vdc_V;
        v.xy.y *= vdc_V;
    }
    return (cfg->drop_V > 0.0f) ? less_drops(cfg, from, to, v) : v;
}

/* Does the scheme choose between vectors by their effect on the x-y flux? */
static bool chooses_pairs(const ht_control_config *cfg)
{
    return (cfg->scheme == HT_DTC2) || (cfg->scheme == HT_DTC3);
}

/* Observe the period that ended and, if asked, look one period ahead. */
static void observe(const ht_control_config *cfg, ht_control_state *st, const ht_control_input *in,
                    ht_vsd i)
{
    ht_flow now = {0u, 0u};
    ht_flow then;
    ht_estimate estimate;
    ht_vsd v;
    /* Where the currents flow is asked for by edges, all of which are known under shadow
     * load. (A leg of which it is not known is looked at edge by edge.) */
    if (!cfg->shadow || ((st->active.later | st->next.rising | st->next.falling) != 0u)) {
        now = ht_flow_of(&in->i_A, &cfg->dead);
    }
    then = ht_flow_at_edges(&st->active, st->flow_prev, now);
    v = voltage(cfg, &st->active, then, &st->i_prev_A, &in->i_A, in->vdc_V, &st->spill, &st->spill,
                false);
    estimate = ht_observer_update(&cfg->observer, &st->observer, v.ab, i.ab, in->turn_rad,
                                  in->inv_flux_ref2);
    st->estimate = estimate;
    st->i_xy_A.x = i.xy.x;
    st->i_xy_A.y = i.xy.y;
    st->i_prev_A = in->i_A;
    st->flow_prev = now;
    if (cfg->shadow) {
        st->active = st->next;
    }
    if (cfg->predict) {
        bool xy = chooses_pairs(cfg);
        ht_spill over; /* of no interest */
        v = voltage(cfg, &st->next, now, &in->i_A, &in->i_A, in->vdc_V, &st->spill, &over, xy);
        st->decided = ht_observer_predict(&cfg->observer, &st->observer, estimate, v.ab, i.ab);
        if (xy) {
            st->psi_xy_Wb = ht_observer_predict_xy(&cfg->observer, &st->observer, v.xy, i.xy);
        }
    } else {
        st->decided = estimate;
        st->psi_xy_Wb.x = cfg->observer.lxy_H * i.xy.x;
        st->psi_xy_Wb.y = cfg->observer.lxy_H * i.xy.y;
    }
}

/* Comparator outputs for the decided state. */
static void compare_levels(const ht_control_config *cfg, ht_control_state *st,
                           const ht_control_input *in, float psi_Wb)
{
    float error = in->torque_ref_Nm - st->decided.torque_Nm;
    int16_t last = st->torque_level;
    if (cfg->torque_levels == 3u) {
        last = ht_compare_three_level(last, error, cfg->torque_band_Nm, cfg->torque_release_Nm);
    } else if (cfg->torque_levels == 5u) {
        last = ht_compare_five_level(last, error, cfg->torque_inner_Nm, cfg->torque_band_Nm);
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
    s[0] = ht_group[group][(k == 0u) ? (HT_DIRECTIONS - 1u) : (k - 1u)];
    s[1] = ht_group[group][k];
    s[2] = ht_group[group][(k == HT_DIRECTIONS - 1u) ? 0u : (k + 1u)];
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


/* State words and action points for direction k. */
static ht_action_points choose(const ht_control_config *cfg, const ht_control_state *st, unsigned k,
                               uint16_t s[3])
{
    ht_xy none = {0.0f, 0.0f};
    ht_action_points whole = {1.0f, 1.0f};
    bool full_level;
    switch (cfg->scheme) {
    case HT_DTC1:
        single_vector(ht_group[HT_L][k], s);
        return whole;
    case HT_DTC2:
        single_vector(pair_choice(HT_L, k, st->psi_xy_Wb), s);
        return whole;
    case HT_DTC3:
        full_level = (st->torque_level == 2) || (st->torque_level == -2);
        single_vector(pair_choice(full_level ? HT_L : HT_S, k, st->psi_xy_Wb), s);
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
    ht_applied_finish(target, before, &cfg->dead);
}

static void regulate_xy(const ht_control_config *cfg, ht_control_state *st, ht_xy i_xy,
                        float psi_Wb, bool zero)
{
    float inverse = (psi_Wb > 0.0f) ? (1.0f / psi_Wb) : 0.0f;
    ht_ab turn = {st->decided.psi_Wb.alpha * inverse, st->decided.psi_Wb.beta * inverse};
    st->v_xy_pu = ht_xy_step(&cfg->xy, &st->xy, i_xy, turn, cfg->xy_limit_pu,
                             zero && cfg->hold_on_zero);
}

/* The pattern of normal operation: action points, and the state words into `s`. */
static ht_action_points decide(const ht_control_config *cfg, ht_control_state *st,
                               const ht_control_input *in, ht_xy i_xy, uint16_t s[3])
{
    ht_action_points whole = {1.0f, 1.0f};
    ht_ab psi = st->decided.psi_Wb;
    float psi_Wb = sqrtf(psi.alpha * psi.alpha + psi.beta * psi.beta);
    bool zero;
    bool raise;
    unsigned k;

    compare_levels(cfg, st, in, psi_Wb);
    zero = st->torque_level == 0;
    /* Under a zero vector the flux decays with R_s i; at low speed and light load
     * that can last until the machine is lost. */
    raise = zero && (cfg->flux_hold > 0.0f)
            && (psi_Wb < (1.0f - cfg->flux_hold) * in->flux_ref_Wb);
    zero = zero && !raise;

    if ((cfg->scheme == HT_DDR) || (cfg->scheme == HT_DDR_ML)) {
        regulate_xy(cfg, st, i_xy, psi_Wb, zero);
    } else {
        st->v_xy_pu.x = 0.0f;
        st->v_xy_pu.y = 0.0f;
    }
    if (zero) {
        single_vector(zero_vector(cfg, st), s);
        return whole;
    }
    if (raise) { /* along the flux, 15 degrees to the side the torque wants */
        k = ht_direction_along(st->sector, in->torque_ref_Nm > st->decided.torque_Nm);
    } else {
        k = ht_direction(cfg->table, st->sector, st->torque_level > 0, st->flux_level > 0);
    }
    return choose(cfg, st, k, s);
}

/* The pattern of the flux build-up. */
static ht_action_points decide_build(const ht_control_config *cfg, const ht_control_state *st,
                                     const ht_control_input *in, ht_ab i, uint16_t s[3])
{
    ht_action_points whole = {1.0f, 1.0f};
    ht_xy none = {0.0f, 0.0f};
    ht_ab psi = st->decided.psi_Wb;
    float limit2 = cfg->build_current_A * cfg->build_current_A;
    float i2 = i.alpha * i.alpha + i.beta * i.beta;
    float psi2 = psi.alpha * psi.alpha + psi.beta * psi.beta;
    if ((i2 < limit2) && (psi2 < in->flux_ref_Wb * in->flux_ref_Wb)) {
        virtual_vector(HT_L, BUILD_DIRECTION, s);
        return ht_duty(HT_L, BUILD_DIRECTION, none);
    }
    single_vector(zero_vector(cfg, st), s);
    return whole;
}

void ht_control_step(const ht_control_config *cfg, ht_control_state *st, const ht_control_input *in,
                     bool build, ht_compare *out)
{
    ht_vsd i = ht_vsd_from_six(&in->i_A);
    ht_action_points p;
    uint16_t s[3];
    observe(cfg, st, in, i);
    st->sector = (uint16_t)ht_sector(st->decided.psi_Wb);
    p = build ? decide_build(cfg, st, in, i.ab, s) : decide(cfg, st, in, i.xy, s);
    commit(cfg, st, s, p, out);
}
