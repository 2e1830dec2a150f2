#include "ht_table_law.h"

#include "ht_comparator.h"
#include "ht_limited.h"
#include "ht_vectors.h"
#include "ht_winding.h"

#include <math.h>
#include <stddef.h>

/* Length of the voltage without legs, relative to the group's vectors. Large: Vdc/2. Five legs make
 * this in most directions; in their worst they make a fifth less. Medium-large: the length of a
 * virtual vector. Small: the whole length. */
static const float without_legs[HT_GROUPS] = {0.776457f, 0.928203f, 1.0f, 0.75f, 0.75f};

#define COS_15 0.965925826f

/* Reach of the table 45/135, relative to 75/105. To hold the flux, the vectors before and behind
 * it take turns. Their mean lies on the chord between them, which is cos 45 degrees of their
 * length away from the centre, or cos 15 degrees with the table 75/105, the vectors' circle. */
#define WIDE_TABLE_REACH 0.732051f

void ht_table_law_select(ht_table_law_config *cfg, const ht_scheme_info *row)
{
    cfg->vectors = row->vectors;
    cfg->group = row->group;
    cfg->regulated = row->regulated;
    cfg->torque_levels = row->torque_levels;
    cfg->xy_limit_pu = ht_scheme_xy_limit_pu(row);
}

void ht_table_law_configure(ht_table_law_config *cfg, const ht_law_setting *given,
                            ht_modulator_config *modulator)
{
    static const uint16_t levels[4] = {0u, 2u, 3u, 5u};
    uint16_t asked = levels[(uint16_t)given->torque_levels];
    if (asked != 0u) { /* not "auto", which is what the scheme's row says */
        cfg->torque_levels = asked;
    }
    cfg->table = (ht_table)(uint16_t)given->table;
    if (given->machine->winding != HT_WINDING_30) {
        cfg->table = HT_TABLE_60_120;
        cfg->group = (uint16_t)ht_large_of(given->machine->winding);
    }
    cfg->hold_on_zero = given->zero_hold != 0.0f;
    cfg->flux_band_Wb = given->flux_band_Wb;
    cfg->torque_band_Nm = given->torque_band_Nm;
    cfg->torque_inner_Nm = given->torque_inner_Nm;
    cfg->torque_release_Nm = given->torque_release_Nm;
    cfg->flux_hold = given->flux_hold;
    cfg->xy.kp_pu_A = given->kp_xy_pu_A;
    cfg->xy.ki_ts_pu_A = given->ki_xy_pu_As * given->machine->ts_s;
    ht_modulator_centre(modulator, false);
}

float ht_table_law_reach_pu(const ht_table_law_config *cfg, float reach_pu)
{
    return (cfg->table == HT_TABLE_45_135) ? (WIDE_TABLE_REACH * reach_pu) : reach_pu;
}

float ht_table_law_left_pu(const ht_table_law_config *cfg)
{
    ht_ab whole = ht_vector[ht_group[cfg->group][0]].ab;
    float size = sqrtf(whole.alpha * whole.alpha + whole.beta * whole.beta);
    return ht_table_law_reach_pu(cfg, COS_15 * without_legs[cfg->group] * size);
}

bool ht_table_law_check(const ht_table_law_config *cfg)
{
    uint16_t levels = cfg->torque_levels;
    bool limited = (cfg->xy_limit_pu > 0.0f) && (cfg->xy_limit_pu < 1.0f); /* NaN is not */
    bool six = cfg->table == HT_TABLE_60_120;
    bool of_six = cfg->group >= (uint16_t)HT_L0;
    return ((unsigned)cfg->vectors <= (unsigned)HT_VECTORS_VIRTUAL)
           && (cfg->group < (uint16_t)HT_GROUPS)
           && ((unsigned)cfg->table <= (unsigned)HT_TABLE_60_120) && (six == of_six)
           && (!six || (cfg->vectors == HT_VECTORS_SINGLE))
           && ((levels == 2u) || (levels == 3u) || (levels == 5u)) && (limited || !cfg->regulated);
}

bool ht_table_law_needs_xy(const ht_table_law_config *cfg)
{
    return (cfg->vectors == HT_VECTORS_PAIR) || (cfg->vectors == HT_VECTORS_PAIR_SMALL);
}

void ht_table_law_reset(ht_table_law_state *st)
{
    st->torque_level = 0;
    st->flux_level = 1;
    ht_xy_reset(&st->xy);
}

/* Comparator outputs for the decided state. */
static void compare_levels(const ht_table_law_config *cfg, ht_table_law_state *st,
                           const ht_vector_law_input *in, float psi_Wb)
{
    float error = in->torque_ref_Nm - in->decided->torque_Nm;
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

/* Of two vectors that point the same way in alpha-beta and opposite ways in x-y,
 * the one that drives psi_xy down (paper B, Table III): `strong` pushes along
 * the large vector's x-y direction, the medium-large one against it. */
static uint16_t pair_choice(unsigned strong, unsigned k, ht_xy psi_xy)
{
    ht_xy along = ht_vector[ht_group[HT_L][k]].xy;
    bool grows = (along.x * psi_xy.x + along.y * psi_xy.y) > 0.0f;
    return ht_group[grows ? (unsigned)HT_ML : strong][k];
}

/* A virtual vector's three vectors drive an x-y current that lies to one side of its samples for the whole
 * period, and to the other side in the other order. This side turns with the flux. Its mean is therefore a
 * fifth and a seventh harmonic that the regulator does not see in the samples. Beside those of magnets it
 * counts, and it is least in the order that follows the rotation. (Orders that take turns leave less of it,
 * but then 2 of 51 healthy machines trip.) A function of its own: the others keep their registers. */
HT_APART static void order_vectors(const ht_table_law_config *cfg, const ht_induced *induced,
                                   uint16_t s[3], ht_action_points *p)
{
    if (cfg->regulated && (induced->omega_rad_s > 0.0f)) {
        ht_action_points back = {1.0f - p->t2, 1.0f - p->t1};
        uint16_t first = s[0];
        s[0] = s[2];
        s[2] = first;
        *p = back;
    }
}

/* State words and action points of the active vector in direction k. */
static ht_action_points active_vector(const ht_table_law_config *cfg, const ht_table_law_state *st,
                                      const ht_vector_law_input *in, unsigned k, ht_xy v_xy_pu,
                                      uint16_t s[3])
{
    ht_action_points p = {1.0f, 1.0f};
    bool full_level;
    switch (cfg->vectors) {
    case HT_VECTORS_VIRTUAL:
        ht_vectors_virtual(cfg->group, k, s);
        p = ht_duty(cfg->group, k, v_xy_pu);
        if (in->induced != NULL) {
            order_vectors(cfg, in->induced, s, &p);
        }
        break;
    case HT_VECTORS_PAIR:
        ht_vectors_single(pair_choice(cfg->group, k, *in->psi_xy_Wb), s);
        break;
    case HT_VECTORS_PAIR_SMALL:
        full_level = (st->torque_level == 2) || (st->torque_level == -2);
        ht_vectors_single(pair_choice(full_level ? cfg->group : (unsigned)HT_S, k, *in->psi_xy_Wb),
                          s);
        break;
    case HT_VECTORS_SINGLE:
    default:
        ht_vectors_single(ht_group[cfg->group][k], s);
        break;
    }
    return p;
}

static ht_xy regulated(const ht_table_law_config *cfg, ht_table_law_state *st,
                       const ht_vector_law_input *in, float psi_Wb, bool hold)
{
    float inverse = (psi_Wb > 0.0f) ? (1.0f / psi_Wb) : 0.0f;
    ht_ab turn = {in->decided->psi_Wb.alpha * inverse, in->decided->psi_Wb.beta * inverse};
    ht_xy none = {0.0f, 0.0f};
    ht_xy v;
    if (!cfg->regulated) {
        return none;
    }
    v = ht_xy_step(&cfg->xy, &st->xy, in->i_xy_A, turn, cfg->xy_limit_pu, hold);
    if (in->induced != NULL) {
        v.x = ht_limited(v.x + in->induced->v_pu.x, cfg->xy_limit_pu);
        v.y = ht_limited(v.y + in->induced->v_pu.y, cfg->xy_limit_pu);
    }
    return v;
}

/* Direction of the period's voltage, HT_DIRECTIONS for a zero vector. */
static HT_INTO_CALLERS unsigned decide(const ht_table_law_config *cfg, ht_table_law_state *st,
                                       const ht_vector_law_input *in, float psi_Wb)
{
    compare_levels(cfg, st, in, psi_Wb);
    if (st->torque_level != 0) {
        return ht_direction(cfg->table, in->sector, st->torque_level > 0, st->flux_level > 0);
    }
    /* Under a zero vector the flux decays with R_s i; at low speed and light load
     * that can last until the machine is lost. Then: along the flux, 15 degrees to the side the
     * torque wants. */
    if ((cfg->flux_hold > 0.0f) && (psi_Wb < (1.0f - cfg->flux_hold) * in->flux_ref_Wb)) {
        return ht_direction_along(cfg->table, in->sector,
                                  in->torque_ref_Nm > in->decided->torque_Nm);
    }
    return HT_DIRECTIONS;
}

static float length(ht_ab v)
{
    return sqrtf(v.alpha * v.alpha + v.beta * v.beta);
}

ht_action_points ht_table_law_step(const ht_table_law_config *cfg, ht_table_law_state *st,
                                   const ht_vector_law_input *in, ht_xy *v_xy_pu, uint16_t s[3])
{
    ht_action_points whole = {1.0f, 1.0f};
    float psi_Wb = length(in->decided->psi_Wb);
    unsigned k = decide(cfg, st, in, psi_Wb);
    bool zero = k == HT_DIRECTIONS;
    *v_xy_pu = regulated(cfg, st, in, psi_Wb, zero && cfg->hold_on_zero);
    if (zero) {
        ht_vectors_zero(in->before, in->only_v0, s);
        return whole;
    }
    return active_vector(cfg, st, in, k, *v_xy_pu, s);
}

ht_vsd ht_table_law_voltage(const ht_table_law_config *cfg, ht_table_law_state *st,
                            const ht_vector_law_input *in)
{
    float psi_Wb = length(in->decided->psi_Wb);
    unsigned k = decide(cfg, st, in, psi_Wb);
    ht_vsd v = {{0.0f, 0.0f}, {0.0f, 0.0f}};
    if (k != HT_DIRECTIONS) {
        bool low = (cfg->vectors == HT_VECTORS_PAIR_SMALL)
                   && ((st->torque_level == 1) || (st->torque_level == -1));
        unsigned group = low ? (unsigned)HT_S : cfg->group;
        ht_ab whole = ht_vector[ht_group[group][k]].ab;
        v.ab.alpha = without_legs[group] * whole.alpha;
        v.ab.beta = without_legs[group] * whole.beta;
    }
    v.xy = regulated(cfg, st, in, psi_Wb, false);
    return v;
}
