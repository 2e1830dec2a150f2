/* The law of switching tables, its regulator and duty ratios by what they promise. */
#include "ht_comparator.c"
#include "ht_contracts.h"
#include "ht_switching.c"
#include "ht_table_law.c"
#include "ht_tables.c"
#include "ht_vectors.c"
#include "xy_regulator_contract.h"

float ht_scheme_xy_limit_pu(const ht_scheme_info *row)
{
    return row->regulated ? ht_tmvcl_pu[row->group] : 0.0f;
}

ht_action_points ht_duty(unsigned group, unsigned k, ht_xy v_pu)
{
    ht_action_points p;
    p.t1 = nondet_float();
    p.t2 = nondet_float();
    MUST((group < 2u) && HT_IS_SECTOR(k));
    GIVEN(HT_ARE_ACTION_POINTS(p));
    return p;
}

static void any_law_config(ht_table_law_config *c)
{
    c->vectors = (ht_vectors)nondet_uint16();
    c->group = nondet_uint16();
    c->regulated = nondet_bool();
    c->table = (ht_table)nondet_uint16();
    c->torque_levels = nondet_uint16();
    c->flux_band_Wb = nondet_float();
    c->torque_band_Nm = nondet_float();
    c->torque_inner_Nm = nondet_float();
    c->torque_release_Nm = nondet_float();
    c->flux_hold = nondet_float();
    c->hold_on_zero = nondet_bool();
    c->xy.kp_pu_A = nondet_float();
    c->xy.ki_ts_pu_A = nondet_float();
    c->xy_limit_pu = nondet_float();
}

void prove_table_law(void)
{
    ht_table_law_config cfg;
    ht_table_law_state st;
    ht_vector_law_input in;
    ht_estimate decided;
    ht_xy psi_xy = any_xy();
    ht_induced induced;
    ht_xy v = any_xy();
    ht_action_points p;
    uint16_t s[3];
    int n;
    any_law_config(&cfg);
    GIVEN(ht_table_law_check(&cfg));
    GIVEN(!cfg.regulated || HT_IS_XY_LIMIT(cfg.xy_limit_pu)); /* as ht_table_law_select sets it */
    /* A row of ht_schemes.def with virtual vectors names a group that has duty ratios. */
    GIVEN((cfg.vectors != HT_VECTORS_VIRTUAL) || (cfg.group <= (uint16_t)HT_ML));
    st.torque_level = nondet_int16();
    st.flux_level = nondet_int16();
    st.xy.with = any_xy();
    st.xy.against = any_xy();
    GIVEN(HT_IS_LEVEL(st.torque_level, 2));
    GIVEN((st.flux_level == 0) || (st.flux_level == 1));
    GIVEN(HT_IS_XY_STATE(st.xy, cfg.xy_limit_pu));
    decided.psi_Wb = any_ab();
    decided.torque_Nm = nondet_float();
    in.decided = &decided;
    in.psi_xy_Wb = &psi_xy;
    induced.v_pu = any_xy();
    induced.omega_rad_s = nondet_float();
    in.induced = nondet_bool() ? &induced : NULL;
    in.i_xy_A = any_xy();
    in.torque_ref_Nm = nondet_float();
    in.flux_ref_Wb = nondet_float();
    in.sector = nondet_uint16();
    in.before = nondet_uint16();
    in.only_v0 = nondet_bool();
    GIVEN(HT_IS_SECTOR(in.sector) && HT_IS_WORD(in.before));
    p = ht_table_law_step(&cfg, &st, &in, &v, s);
    MUST(HT_ARE_ACTION_POINTS(p));
    for (n = 0; n < 3; n++) {
        MUST(HT_IS_WORD(s[n]));
    }
    MUST(HT_IS_LEVEL(st.torque_level, 2));
    MUST((st.flux_level == 0) || (st.flux_level == 1));
    MUST(cfg.regulated ? HT_IS_XY_WITHIN(v, cfg.xy_limit_pu) : ((v.x == 0.0f) && (v.y == 0.0f)));
    MUST(!cfg.regulated || HT_IS_XY_STATE(st.xy, cfg.xy_limit_pu));
    (void)ht_table_law_voltage(&cfg, &st, &in); /* the next period, without legs */
    MUST(HT_IS_LEVEL(st.torque_level, 2));
    MUST((st.flux_level == 0) || (st.flux_level == 1));
}
