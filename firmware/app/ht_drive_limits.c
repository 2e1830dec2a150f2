/* The torque limit: what parameters, flux and current allow. */
#include "ht_drive_slow.h"

#include <math.h>
#include <stddef.h>

float ht_drive_derated_A(const ht_drive *d, const ht_drive_config *c)
{
    return ht_derated_A(&d->control.lost, c->derating.rated_A);
}

/* A rotor flux below this share of the reference is no running machine's: the flux is limited then,
 * and a torque reference still chooses vectors, without a dc link for example. */
#define LEAST_ROTOR 0.1f

float ht_drive_rotor_Wb(const ht_drive *d)
{
    float least_Wb = LEAST_ROTOR * d->flux_ramp_Wb;
    return (d->protect.rotor_now_Wb > least_Wb) ? d->protect.rotor_now_Wb : least_Wb;
}

float ht_drive_follow_along(ht_drive *d, const ht_drive_config *c)
{
    ht_ab psi = d->control.estimate.psi_Wb;
    ht_ab i = d->control.observer.i_A;
    float size = sqrtf(psi.alpha * psi.alpha + psi.beta * psi.beta);
    float along_A = 0.0f;
    float rise_A;
    if (size > 0.0f) {
        along_A = (psi.alpha * i.alpha + psi.beta * i.beta) / size
                  - c->control.observer.inv_sigma_ls * (size - d->in.flux_ref_Wb);
    }
    rise_A = along_A - d->along_A;
    d->along_A = along_A;
    return (rise_A > 0.0f) ? (along_A + rise_A) : along_A;
}

static void limit_to(ht_limit *limit, float most_Nm, unsigned by)
{
    if (most_Nm < limit->most_Nm) { /* NaN limits nothing */
        limit->most_Nm = most_Nm;
        limit->by = (uint16_t)by;
    }
}

float ht_drive_load(const ht_drive *d, const ht_drive_config *c)
{
    float psi = d->flux_ramp_Wb;
    return fabsf(d->torque_ref_Nm) * c->protect.ls_H
           / (c->control.observer.torque_gain * psi * psi);
}

/* A leakage that is an estimate is up to twice as large as believed: so much of the believed pull-out
 * torque there is at least. */
#define LEAST_PULL_OUT 0.5f

/* The torque limit by the pull-out torque that the current shows, N m; `believed_Nm` where it shows
 * none. In steady state the tip of the current lies on a circle through that of the no-load current.
 * Its distance from there, along and across the flux and as torques, tells the radius whatever the
 * leakage is: (along + across^2/along)/2. This radius is the pull-out torque. */
static float shown_pull_out_Nm(const ht_drive *d, const ht_drive_config *c, float believed_Nm)
{
    ht_ab psi = d->control.estimate.psi_Wb;
    ht_ab i = d->control.observer.i_A;
    float across_Nm = d->control.estimate.torque_Nm;
    float ls_H = c->protect.ls_H;
    float along_Nm =
        c->control.observer.torque_gain / ls_H
        * (psi.alpha * (ls_H * i.alpha - psi.alpha) + psi.beta * (ls_H * i.beta - psi.beta));
    float least_Nm = LEAST_PULL_OUT * believed_Nm;
    float shown_Nm = believed_Nm;
    /* On the circle (sin t across, 1 - cos t along) `along` is 0.4 radii where `across` is 0.8. Far
     * below that noise would decide. */
    if (along_Nm > (0.5f * least_Nm)) {
        shown_Nm = HT_PULL_OUT_SHARE * 0.5f * (along_Nm + across_Nm * across_Nm / along_Nm);
        shown_Nm = (shown_Nm > least_Nm) ? shown_Nm : least_Nm;
    }
    return shown_Nm;
}

/* What the parameters allow, and what flux and current can give. The rotor flux is between now and the
 * next slow interrupt on its way from what it is to what it settles at, and at a given torque the
 * current is largest at one end of this way. */
static ht_limit torque_limit(const ht_drive *d, const ht_drive_config *c, float most_A,
                             float along_A)
{
    ht_limit limit = {c->params.v[HT_P_torque_limit_Nm], (uint16_t)HT_LIMIT_TORQUE};
    float flux_ref = d->flux_ref_Wb;
    unsigned flux = (flux_ref < d->flux_ramp_Wb) ? (unsigned)HT_LIMIT_VOLTAGE
                                                 : (unsigned)HT_LIMIT_FLUX;
    float pull_out_Nm = c->pull_out_Nm_Wb2 * flux_ref * flux_ref;
    limit_to(&limit, pull_out_Nm, flux);
    /* Only a weakened flux: the pull-out of a full one is far beyond the rated torque, and a current
     * along it may as well be that of an inductance that is believed too large. */
    if (flux == (unsigned)HT_LIMIT_VOLTAGE) {
        limit_to(&limit, shown_pull_out_Nm(d, c, pull_out_Nm), flux);
    }
    if ((c->params.v[HT_P_flux_least_loss] != 0.0f)
        && (d->flux_ramp_Wb < c->params.v[HT_P_flux_ref_Wb])) {
        limit_to(&limit, c->least_loss.reach_Nm_Wb2 * flux_ref * flux_ref, HT_LIMIT_FLUX);
    }
    limit_to(&limit, ht_derated_Nm(&c->derating, most_A, flux_ref), HT_LIMIT_CURRENT);
    limit_to(&limit, ht_derated_now_Nm(&c->derating, most_A, flux_ref, ht_drive_rotor_Wb(d)),
             HT_LIMIT_CURRENT);
    /* The same from what is measured: the current along the flux, one slow period on. */
    limit_to(&limit, ht_derated_beside_Nm(&c->derating, most_A, flux_ref, along_A),
             HT_LIMIT_CURRENT);
    if (d->off_legs != 0u) {
        /* While the flux goes down to its new limit, that one counts: currents above the rated one
         * for a while harm nothing, a drive without torque may. */
        float i_A = ht_drive_derated_A(d, c);
        float most_Wb = ht_derated_Wb(&c->derating, i_A);
        limit_to(
            &limit,
            ht_derated_Nm(&c->derating, i_A, (d->flux_ref_Wb < most_Wb) ? d->flux_ref_Wb : most_Wb),
            HT_LIMIT_LEGS);
    }
    return limit;
}

void ht_drive_limit_torque(ht_drive *d, const ht_drive_config *c)
{
    ht_limit limit;
    float most_A = ht_derated_most_A(&c->derating, (d->off_legs != 0u) ? &d->control.lost : NULL,
                                     d->in.vdc_V, d->flux_ref_Wb);
    d->flux_ref_Wb = ht_derated_flux_Wb(&c->derating, most_A, d->flux_ref_Wb, ht_drive_rotor_Wb(d));
    /* The flux may be on its way down: the torque goes first. */
    limit = torque_limit(d, c, most_A, ht_drive_follow_along(d, c));
    d->torque_limited_by = limit.by;
    d->torque_limit_Nm = d->heat_share * limit.most_Nm;
}

/* Limits that more flux may move. */
#define OF_THE_MACHINE                                                                 \
    ((unsigned)HT_LIMIT_VOLTAGE | (unsigned)HT_LIMIT_FLUX | (unsigned)HT_LIMIT_CURRENT \
     | (unsigned)HT_LIMIT_LEGS)

ht_least_loss_input ht_drive_loses(const ht_drive *d)
{
    ht_least_loss_input in;
    in.torque_ref_Nm = d->torque_ref_Nm;
    in.torque_Nm = d->control.estimate.torque_Nm;
    in.omega_rad_s = d->omega_mean_rad_s;
    in.rs_ohm = d->control.observer.rs_ohm;
    in.rr_scale = d->control.observer.rr_scale;
    in.limited = (d->limits & OF_THE_MACHINE) != 0u;
    return in;
}
