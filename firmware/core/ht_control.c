/* The control step. Each switch over the laws has a case for every row of ht_laws.def; no law is named here. */
#include "ht_control.h"

#include "ht_angle.h"
#include "ht_limited.h"
#include "ht_rotors.h"
#include "ht_turned.h"
#include "ht_vectors.h"
#include "ht_winding.h"

#include <math.h>
#include <stddef.h>

#define BUILD_DIRECTION 0u

static const ht_vsd no_voltage = {{0.0f, 0.0f}, {0.0f, 0.0f}};

/* Currents of the legs in the winding's planes. */
static HT_INTO_CALLERS ht_vsd currents_of(ht_winding winding, const ht_six *i_A)
{
    return ht_of_winding(winding, ht_vsd_from_six(i_A));
}

/* The input of a vector law. */
static HT_INTO_CALLERS ht_vector_law_input vectors_seen(const ht_control_config *cfg,
                                                        const ht_control_state *st,
                                                        const ht_control_input *in, ht_xy i_xy_A,
                                                        const ht_induced *induced)
{
    ht_vector_law_input seen;
    seen.induced = induced;
    seen.decided = &st->decided;
    seen.psi_xy_Wb = &st->psi_xy_Wb;
    seen.i_xy_A = i_xy_A;
    seen.torque_ref_Nm = in->torque_ref_Nm;
    seen.flux_ref_Wb = in->flux_ref_Wb;
    seen.sector = st->sector;
    seen.before = st->active.s[2];
    seen.only_v0 = cfg->only_v0;
    return seen;
}

/* The step of a vector law: action points into `p`, state words into `s`. False if the law is none. */
static HT_INTO_CALLERS bool vector_step(const ht_control_config *cfg, ht_control_state *st,
                                        const ht_control_input *in, ht_xy i_xy_A,
                                        const ht_induced *induced, uint16_t s[3],
                                        ht_action_points *p)
{
    ht_vector_law_input seen;
    bool done = true;
    switch (cfg->law) {
#define HT_VECTOR_LAW(id, law)                                                             \
    case HT_LAW_##id:                                                                      \
        seen = vectors_seen(cfg, st, in, i_xy_A, induced);                                 \
        *p = ht_##law##_law_step(&cfg->law##_law, &st->law##_law, &seen, &st->v_xy_pu, s); \
        break;
#define HT_VOLTAGE_LAW(id, law)
#define HT_PATTERN_LAW HT_VOLTAGE_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        done = false;
        break;
    }
    return done;
}

/* The voltage that the law wants, units of Vdc. Without some of the legs a vector law is asked for one,
 * too. A law that does not exist gets none. */
static HT_INTO_CALLERS ht_vsd law_voltage(const ht_control_config *cfg, ht_control_state *st,
                                          const ht_control_input *in,
                                          const ht_voltage_law_input *seen,
                                          const ht_induced *induced, bool lost)
{
    ht_vsd v;
    switch (cfg->law) {
#define HT_VECTOR_LAW(id, law)                                                              \
    case HT_LAW_##id:                                                                       \
        if (lost) {                                                                         \
            ht_vector_law_input vectors = vectors_seen(cfg, st, in, seen->i_A.xy, induced); \
            v = ht_##law##_law_voltage(&cfg->law##_law, &st->law##_law, &vectors);          \
        } else {                                                                            \
            v = no_voltage;                                                                 \
        }                                                                                   \
        break;
#define HT_VOLTAGE_LAW(id, law)                                                         \
    case HT_LAW_##id:                                                                   \
        v = ht_##law##_law_step(&cfg->law##_law, &cfg->observer, &st->law##_law, seen); \
        break;
#define HT_PATTERN_LAW HT_VOLTAGE_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        v = no_voltage;
        break;
    }
    return v;
}

/* The input of the modulator, or of a law in its place; the number of the toggles to `number`. */
static HT_INTO_CALLERS ht_modulator_input modulator_seen(const ht_control_config *cfg,
                                                         const ht_control_state *st,
                                                         const ht_control_input *in,
                                                         uint16_t *number)
{
    ht_modulator_input given;
    *number = (st->active.own == 1u) ? 2u : 1u;
    given.dead = &cfg->dead;
    given.i_A = &in->i_A;
    given.before = st->active.s[2];
    given.period = &cfg->period;
    return given;
}

/* The modulator writes the pattern of a voltage, because every leg has an instant of its own. */
static HT_INTO_CALLERS void modulate(const ht_control_config *cfg, ht_control_state *st,
                                     const ht_control_input *in, ht_winding winding, ht_vsd v,
                                     ht_compare *out)
{
    uint16_t number;
    ht_modulator_input given = modulator_seen(cfg, st, in, &number);
    ht_vsd legs; /* of another winding than 30 degrees */
    ht_vsd *told = &v;
    if (winding != HT_WINDING_30) {
        legs = ht_modulator_legs(winding, &v);
        told = &legs;
    }
    ht_modulator_step(&cfg->modulator, &st->modulator, told, &given, out, &st->next,
                      &st->toggles[number - 1u]);
    st->next.own = number;
    st->v_xy_pu = v.xy;
}

/* The input of a law that commands a voltage, or makes a pattern. */
static HT_INTO_CALLERS void machine_seen(const ht_control_config *cfg, const ht_control_state *st,
                                         const ht_control_input *in, ht_vsd i, ht_rotor rotor,
                                         ht_voltage_law_input *seen)
{
    seen->psi_Wb = st->decided.psi_Wb;
    seen->psi_xy_Wb = st->psi_xy_Wb;
    seen->i_A = i;
    seen->turn_rad = cfg->observer.ts_s * st->observer.omega_sync_rad_s;
    seen->rs_ohm = st->observer.rs_ohm;
    seen->torque_ref_Nm = in->torque_ref_Nm;
    seen->flux_ref_Wb = in->flux_ref_Wb;
    seen->vdc_V = in->vdc_V;
    HT_ROTOR_DOES(rotor, tell,
                  (&cfg->observer, &st->observer, &st->estimate, &st->rotor_Wb, &st->emf_V, seen));
}

/* A voltage that the law wants, units of Vdc. */
static HT_INTO_CALLERS ht_vsd wanted_pu(const ht_control_config *cfg, ht_control_state *st,
                                        const ht_control_input *in, ht_vsd i,
                                        const ht_induced *induced, bool lost, ht_rotor rotor)
{
    ht_voltage_law_input seen;
    ht_vsd v;
    machine_seen(cfg, st, in, i, rotor, &seen);
    if (lost) {
        seen.i_A.xy = ht_lost_legs_across(&st->lost, seen.i_A.xy);
        seen.psi_xy_Wb = ht_lost_legs_across(&st->lost, seen.psi_xy_Wb);
    }
    v = law_voltage(cfg, st, in, &seen, induced, lost);
    if (lost) {
        v = ht_lost_legs_command(&st->lost, &cfg->observer, &seen, v);
    }
    return v;
}

/* Subtract the devices' threshold voltage: it acts on each leg against the leg's current.
 * Around zero current, where the devices' curve is steep and ripple changes the sign, a share
 * of it counts, in proportion to the current, as for the dead time. */
static ht_vsd less_drops(const ht_control_config *cfg, ht_winding winding, const ht_six *from,
                         const ht_six *to, ht_vsd v)
{
    float per_A = 0.5f / cfg->dead.i_zero_A;
    ht_six drop;
    ht_vsd lost;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        float share = per_A * (from->p[leg] + to->p[leg]);
        drop.p[leg] = cfg->drop_V * ht_limited(share, 1.0f);
    }
    lost = ht_of_winding(winding, ht_vsd_from_six(&drop));
    v.ab.alpha -= lost.ab.alpha;
    v.ab.beta -= lost.ab.beta;
    v.xy.x -= lost.xy.x;
    v.xy.y -= lost.xy.y;
    return v;
}

/* Mean voltage under a pattern, from currents `from` to `to`. */
static inline ht_vsd voltage(const ht_control_config *cfg, ht_winding winding, const ht_applied *a,
                             const ht_toggles *toggles, ht_flow flow, const ht_six *from,
                             const ht_six *to, float vdc_V, const ht_carry *left, ht_carry *over,
                             bool xy)
{
    /* A set that is turned takes what the tables have in x-y into alpha-beta. */
    bool both = xy || (winding != HT_WINDING_30);
    ht_vsd v = ht_volt_seconds(a, toggles, &cfg->dead, flow, from, to, left, over, both);
    v = ht_of_winding(winding, v);
    v.ab.alpha *= vdc_V;
    v.ab.beta *= vdc_V;
    if (xy) {
        v.xy.x *= vdc_V;
        v.xy.y *= vdc_V;
    }
    return (cfg->drop_V > 0.0f) ? less_drops(cfg, winding, from, to, v) : v;
}

/* Under shadow load the pattern that was written a period ago takes effect now. */
static HT_INTO_CALLERS void begin_pattern(const ht_control_config *cfg, ht_control_state *st)
{
    if (cfg->shadow) {
        st->active = st->next;
    }
}

/* Voltage that the rotor induces in x-y, `periods` from now. */
HT_APART static ht_xy induced_V(const ht_control_config *cfg, const ht_control_state *st,
                                ht_ab axis, float periods)
{
    float omega = st->observer.omega_sync_rad_s;
    ht_ab turned = ht_turned(axis, periods * cfg->observer.ts_s * omega);
    return HT_ROTOR_DOES(cfg->observer.rotor, emf_V, (&cfg->observer, turned, omega));
}

/* What x-y has of a voltage while the rotor induces its own there, the middle of the period being
 * `periods` away from now. */
static ht_xy less_induced(const ht_control_config *cfg, const ht_control_state *st, ht_ab axis,
                          float periods, ht_xy v_V)
{
    ht_xy emf_V = induced_V(cfg, st, axis, periods);
    emf_V.x = v_V.x - emf_V.x;
    emf_V.y = v_V.y - emf_V.y;
    return emf_V;
}

/* Observe the period that ended and, if asked, look one period ahead. */
static HT_INTO_CALLERS void observe(const ht_control_config *cfg, ht_control_state *st,
                                    const ht_control_input *in, ht_vsd i, bool lost, ht_rotor rotor,
                                    bool caught, ht_winding winding)
{
    ht_flow now = {0u, 0u};
    ht_flow then;
    ht_estimate estimate;
    ht_vsd v;
    bool watch = cfg->leg_loss.least_V2 > 0.0f;
    bool induces = HT_ROTOR_DOES(rotor, induces, ());
    /* The currents' signs matter at edges only. Under shadow load it is known whether the
     * pattern has any: without one, the signs need not be found. Without them ht_volt_seconds
     * still gives the right answer, by looking at each edge. */
    if (!cfg->shadow || ((st->active.later | st->next.rising | st->next.falling) != 0u)) {
        now = ht_flow_of(&in->i_A, &cfg->dead);
    }
    then = ht_flow_at_edges(&st->active, st->flow, now);
    v = voltage(cfg, winding, &st->active, st->toggles, then, &st->i_A, &in->i_A, in->vdc_V,
                &st->carry, &st->carry, watch || lost);
    if (lost) {
        v.xy = induces ? less_induced(cfg, st, in->axis, -0.5f, v.xy) : v.xy;
        v = ht_lost_legs_voltage(&st->lost, &cfg->observer, st->observer.rs_ohm, v, st->i_xy_A,
                                 i.xy);
    }
    if (watch) {
        ht_leg_loss_period period = {&st->active, st->toggles, &st->i_A,
                                     &in->i_A,    in->vdc_V,   st->observer.rs_ohm};
        ht_xy acts = (induces && !lost) ? less_induced(cfg, st, in->axis, -0.5f, v.xy) : v.xy;
        ht_leg_loss_step(&cfg->leg_loss, &st->leg_loss, &period, acts, st->i_xy_A, i.xy);
    }
    if (caught) {
        ht_observer_follow(&cfg->observer, &st->observer, i.ab, in->turn_rad);
    }
    estimate = HT_ROTOR_DOES(
        rotor, update,
        (&cfg->observer, &st->observer, v.ab, i.ab, in->turn_rad, in->axis, in->inv_flux_ref2));
    if (caught) {
        estimate = ht_observer_pull(&cfg->observer, &st->observer, ht_catch_pull(&st->caught),
                                    in->omega_rad_s);
    }
    st->estimate = estimate;
    st->i_xy_A.x = i.xy.x;
    st->i_xy_A.y = i.xy.y;
    st->i_A = in->i_A;
    st->flow = now;
    begin_pattern(cfg, st);
    if (cfg->predict) {
        bool xy = cfg->needs_xy || lost;
        ht_carry over; /* of no interest */
        v = voltage(cfg, winding, &st->next, st->toggles, now, &in->i_A, &in->i_A, in->vdc_V,
                    &st->carry, &over, xy);
        if (lost) {
            ht_ab r; /* rotor flux seen from the stator */
            v.xy = induces ? less_induced(cfg, st, in->axis, 0.5f, v.xy) : v.xy;
            r.alpha = estimate.psi_Wb.alpha - cfg->observer.sigma_ls_H * i.ab.alpha;
            r.beta = estimate.psi_Wb.beta - cfg->observer.sigma_ls_H * i.ab.beta;
            v.ab = ht_lost_legs_expected(&st->lost, &cfg->observer, st->observer.rs_ohm, v, i.ab, r,
                                         cfg->observer.ts_s * st->observer.omega_sync_rad_s);
        }
        st->decided = HT_ROTOR_DOES(
            rotor, predict,
            (&cfg->observer, &st->observer, estimate, v.ab, i.ab, in->axis, &st->rotor_Wb));
        if (xy) {
            v.xy = (induces && !lost) ? less_induced(cfg, st, in->axis, 0.5f, v.xy) : v.xy;
            st->psi_xy_Wb = ht_observer_predict_xy(&cfg->observer, &st->observer, v.xy, i.xy);
        }
    } else {
        st->decided = estimate;
        st->psi_xy_Wb.x = cfg->observer.lxy_H * i.xy.x;
        st->psi_xy_Wb.y = cfg->observer.lxy_H * i.xy.y;
    }
}

/* Turn the choice into registers and remember what the legs will do. */
static void commit(const ht_control_config *cfg, ht_control_state *st, const uint16_t s[3],
                   ht_action_points p, ht_compare *out)
{
    uint16_t before = st->active.s[2];
    ht_applied *target = cfg->shadow ? &st->next : &st->active;
    ht_pattern_counts(s, p, &cfg->period, out, target);
    ht_applied_finish(target, before, &cfg->dead);
}

/* Nothing of it in x-y on average: action points, and the state words into `s`. */
static HT_INTO_CALLERS ht_action_points pull_along(ht_winding winding, unsigned direction,
                                                   uint16_t s[3])
{
    ht_action_points halves = {0.5f, 1.0f};
    ht_xy none = {0.0f, 0.0f};
    if (winding != HT_WINDING_30) {
        ht_vectors_alike(ht_large_of(winding), direction, s);
        return halves;
    }
    ht_vectors_virtual(HT_L, direction, s);
    return ht_duty(HT_L, direction, none);
}

/* Shortest zero-mean virtual vector, units of Vdc. */
#define VIRTUAL_PU 0.577f
/* Cosine and sine of 15 degrees. */
#define COSINE_15 0.9659258f
#define SINE_15 0.25881905f

/* Direction of the vector nearest to a step of the flux, HT_DIRECTIONS for a zero vector. The vector of a
 * sector lies at the sector's end, so the step is turned back by half a sector. */
static HT_INTO_CALLERS unsigned nearest(const ht_control_config *cfg, float vdc_V,
                                        ht_winding winding, ht_ab step_Wb)
{
    float half_Wb = 0.5f * VIRTUAL_PU * vdc_V * cfg->observer.ts_s;
    float size2 = step_Wb.alpha * step_Wb.alpha + step_Wb.beta * step_Wb.beta;
    ht_ab back;
    if (!(size2 > half_Wb * half_Wb)) {
        return HT_DIRECTIONS;
    }
    back.alpha = COSINE_15 * step_Wb.alpha + SINE_15 * step_Wb.beta;
    back.beta = COSINE_15 * step_Wb.beta - SINE_15 * step_Wb.alpha;
    return (winding == HT_WINDING_30) ? ht_sector(back) : ht_sector_of_six(back);
}

/* The flux build-up: action points, and the state words into `s`. `step_Wb`: of a shaft that is
 * caught, or NULL. */
static HT_INTO_CALLERS ht_action_points build_step(const ht_control_config *cfg,
                                                   const ht_control_state *st,
                                                   const ht_control_input *in, ht_winding winding,
                                                   ht_ab i, const ht_ab *step_Wb, uint16_t s[3])
{
    ht_action_points whole = {1.0f, 1.0f};
    ht_ab psi = st->decided.psi_Wb;
    float limit2 = cfg->build_current_A * cfg->build_current_A;
    float i2 = i.alpha * i.alpha + i.beta * i.beta;
    float psi2 = psi.alpha * psi.alpha + psi.beta * psi.beta;
    unsigned direction = HT_DIRECTIONS;
    if (step_Wb != NULL) {
        direction = nearest(cfg, in->vdc_V, winding, *step_Wb);
    } else if ((i2 < limit2) && (psi2 < in->flux_ref_Wb * in->flux_ref_Wb)) {
        direction = BUILD_DIRECTION;
    } else {
        /* zero vector */
    }
    if (direction < HT_DIRECTIONS) {
        return pull_along(winding, direction, s);
    }
    ht_vectors_zero(st->active.s[2], cfg->only_v0, s);
    return whole;
}

/* Of a current in x-y that is to go, the share that one period takes away. */
#define CATCH_XY_SHARE 0.25f

/* The flux step that catches a shaft, as a voltage, too. */
HT_SELDOM static ht_ab catch_step(const ht_control_config *cfg, ht_control_state *st,
                                  const ht_control_input *in, ht_vsd i, ht_vsd *v_pu)
{
    float pu_Wb = cfg->observer.inv_ts / in->vdc_V;
    float xy_pu = CATCH_XY_SHARE * cfg->observer.lxy_H * pu_Wb;
    ht_catch_input seen;
    ht_ab step_Wb;
    seen.psi_Wb = st->estimate.psi_Wb;
    seen.i_A = i.ab;
    seen.turn_rad = in->turn_rad;
    seen.flux_ref_Wb = in->flux_ref_Wb;
    seen.vdc_V = in->vdc_V;
    seen.shadow = cfg->shadow;
    step_Wb = ht_catch_step(&cfg->observer, &st->observer, &st->caught, &seen);
    v_pu->ab.alpha = pu_Wb * step_Wb.alpha;
    v_pu->ab.beta = pu_Wb * step_Wb.beta;
    v_pu->xy.x = -xy_pu * i.xy.x;
    v_pu->xy.y = -xy_pu * i.xy.y;
    return step_Wb;
}

/* The step of a drive that has all its legs, and of one that has not. A shaft is caught by the
 * modulator, or where it cannot be by the nearest vectors. */
static HT_INTO_CALLERS void step(const ht_control_config *cfg, ht_control_state *st,
                                 const ht_control_input *in, bool build, bool lost, ht_rotor rotor,
                                 bool caught, ht_winding winding, ht_compare *out)
{
    ht_vsd i = currents_of(winding, &in->i_A);
    ht_action_points p;
    ht_ab step_Wb;
    ht_vsd v;
    ht_induced seen;
    const ht_induced *induced = NULL;
    uint16_t s[3];
    observe(cfg, st, in, i, lost, rotor, caught, winding);
    if (HT_ROTOR_DOES(rotor, induces, ())) {
        st->emf_V = induced_V(cfg, st, in->axis, cfg->shadow ? 1.5f : 0.5f);
        seen.v_pu.x = st->emf_V.x / in->vdc_V;
        seen.v_pu.y = st->emf_V.y / in->vdc_V;
        seen.omega_rad_s = st->observer.omega_sync_rad_s;
        induced = &seen;
    }
    st->sector = (uint16_t)((winding == HT_WINDING_30) ? ht_sector(st->decided.psi_Wb)
                                                       : ht_sector_of_six(st->decided.psi_Wb));
    if (caught) {
        step_Wb = catch_step(cfg, st, in, i, &v);
    }
    if (build && !(caught && cfg->shadow)) {
        p = build_step(cfg, st, in, winding, i.ab, caught ? &step_Wb : NULL, s);
    } else if (caught || lost || !vector_step(cfg, st, in, i.xy, induced, s, &p)) {
        if (!caught) {
            v = wanted_pu(cfg, st, in, i, induced, lost, rotor);
        }
        modulate(cfg, st, in, winding, v, out);
        return;
    } else {
        /* p and s are known */
    }
    commit(cfg, st, s, p, out);
}

/* From the sample to the middle of a half of the carriers of a law that makes the pattern, in periods. */
#define HALF_AHEAD 2.0f

/* The step of a law that makes the pattern, of a drive that has all its legs. A function of its own, as that
 * below. */
HT_APART HT_WITH_CALLED static void pattern_step(const ht_control_config *cfg, ht_control_state *st,
                                                 const ht_control_input *in, ht_compare *out)
{
    ht_rotor rotor = cfg->observer.rotor;
    ht_vsd i = currents_of(HT_WINDING_30, &in->i_A);
    ht_voltage_law_input seen;
    ht_modulator_input given;
    uint16_t which;
    observe(cfg, st, in, i, false, rotor, false, HT_WINDING_30);
    if (HT_ROTOR_DOES(rotor, induces, ())) {
        st->emf_V = induced_V(cfg, st, in->axis, HALF_AHEAD);
    }
    st->sector = (uint16_t)ht_sector(st->decided.psi_Wb);
    machine_seen(cfg, st, in, i, rotor, &seen);
    given = modulator_seen(cfg, st, in, &which);
    switch (cfg->law) {
#define HT_VECTOR_LAW(id, law)
#define HT_VOLTAGE_LAW(id, law)
#define HT_PATTERN_LAW(id, law)                                                               \
    case HT_LAW_##id:                                                                         \
        st->v_xy_pu = ht_##law##_law_pattern(&cfg->law##_law, &cfg->observer, &st->law##_law, \
                                             &seen, &given, out, &st->next,                   \
                                             &st->toggles[which - 1u]);                       \
        break;
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    default:
        break;
    }
    st->next.own = which;
}

/* Without a leg, with another rotor, with sets that are not 30 degrees apart, or to catch a shaft. A function of
 * its own: in one with the step of a healthy induction machine each would cost the other registers. */
HT_SELDOM HT_WITH_CALLED static void special_step(const ht_control_config *cfg,
                                                  ht_control_state *st, const ht_control_input *in,
                                                  bool build, bool caught, ht_compare *out)
{
    ht_rotor rotor = cfg->observer.rotor;
    step(cfg, st, in, build, st->lost.axes != 0u, rotor, caught, cfg->observer.winding, out);
}

void ht_control_catch(const ht_control_config *cfg, ht_control_state *st,
                      const ht_control_input *in, ht_compare *out)
{
    special_step(cfg, st, in, true, true, out);
}

/* With all that it calls: how much of it the compiler would put here hangs on the size of files that
 * have nothing to do with it. */
HT_WITH_CALLED void ht_control_step(const ht_control_config *cfg, ht_control_state *st,
                                    const ht_control_input *in, bool build, ht_compare *out)
{
    if (cfg->special || (st->lost.axes != 0u)) {
        if (cfg->patterns && !build && (st->lost.axes == 0u)) {
            pattern_step(cfg, st, in, out);
        } else {
            special_step(cfg, st, in, build, false, out);
        }
    } else {
        step(cfg, st, in, build, false, HT_ROTOR_PLAIN, false, HT_WINDING_30, out);
    }
}

/* Of the current that is missing, the share that one period adds. The period before it is not in the
 * sample yet; at a quarter the current still does not overshoot. */
#define ALIGN_SHARE 0.25f
/* Most voltage that aligns, units of Vdc: legs that are limited make one in x-y, too. */
#define ALIGN_MOST_PU 0.5f

static float across_A(ht_ab u, ht_ab i)
{
    return u.alpha * i.beta - u.beta * i.alpha;
}

/* The voltage, units of Vdc, that brings the current to `most_A` and holds it there, most of it along the unit
 * vector `u` and `damping_A` across it. L_d is the least inductance that the voltage meets. */
static ht_vsd aligning_pu(const ht_control_config *cfg, ht_ab u, float most_A, float damping_A,
                          ht_vsd i, float vdc_V)
{
    const ht_observer_config *m = &cfg->observer;
    float share_pu = ALIGN_SHARE * m->inv_ts / vdc_V;
    float ab_pu = HT_ROTOR_DOES(m->rotor, d_H, (m)) * share_pu;
    float xy_pu = m->lxy_H * share_pu;
    float wanted_A = sqrtf(most_A * most_A - damping_A * damping_A);
    float along = ab_pu * (wanted_A - ht_along(u, i.ab)) + m->rs_ohm / vdc_V * wanted_A;
    float across = ab_pu * (damping_A - across_A(u, i.ab));
    float size_pu = sqrtf(along * along + across * across);
    ht_vsd v;
    if (size_pu > ALIGN_MOST_PU) {
        along *= ALIGN_MOST_PU / size_pu;
        across *= ALIGN_MOST_PU / size_pu;
    }
    v.ab.alpha = along * u.alpha - across * u.beta;
    v.ab.beta = along * u.beta + across * u.alpha;
    v.xy.x = -xy_pu * i.xy.x;
    v.xy.y = -xy_pu * i.xy.y;
    return v;
}

/* Without some of the legs. Where two legs of a set are left, the dead time keeps a small current from flowing,
 * so what damps a swing is commanded: the current that R_s would let flow. No leg carries more than the whole
 * current. */
HT_SELDOM static ht_vsd aligning_without_pu(const ht_control_config *cfg,
                                            const ht_control_state *st, ht_ab u, ht_vsd i,
                                            const ht_control_input *in)
{
    const ht_observer_config *m = &cfg->observer;
    float most_A = cfg->build_current_A;
    float own_Wb = HT_ROTOR_DOES(m->rotor, own_Wb, (m));
    float damping_A = ht_limited(-own_Wb * in->omega_rad_s / m->rs_ohm, most_A);
    float wanted_A = sqrtf(most_A * most_A - damping_A * damping_A);
    ht_ab wanted = {wanted_A * u.alpha - damping_A * u.beta,
                    wanted_A * u.beta + damping_A * u.alpha};
    float share = most_A / ht_lost_legs_most_A(&st->lost, wanted);
    ht_voltage_law_input seen;
    ht_vsd left = i;
    share = (share < 1.0f) ? share : 1.0f;
    left.xy = ht_lost_legs_across(&st->lost, i.xy);
    /* The rotor hardly turns: nothing is induced. */
    seen.psi_Wb.alpha = m->sigma_ls_H * i.ab.alpha;
    seen.psi_Wb.beta = m->sigma_ls_H * i.ab.beta;
    seen.rotor_Wb = no_voltage.ab;
    seen.turn_rad = 0.0f;
    seen.rs_ohm = m->rs_ohm;
    seen.vdc_V = in->vdc_V;
    seen.emf_V = no_voltage.xy;
    return ht_lost_legs_command(
        &st->lost, m, &seen,
        aligning_pu(cfg, u, share * most_A, share * damping_A, left, in->vdc_V));
}

void ht_control_align(const ht_control_config *cfg, ht_control_state *st,
                      const ht_control_input *in, unsigned direction, ht_compare *out)
{
    ht_winding winding = cfg->observer.winding;
    ht_vsd i = currents_of(winding, &in->i_A);
    ht_action_points p = {1.0f, 1.0f};
    float i2 = i.ab.alpha * i.ab.alpha + i.ab.beta * i.ab.beta;
    uint16_t s[3];
    st->i_A = in->i_A;
    st->i_xy_A = i.xy;
    st->observer.i_A = i.ab;
    st->flow = ht_flow_of(&in->i_A, &cfg->dead);
    st->carry.legs = 0u;
    begin_pattern(cfg, st);
    if (cfg->shadow) {
        ht_ab u = ht_twelfth(winding, direction);
        ht_vsd v = (st->lost.axes != 0u)
                       ? aligning_without_pu(cfg, st, u, i, in)
                       : aligning_pu(cfg, u, cfg->build_current_A,
                                     ht_limited(across_A(u, i.ab), cfg->build_current_A), i,
                                     in->vdc_V);
        modulate(cfg, st, in, winding, v, out);
        return;
    }
    if (i2 < cfg->build_current_A * cfg->build_current_A) {
        p = pull_along(winding, direction, s);
    } else {
        ht_vectors_zero(st->active.s[2], cfg->only_v0, s);
    }
    commit(cfg, st, s, p, out);
}
