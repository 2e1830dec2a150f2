/* The control step, everything that it calls by what that promises. What a function relies on must
 * hold where it is called. */
#include "ht_contracts.h"
#include "ht_control.c"
#include "prove.h"

#define XY_LIMIT_DEADBEAT 0.1f

ht_vsd ht_vsd_from_six(const ht_six *s)
{
    ht_vsd v;
    v.ab = any_ab();
    v.xy = any_xy();
    return v;
}

ht_vsd ht_vsd_turned(ht_winding winding, ht_vsd v)
{
    MUST((unsigned)winding < HT_WINDINGS);
    (void)v;
    return ht_vsd_from_six(0);
}

unsigned ht_sector(ht_ab v)
{
    unsigned sector = nondet_uint16();
    GIVEN(HT_IS_SECTOR(sector));
    return sector;
}

unsigned ht_sector_of_six(ht_ab v)
{
    return ht_sector(v);
}

static ht_flow any_flow(void)
{
    ht_flow flow;
    flow.out = nondet_uint16();
    flow.in = nondet_uint16();
    GIVEN(HT_IS_WORD(flow.out) && HT_IS_WORD(flow.in));
    return flow;
}

ht_flow ht_flow_of(const ht_six *i_A, const ht_dead_time *dead)
{
    MUST(dead->i_zero_A > 0.0f);
    return any_flow();
}

ht_flow ht_flow_at_edges(const ht_applied *a, ht_flow begin, ht_flow end)
{
    MUST(HT_IS_WORD(begin.out) && HT_IS_WORD(begin.in) && HT_IS_WORD(end.out));
    MUST(HT_IS_WORD(end.in));
    return any_flow();
}

ht_vsd ht_volt_seconds(const ht_applied *a, const ht_toggles *toggles, const ht_dead_time *dead,
                       ht_flow flow, const ht_six *i_begin, const ht_six *i_end,
                       const ht_carry *left, ht_carry *over, bool xy)
{
    MUST(HT_IS_PATTERN(*a));
    MUST(HT_IS_WORD(flow.out) && HT_IS_WORD(flow.in) && HT_IS_WORD(left->legs));
    over->legs = nondet_uint16();
    GIVEN(HT_IS_WORD(over->legs));
    return ht_vsd_from_six(i_begin);
}

void ht_leg_loss_reset(ht_leg_loss_state *st)
{
    st->found = 0u;
}

void ht_leg_loss_step(const ht_leg_loss_config *cfg, ht_leg_loss_state *st,
                      const ht_leg_loss_period *in, ht_xy v_V, ht_xy from, ht_xy to)
{
    MUST(HT_IS_PATTERN(*in->applied));
    MUST(cfg->least_V2 > 0.0f);
    st->found = nondet_uint16();
}

static ht_estimate any_estimate(void)
{
    ht_estimate e;
    e.psi_Wb = any_ab();
    e.torque_Nm = nondet_float();
    return e;
}

ht_estimate ht_observer_update(const ht_observer_config *cfg, ht_observer_state *st, ht_ab v_V,
                               ht_ab i_A, float turn_rad, float inv_psi_ref2)
{
    return any_estimate();
}

ht_estimate ht_observer_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                                ht_estimate now, ht_ab v_V, ht_ab i_A)
{
    return any_estimate();
}

ht_estimate ht_magnet_update(const ht_observer_config *cfg, ht_observer_state *st, ht_ab v_V,
                             ht_ab i_A, float turn_rad, ht_ab axis, float inv_psi_ref2)
{
    return any_estimate();
}

ht_estimate ht_magnet_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                              ht_estimate now, ht_ab v_V, ht_ab i_A, ht_ab axis, ht_ab *rotor_Wb)
{
    *rotor_Wb = any_ab();
    return any_estimate();
}

void ht_observer_follow(const ht_observer_config *cfg, ht_observer_state *st, ht_ab i_A,
                        float turn_rad)
{
}

ht_estimate ht_observer_pull(const ht_observer_config *cfg, ht_observer_state *st, float share,
                             float omega_rad_s)
{
    return any_estimate();
}

float ht_catch_pull(ht_catch_state *st)
{
    return nondet_float();
}

ht_ab ht_catch_step(const ht_observer_config *machine, const ht_observer_state *flux,
                    ht_catch_state *st, const ht_catch_input *in)
{
    return any_ab();
}

ht_xy ht_magnet_induced_V(const ht_magnet_config *m, ht_ab axis, float omega_rad_s)
{
    return any_xy();
}

ht_xy ht_observer_predict_xy(const ht_observer_config *cfg, const ht_observer_state *st, ht_xy v_V,
                             ht_xy i_A)
{
    return any_xy();
}

ht_vsd ht_lost_legs_voltage(const ht_lost_legs *lost, const ht_observer_config *machine,
                            float rs_ohm, ht_vsd v_V, ht_xy from, ht_xy to)
{
    MUST((lost->axes == 1u) || (lost->axes == 2u));
    return ht_vsd_from_six(0);
}

ht_ab ht_lost_legs_expected(const ht_lost_legs *lost, const ht_observer_config *machine,
                            float rs_ohm, ht_vsd v_V, ht_ab i_A, ht_ab r_Wb, float turn_rad)
{
    MUST((lost->axes == 1u) || (lost->axes == 2u));
    return any_ab();
}

ht_xy ht_lost_legs_across(const ht_lost_legs *lost, ht_xy value)
{
    MUST((lost->axes == 1u) || (lost->axes == 2u));
    return any_xy();
}

ht_vsd ht_lost_legs_command(const ht_lost_legs *lost, const ht_observer_config *machine,
                            const ht_voltage_law_input *in, ht_vsd v_pu)
{
    MUST((lost->axes == 1u) || (lost->axes == 2u));
    return ht_vsd_from_six(0);
}

uint16_t ht_lost_legs_of(ht_winding winding, uint16_t legs, ht_lost_legs *lost)
{
    lost->axes = nondet_uint16();
    return nondet_uint16();
}

ht_ab ht_observer_predict_rotor(const ht_observer_config *cfg, const ht_observer_state *st,
                                ht_ab psi_Wb, ht_ab i_A)
{
    return any_ab();
}

static ht_action_points any_action_points(void)
{
    ht_action_points p;
    p.t1 = nondet_float();
    p.t2 = nondet_float();
    GIVEN(HT_ARE_ACTION_POINTS(p));
    return p;
}

static void any_words(uint16_t s[3])
{
    int n;
    for (n = 0; n < 3; n++) {
        s[n] = nondet_uint16();
        GIVEN(HT_IS_WORD(s[n]));
    }
}

ht_action_points ht_duty(unsigned group, unsigned k, ht_xy v_pu)
{
    MUST((group < 2u) && HT_IS_SECTOR(k));
    return any_action_points();
}

void ht_vectors_virtual(unsigned group, unsigned k, uint16_t s[3])
{
    MUST((group < (unsigned)HT_GROUPS) && HT_IS_SECTOR(k));
    any_words(s);
}

void ht_vectors_alike(unsigned group, unsigned k, uint16_t s[3])
{
    ht_vectors_virtual(group, k, s);
}

void ht_vectors_zero(uint16_t before, bool only_v0, uint16_t s[3])
{
    MUST(HT_IS_WORD(before));
    any_words(s);
}

void ht_vectors_single(uint16_t word, uint16_t s[3])
{
    MUST(HT_IS_WORD(word));
    any_words(s);
}

static bool is_law_state(const ht_table_law_config *cfg, const ht_table_law_state *st)
{
    return HT_IS_LEVEL(st->torque_level, 2) && ((st->flux_level == 0) || (st->flux_level == 1))
           && (!cfg->regulated || HT_IS_XY_STATE(st->xy, cfg->xy_limit_pu));
}

ht_vsd ht_table_law_voltage(const ht_table_law_config *cfg, ht_table_law_state *st,
                            const ht_vector_law_input *in)
{
    return ht_vsd_from_six(0);
}

ht_action_points ht_table_law_step(const ht_table_law_config *cfg, ht_table_law_state *st,
                                   const ht_vector_law_input *in, ht_xy *v_xy_pu, uint16_t s[3])
{
    MUST(HT_IS_SECTOR(in->sector) && HT_IS_WORD(in->before));
    MUST(is_law_state(cfg, st));
    st->torque_level = nondet_int16();
    st->flux_level = nondet_int16();
    st->xy.with = any_xy();
    st->xy.against = any_xy();
    GIVEN(is_law_state(cfg, st));
    *v_xy_pu = any_xy();
    any_words(s);
    return any_action_points();
}

ht_vsd ht_foc_law_step(const ht_foc_law_config *cfg, const ht_observer_config *machine,
                       ht_foc_law_state *st, const ht_voltage_law_input *in)
{
    MUST(HT_IS_XY_STATE(st->xy, XY_LIMIT_DEADBEAT));
    st->xy.with = any_xy();
    st->xy.against = any_xy();
    GIVEN(HT_IS_XY_STATE(st->xy, XY_LIMIT_DEADBEAT));
    st->begun = true;
    return ht_vsd_from_six(0);
}

ht_vsd ht_deadbeat_law_step(const ht_deadbeat_law_config *cfg, const ht_observer_config *machine,
                            ht_deadbeat_law_state *st, const ht_voltage_law_input *in)
{
    MUST(HT_IS_XY_STATE(st->xy, XY_LIMIT_DEADBEAT));
    st->xy.with = any_xy();
    st->xy.against = any_xy();
    GIVEN(HT_IS_XY_STATE(st->xy, XY_LIMIT_DEADBEAT));
    return ht_vsd_from_six(0);
}

ht_vsd ht_interleaved_law_step(const ht_interleaved_law_config *cfg,
                               const ht_observer_config *machine, ht_interleaved_law_state *st,
                               const ht_voltage_law_input *in)
{
    return ht_deadbeat_law_step(&cfg->deadbeat, machine, &st->deadbeat, in);
}

/* Any registers that follow `first`, and any pattern. */
static void any_compare(uint16_t start, const ht_period *period, ht_compare *out)
{
    int leg;
    out->start = start;
    for (leg = 0; leg < HT_LEGS; leg++) {
        out->ca[leg] = nondet_uint16();
        out->cb[leg] = nondet_uint16();
        GIVEN(HT_IS_COMPARE(out->ca[leg], *period));
        GIVEN(HT_IS_COMPARE(out->cb[leg], *period));
    }
}

static void any_masks(ht_applied *a)
{
    a->later = nondet_uint16();
    a->close = nondet_uint16();
    a->rising = nondet_uint16();
    a->falling = nondet_uint16();
    a->own = nondet_uint16();
}

/* Where the instants are of the pattern that is on the legs no longer, and its number. */
static const ht_toggles *spare;
static uint16_t spare_number;
static bool modulated;

ht_vsd ht_modulator_legs(ht_winding winding, ht_vsd *v_pu)
{
    MUST(((unsigned)winding < HT_WINDINGS) && (winding != HT_WINDING_30));
    *v_pu = ht_vsd_from_six(0);
    return ht_vsd_from_six(0);
}

void ht_modulator_step(const ht_modulator_config *cfg, ht_modulator_state *st, ht_vsd *v_pu,
                       const ht_modulator_input *in, ht_compare *out, ht_applied *applied,
                       ht_toggles *toggles)
{
    MUST(HT_IS_WORD(in->before) && HT_IS_PERIOD(*in->period) && (in->period->first == 0u));
    MUST(in->dead->i_zero_A > 0.0f);
    applied->before = in->before;
    any_words(applied->s);
    any_masks(applied);
    GIVEN(HT_IS_PATTERN(*applied));
    any_compare(applied->s[0], in->period, out);
    /* It writes the instants there and nowhere else. Nothing here reads them, so they keep any
     * values: a store at a place that only the solver knows takes it too long. */
    MUST(toggles == spare);
    modulated = true;
}

ht_xy ht_interleaved_law_pattern(const ht_interleaved_law_config *cfg,
                                 const ht_observer_config *machine, ht_interleaved_law_state *st,
                                 const ht_voltage_law_input *in, const ht_modulator_input *pwm,
                                 ht_compare *out, ht_applied *applied, ht_toggles *toggles)
{
    (void)ht_interleaved_law_step(cfg, machine, st, in);
    ht_modulator_step(0, 0, 0, pwm, out, applied, toggles);
    return any_xy();
}

void ht_pattern_counts(const uint16_t s[3], ht_action_points p, const ht_period *period,
                       ht_compare *counts, ht_applied *applied)
{
    MUST(HT_IS_WORD(s[0]) && HT_IS_WORD(s[1]) && HT_IS_WORD(s[2]) && HT_ARE_ACTION_POINTS(p));
    MUST(HT_IS_PERIOD(*period));
    any_words(applied->s);
    any_compare(applied->s[0], period, counts);
}

void ht_applied_finish(ht_applied *a, uint16_t before, const ht_dead_time *dead)
{
    MUST(HT_IS_WORD(a->s[0]) && HT_IS_WORD(a->s[1]) && HT_IS_WORD(a->s[2]) && HT_IS_WORD(before));
    a->before = before;
    any_masks(a);
    a->own = 0u;
    GIVEN(HT_IS_PATTERN(*a));
}

static void any_pattern(ht_applied *a)
{
    a->before = nondet_uint16();
    any_words(a->s);
    any_masks(a);
    GIVEN(HT_IS_PATTERN(*a));
}

static bool is_state(const ht_control_config *cfg, const ht_control_state *st)
{
    return HT_IS_PATTERN(st->active) && HT_IS_PATTERN(st->next) && HT_IS_WORD(st->carry.legs)
           && HT_IS_WORD(st->flow.out) && HT_IS_WORD(st->flow.in) && HT_IS_SECTOR(st->sector)
           && is_law_state(&cfg->table_law, &st->table_law)
           && HT_IS_XY_STATE(st->deadbeat_law.xy, XY_LIMIT_DEADBEAT)
           && HT_IS_XY_STATE(st->foc_law.xy, XY_LIMIT_DEADBEAT)
           && HT_IS_XY_STATE(st->interleaved_law.deadbeat.xy, XY_LIMIT_DEADBEAT);
}

static bool is_same_pattern(const ht_applied *a, const ht_applied *b)
{
    return (a->before == b->before) && (a->s[0] == b->s[0]) && (a->s[1] == b->s[1])
           && (a->s[2] == b->s[2]) && (a->own == b->own) && (a->later == b->later);
}

/* What the observation leaves, as prove_control_observe shows it. */
static void promise_observe(const ht_control_config *cfg, ht_control_state *st,
                            const ht_control_input *in, ht_vsd i, bool lost, ht_rotor rotor,
                            bool caught, ht_winding winding)
{
    MUST((unsigned)winding < HT_WINDINGS);
    MUST(is_state(cfg, st));
    if (cfg->shadow) {
        st->active = st->next;
    }
    st->carry.legs = nondet_uint16();
    st->flow = any_flow();
    st->estimate = any_estimate();
    st->decided = any_estimate();
    st->psi_xy_Wb = any_xy();
    st->rotor_Wb = any_ab();
    st->i_xy_A = any_xy();
    st->leg_loss.found = nondet_uint16();
    GIVEN(is_state(cfg, st));
}

/* What ht_control_check accepts, and any state in range. */
static void any_step(ht_control_config *cfg, ht_control_state *st, ht_control_input *in)
{
    cfg->observer.winding = (ht_winding)nondet_uint16();
    GIVEN((unsigned)cfg->observer.winding < HT_WINDINGS);
    cfg->predict = nondet_bool();
    cfg->needs_xy = nondet_bool();
    cfg->only_v0 = nondet_bool();
    cfg->period.counts = nondet_uint16();
    cfg->period.first = nondet_uint16();
    cfg->period.shortest = nondet_uint16();
    cfg->drop_V = nondet_float();
    cfg->leg_loss.least_V2 = nondet_float();
    cfg->dead.i_zero_A = nondet_float();
    cfg->table_law.regulated = nondet_bool();
    cfg->table_law.xy_limit_pu = nondet_float();
    GIVEN(HT_IS_PERIOD(cfg->period) && (!cfg->shadow || (cfg->period.first == 0u)));
    GIVEN((cfg->law == HT_LAW_TABLE) || (cfg->shadow && cfg->predict));
    GIVEN(cfg->dead.i_zero_A > 0.0f);
    GIVEN((cfg->table_law.xy_limit_pu > 0.0f) && (cfg->table_law.xy_limit_pu < 1.0f));
    any_pattern(&st->active);
    any_pattern(&st->next);
    st->carry.legs = nondet_uint16();
    st->flow = any_flow();
    st->sector = nondet_uint16();
    st->lost.axes = nondet_uint16();
    GIVEN(st->lost.axes <= 2u);
    st->table_law.torque_level = nondet_int16();
    st->table_law.flux_level = nondet_int16();
    st->table_law.xy.with = any_xy();
    st->table_law.xy.against = any_xy();
    st->deadbeat_law.xy.with = any_xy();
    st->deadbeat_law.xy.against = any_xy();
    st->foc_law.xy.with = any_xy();
    st->foc_law.xy.against = any_xy();
    st->interleaved_law.deadbeat.xy.with = any_xy();
    st->interleaved_law.deadbeat.xy.against = any_xy();
    GIVEN(is_state(cfg, st));
    in->i_A = any_six();
    in->vdc_V = nondet_float();
    in->torque_ref_Nm = nondet_float();
    in->flux_ref_Wb = nondet_float();
    in->turn_rad = nondet_float();
    in->inv_flux_ref2 = nondet_float();
}

void prove_control_observe(void)
{
    ht_control_config cfg;
    ht_control_state st;
    ht_control_input in;
    ht_applied active;
    ht_applied next;
    cfg.law = (ht_law)nondet_uint16();
    cfg.shadow = nondet_bool();
    any_step(&cfg, &st, &in);
    active = st.active;
    next = st.next;
    observe(&cfg, &st, &in, ht_vsd_from_six(&in.i_A), st.lost.axes != 0u, nondet_bool(),
            nondet_bool(), cfg.observer.winding);
    MUST(is_state(&cfg, &st));
    MUST(is_same_pattern(&st.active, cfg.shadow ? &next : &active));
    MUST(is_same_pattern(&st.next, &next));
}

/* What the step is asked for. LOST: without one leg or more, with magnets or without. */
typedef enum { RUNS, BUILDS, LOST, MAGNETS } the_case;

static void step_of(the_case which, ht_law law, bool shadow, ht_winding winding)
{
    ht_control_config cfg;
    ht_control_state st;
    ht_control_input in;
    ht_compare out;
    uint16_t leg = nondet_uint16();
    uint16_t before;
    cfg.law = law;
    cfg.shadow = shadow;
    any_step(&cfg, &st, &in);
    cfg.observer.rotor = ((which == MAGNETS) || ((which == LOST) && nondet_bool()))
                             ? HT_ROTOR_MAGNET
                             : HT_ROTOR_INDUCTION;
    cfg.observer.winding = winding;
    cfg.patterns = law == HT_LAW_INTERLEAVED;
    cfg.special = cfg.patterns || (cfg.observer.rotor != HT_ROTOR_PLAIN)
                  || (winding != HT_WINDING_30);
    GIVEN(leg < 6u);
    if (which == LOST) {
        GIVEN(st.lost.axes != 0u);
    } else if (which != BUILDS) {
        st.lost.axes = 0u;
    } else {
        /* any: the step does not depend on it */
    }
    before = cfg.shadow ? st.next.s[2] : st.active.s[2];
    spare_number = (st.next.own == 1u) ? 2u : 1u;
    spare = (st.next.own == 1u) ? &st.toggles[1] : &st.toggles[0];
    ht_control_step(&cfg, &st, &in, which == BUILDS, &out);
    MUST(HT_IS_WORD(out.start));
    MUST(HT_IS_COMPARE(out.ca[leg], cfg.period));
    MUST(HT_IS_COMPARE(out.cb[leg], cfg.period));
    MUST(is_state(&cfg, &st));
    /* The pattern is remembered as it was handed out, and continues the one before. */
    MUST((cfg.shadow ? st.next.s[0] : st.active.s[0]) == out.start);
    MUST((cfg.shadow ? st.next.before : st.active.before) == before);
    MUST(modulated == ((which == LOST) || ((which != BUILDS) && (law != HT_LAW_TABLE))));
    MUST(IMPLIES(modulated, st.next.own == spare_number));
}

/* Sets that are not 30 degrees apart. */
static ht_winding turned(void)
{
    return nondet_bool() ? HT_WINDING_0 : HT_WINDING_60;
}

static ht_law any_law(void)
{
    ht_law law = (ht_law)nondet_uint16();
    GIVEN((law == HT_LAW_TABLE) || (law == HT_LAW_DEADBEAT) || (law == HT_LAW_FOC)
          || (law == HT_LAW_INTERLEAVED));
    return law;
}

/* The flux build-up asks no law. */
void prove_control_build(void)
{
    step_of(BUILDS, any_law(), nondet_bool(), HT_WINDING_30);
}

void prove_control_build_turned(void)
{
    step_of(BUILDS, any_law(), nondet_bool(), turned());
}

void prove_control_table(void)
{
    step_of(RUNS, HT_LAW_TABLE, nondet_bool(), HT_WINDING_30);
}

void prove_control_table_turned(void)
{
    step_of(RUNS, HT_LAW_TABLE, nondet_bool(), turned());
}

/* A law that commands a voltage needs shadow load. */
void prove_control_deadbeat(void)
{
    step_of(RUNS, HT_LAW_DEADBEAT, true, HT_WINDING_30);
}

void prove_control_deadbeat_turned(void)
{
    step_of(RUNS, HT_LAW_DEADBEAT, true, turned());
}

void prove_control_interleaved(void)
{
    step_of(RUNS, HT_LAW_INTERLEAVED, true, HT_WINDING_30);
}

void prove_control_foc(void)
{
    step_of(RUNS, HT_LAW_FOC, true, HT_WINDING_30);
}

void prove_control_foc_turned(void)
{
    step_of(RUNS, HT_LAW_FOC, true, turned());
}

/* The table law as well: it may be taken over in the interrupt that finds that it cannot. */
void prove_control_lost(void)
{
    step_of(LOST, any_law(), true, HT_WINDING_30);
}

void prove_control_lost_turned(void)
{
    step_of(LOST, any_law(), true, turned());
}

void prove_control_magnets(void)
{
    step_of(MAGNETS, any_law(), nondet_bool(), HT_WINDING_30);
}

void prove_control_magnets_turned(void)
{
    step_of(MAGNETS, any_law(), nondet_bool(), turned());
}
