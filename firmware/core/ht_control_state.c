/* The control's state: where a run begins, and what a lost leg or another configuration changes in it. */
#include "ht_control.h"

#include "ht_vsd.h"
#include "ht_winding.h"

/* The states of all laws. */
static void law_reset(ht_control_state *st)
{
#define HT_VECTOR_LAW(id, law) ht_##law##_law_reset(&st->law##_law);
#define HT_VOLTAGE_LAW HT_VECTOR_LAW
#define HT_PATTERN_LAW HT_VECTOR_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    ht_modulator_reset(&st->modulator);
}

/* All low, no edge. */
static void low_from_the_start(ht_applied *a, const ht_dead_time *dead)
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
        out->ca[leg] = cfg->period.counts;
        out->cb[leg] = cfg->period.counts;
    }
}

void ht_control_reset(const ht_control_config *cfg, ht_control_state *st, const ht_six *i_A)
{
    ht_vsd i = ht_of_winding(cfg->observer.winding, ht_vsd_from_six(i_A));
    ht_observer_reset(&cfg->observer, &st->observer, i.ab);
    low_from_the_start(&st->active, &cfg->dead);
    low_from_the_start(&st->next, &cfg->dead);
    st->carry.legs = 0u;
    st->i_A = *i_A;
    st->flow = ht_flow_of(i_A, &cfg->dead);
    st->estimate.psi_Wb = st->observer.psi_Wb;
    st->estimate.torque_Nm = 0.0f;
    st->decided = st->estimate;
    st->i_xy_A = i.xy;
    st->psi_xy_Wb.x = 0.0f;
    st->psi_xy_Wb.y = 0.0f;
    st->v_xy_pu.x = 0.0f;
    st->v_xy_pu.y = 0.0f;
    st->sector = 0u;
    st->rotor_Wb = st->observer.psi_Wb;
    st->emf_V = st->v_xy_pu;
    ht_leg_loss_reset(&st->leg_loss);
    st->lost.axes = 0u;
    law_reset(st);
}

bool ht_control_can_lose(const ht_control_config *cfg)
{
    return cfg->shadow && cfg->predict;
}

uint16_t ht_control_lose(const ht_control_config *cfg, ht_control_state *st, uint16_t legs,
                         float set2_ohm)
{
    uint16_t off = ht_lost_legs_of(cfg->observer.winding, legs, &st->lost);
    float more_ohm = st->leg_loss.more_ohm; /* the machine has it without the leg, too */
    uint16_t n;
    ht_lost_legs_differ(&st->lost, set2_ohm);
    for (n = 0u; (st->leg_loss.found != 0u) && (n < st->lost.axes); n++) {
        const ht_lost_axis *x = &st->lost.axis[n];
        float sum_V = x->b.x * st->leg_loss.sum_V.x + x->b.y * st->leg_loss.sum_V.y;
        st->observer.psi_Wb.alpha += cfg->observer.ts_s * sum_V * x->a.alpha;
        st->observer.psi_Wb.beta += cfg->observer.ts_s * sum_V * x->a.beta;
    }
    ht_leg_loss_reset(&st->leg_loss);
    st->leg_loss.more_ohm = more_ohm;
    st->leg_loss.without = off;
    st->leg_loss.wait = cfg->leg_loss.wait; /* diodes carry what flowed in these legs */
    return off;
}

void ht_control_switch_over(const ht_control_config *from, const ht_control_config *cfg,
                            ht_control_state *st)
{
    if (from->law != cfg->law) {
        law_reset(st);
    }
}

void ht_control_catch_begin(const ht_control_config *cfg, ht_control_state *st, const ht_six *i_A)
{
    ht_observer_state flux = st->observer;
    ht_control_reset(cfg, st, i_A);
    st->observer.psi_Wb = flux.psi_Wb;
    st->observer.psi_r_Wb = flux.psi_r_Wb;
    st->observer.rs_ohm = flux.rs_ohm;
    st->observer.rr_scale = flux.rr_scale;
    st->observer.more_Wb = flux.more_Wb;
    st->estimate.psi_Wb = flux.psi_Wb;
    st->decided = st->estimate;
    ht_catch_begin(&st->caught, flux.psi_Wb);
}
