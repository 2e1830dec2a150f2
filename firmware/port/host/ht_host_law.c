#include "ht_host_law.h"

#include <math.h>
#include <string.h>

#include "ht_limited.h"
#include "ht_winding.h"

#define PI_F 3.14159265f
#define LEG_U1 0x20u /* bit of leg 0 in a state word */

static void look(ht_host_law *h)
{
    const ht_drive *d = h->drive;
    const ht_control_state *c = &d->control;
    const ht_observer_config *machine = &d->config->control.observer;
    const float *v = d->config->params.v;
    ht_host_law_seen *seen = &h->seen;
    ht_vsd i = ht_of_winding(machine->winding, ht_vsd_from_six(&d->in.i_A));
    seen->psi_Wb = c->decided.psi_Wb;
    seen->rotor_Wb = ht_observer_predict_rotor(machine, &c->observer, c->estimate.psi_Wb, i.ab);
    seen->i_A.alpha = machine->inv_sigma_ls * (seen->psi_Wb.alpha - seen->rotor_Wb.alpha);
    seen->i_A.beta = machine->inv_sigma_ls * (seen->psi_Wb.beta - seen->rotor_Wb.beta);
    seen->i_xy_A.x = c->psi_xy_Wb.x / machine->lxy_H;
    seen->i_xy_A.y = c->psi_xy_Wb.y / machine->lxy_H;
    seen->sampled_i_A = i.ab;
    seen->sampled_i_xy_A = i.xy;
    seen->sampled_psi_Wb = c->estimate.psi_Wb;
    memcpy(seen->phases_A, d->in.i_A.p, sizeof seen->phases_A);
    seen->torque_Nm = c->decided.torque_Nm;
    seen->torque_ref_Nm = d->in.torque_ref_Nm;
    seen->flux_ref_Wb = d->in.flux_ref_Wb;
    seen->vdc_V = d->in.vdc_V;
    seen->omega_rad_s = c->observer.omega_sync_rad_s;
    seen->rotor_turn_rad = d->in.turn_rad;
    seen->speed_rad_s = d->speed_rpm * (PI_F / 30.0f);
    seen->rs_ohm = c->observer.rs_ohm;
    seen->rr_ohm = c->observer.rr_scale * v[HT_P_rr_ohm];
    seen->ts_s = machine->ts_s;
    seen->sigma_ls_H = machine->sigma_ls_H;
    seen->lxy_H = machine->lxy_H;
    seen->lm_H = v[HT_P_lm_H];
    seen->lr_H = v[HT_P_lr_H];
    seen->pole_pairs = v[HT_P_pole_pairs];
    seen->torque_limit_Nm = v[HT_P_torque_limit_Nm];
    seen->before = c->active.s[2];
}

static bool within(float value, float most)
{
    return (value >= 0.0f) && (value <= most); /* NaN is not */
}

/* Largest allowed value, and whether it must be whole. */
static float most_of(uint16_t kind, uint32_t index, bool *whole)
{
    *whole = (kind == (uint16_t)HT_RETURNS_VECTORS) && (index < 3u);
    return *whole ? 63.0f : 1.0f;
}

static ht_host_law_error check_values(ht_host_law *h)
{
    uint32_t k;
    for (k = 0u; k < (uint32_t)h->count; k++) {
        bool whole;
        float most = most_of(h->kind, k, &whole);
        if (!within(h->value[k], most) || (whole && (floorf(h->value[k]) != h->value[k]))) {
            h->index = k;
            return HT_HOST_LAW_VALUE;
        }
    }
    return HT_HOST_LAW_RIGHT;
}

static ht_host_law_error check(ht_host_law *h)
{
    int32_t wanted = (h->kind == (uint16_t)HT_RETURNS_VECTORS) ? 5 : 6;
    ht_host_law_error found;
    if (h->count < 0) {
        return HT_HOST_LAW_FAILED;
    }
    if (h->count != wanted) {
        return HT_HOST_LAW_SHAPE;
    }
    found = check_values(h);
    if ((found == HT_HOST_LAW_RIGHT) && (h->kind == (uint16_t)HT_RETURNS_VECTORS)
        && (h->value[3] > h->value[4])) {
        h->index = 3u;
        found = HT_HOST_LAW_ORDER;
    }
    return found;
}

static void vectors(const ht_host_law *h, ht_compare *out, ht_applied *next)
{
    const ht_control_config *cfg = &h->drive->config->control;
    uint16_t s[3];
    ht_action_points p;
    int n;
    for (n = 0; n < 3; n++) {
        s[n] = (uint16_t)h->value[n];
    }
    p.t1 = h->value[3];
    p.t2 = h->value[4];
    ht_pattern_counts(s, p, &cfg->period, out, next);
    ht_applied_finish(next, (uint16_t)h->seen.before, &cfg->dead);
}

/* High time that the dead time takes, a mean of both edges: half of it against the current's
 * sign, in proportion around zero. */
static float dead_share(const ht_dead_time *dead, float i_A)
{
    return 0.5f * dead->dead_pu * ht_limited(i_A / dead->i_zero_A, 1.0f);
}

/* One toggle a leg, by compare register A, as ht_modulator.h has it: the modulator's patterns
 * follow from a voltage, these from duty ratios. */
static void duties(ht_host_law *h, ht_compare *out, ht_applied *next, ht_toggles *toggles)
{
    const ht_control_config *cfg = &h->drive->config->control;
    const ht_dead_time *dead = &cfg->dead;
    uint16_t period = cfg->period.counts;
    float full = (float)period;
    float least = (float)cfg->period.shortest;
    bool falling = h->falling != 0u;
    unsigned before = (unsigned)h->seen.before;
    unsigned moves = 0u;
    unsigned high = 0u;
    unsigned rises;
    unsigned start;
    unsigned edge0;
    ht_six share;
    ht_vsd mean;
    uint16_t leg;
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        unsigned bit = LEG_U1 >> leg;
        float duty = h->value[leg];
        float on = duty + dead_share(dead, h->drive->in.i_A.p[leg]);
        /* Every edge is earlier by half the dead time. */
        float at = full * ((falling ? on : (1.0f - on)) - 0.5f * dead->dead_pu) + 0.5f;
        float can = ht_between(at, least, full - least);
        float to_rail = full * ((duty > 0.5f) ? (1.0f - duty) : duty);
        out->ca[leg] = period;
        out->cb[leg] = period;
        toggles->t[leg] = 1.0f;
        if ((can != at) && (fabsf(can - at) >= to_rail)) {
            high |= (duty > 0.5f) ? bit : 0u;
            share.p[leg] = (duty > 0.5f) ? 1.0f : 0.0f;
        } else {
            moves |= bit;
            out->ca[leg] = (uint16_t)can;
            toggles->t[leg] = (float)out->ca[leg] / full;
            share.p[leg] = falling ? toggles->t[leg] : (1.0f - toggles->t[leg]);
        }
    }
    rises = falling ? 0u : moves;
    start = high | (moves ^ rises);
    edge0 = before ^ start;
    mean = ht_vsd_from_six(&share);
    out->start = (uint16_t)start;
    next->before = (uint16_t)before;
    next->s[0] = (uint16_t)start;
    next->s[1] = (uint16_t)(high | rises);
    next->s[2] = next->s[1];
    next->t[0] = 0.0f;
    next->t[1] = 1.0f;
    next->t[2] = 1.0f;
    next->later = moves;
    next->close = 0u;
    next->rising = (edge0 & start) | rises;
    next->falling = (edge0 & before) | (moves ^ rises);
    next->mean_pu = mean;
    h->falling = (uint16_t)(falling ? 0u : 1u);
}

static void decide(ht_host_law *h)
{
    ht_drive *d = h->drive;
    ht_control_state *c = &d->control;
    ht_compare out;
    if (h->running == 0u) {
        h->running = 1u;
        h->falling = 0u;
        h->seen.period = 0u;
        if (h->size > 0u) {
            memcpy(h->memory, h->initial, h->size);
        }
    }
    look(h);
    h->count = h->step(&h->seen, h->memory, h->value);
    h->seen.period++;
    h->wrong = (uint16_t)check(h);
    if (h->wrong != (uint16_t)HT_HOST_LAW_RIGHT) {
        h->tick = d->tick;
        ht_drive_trip(d, HT_FAULT_EXTERNAL);
        return;
    }
    if (h->kind == (uint16_t)HT_RETURNS_VECTORS) {
        vectors(h, &out, &c->next);
    } else {
        uint16_t number = (c->active.own == 1u) ? 2u : 1u;
        duties(h, &out, &c->next, &c->toggles[number - 1u]);
        c->next.own = number;
    }
    ht_port_write(d->port, &out);
}

void ht_host_law_fast(ht_host_law *h)
{
    bool run = h->drive->state == (uint16_t)HT_STATE_RUN;
    ht_drive_fast_isr(h->drive);
    if (!run) {
        h->running = 0u;
    } else if (h->drive->state == (uint16_t)HT_STATE_RUN) {
        decide(h);
    } else {
        /* stopped, or a fault: the gates are off */
    }
}

void ht_host_law_slow(ht_host_law *h)
{
    ht_drive_slow_isr(h->drive);
}

void ht_host_law_channels(const ht_host_law *h, float *out)
{
    ht_channels_read(h->drive, out);
}
