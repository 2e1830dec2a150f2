/* The references of a machine with magnets in RUN. */
#include "ht_drive_slow.h"

#include <math.h>
#include <stddef.h>

/* Voltage that is there to turn the flux. */
static float turning_V(const ht_drive *d, const ht_drive_config *c, float most_A)
{
    return (d->off_legs == 0u) ? (c->flux.reach_pu * d->in.vdc_V)
                               : ht_derated_V(&c->derating, d->in.vdc_V, d->control.observer.rs_ohm,
                                              d->control.observer.omega_sync_rad_s, most_A);
}

/* With magnets: the largest flux that the voltage turns with this torque and the parameter allows, but no
 * less than the current can lower it to. */
static float most_flux_Wb(const ht_drive *d, const ht_drive_config *c, float most_A,
                          float torque_Nm)
{
    const ht_magnet_config *m = &c->control.observer.magnet;
    float least_Wb = m->psi_f_Wb - m->ld_H * most_A;
    float most_Wb = c->params.v[HT_P_flux_ref_Wb];
    if (c->params.v[HT_P_field_weakening] != 0.0f) {
        /* The drop of a torque that brakes would leave voltage for more flux. It is not there yet while the
         * torque rises, and is less than believed with a cold winding. Where the voltage lacks, the flux
         * stays behind the magnets, which is more torque than asked, up to beyond the pull-out. */
        float omega_rad_s = d->control.observer.omega_sync_rad_s;
        bool drives = (torque_Nm * omega_rad_s) > 0.0f;
        float turned_Wb = ht_magnet_turned_Wb(turning_V(d, c, most_A), omega_rad_s,
                                              d->control.observer.rs_ohm, drives ? torque_Nm : 0.0f,
                                              m->torque_gain);
        most_Wb = ht_smaller(turned_Wb, most_Wb);
    }
    least_Wb = (least_Wb > c->flux.flux_min_Wb) ? least_Wb : c->flux.flux_min_Wb;
    return (most_Wb > least_Wb) ? most_Wb : least_Wb;
}

/* Each halves the range in which the torque limit is searched for. */
#define LIMIT_ROUNDS 8

/* With magnets: the largest torque whose own flux lets it be. More torque takes more of the voltage and
 * leaves less flux, so that a limit at the flux of the torque before would swing from tick to tick. */
static ht_limit magnet_limit(const ht_drive *d, const ht_drive_config *c, float most_A)
{
    unsigned by = (d->off_legs != 0u) ? (unsigned)HT_LIMIT_LEGS : (unsigned)HT_LIMIT_CURRENT;
    ht_limit limit = {0.0f, (uint16_t)by};
    const ht_magnet_config *m = &c->control.observer.magnet;
    float sign = (d->torque_ref_Nm < 0.0f) ? -1.0f : 1.0f;
    float most_Nm = c->params.v[HT_P_torque_limit_Nm];
    float step_Nm;
    float limit_Nm = 0.0f;
    int n;
    if (c->params.v[HT_P_field_weakening] != 0.0f) {
        most_Nm = ht_smaller(ht_magnet_driven_Nm(turning_V(d, c, most_A),
                                                 sign * d->control.observer.omega_sync_rad_s,
                                                 d->control.observer.rs_ohm, m->torque_gain),
                             most_Nm);
    }
    step_Nm = most_Nm;
    for (n = 0; n <= LIMIT_ROUNDS; n++) {
        float tried_Nm = limit_Nm + step_Nm;
        float flux_Wb = most_flux_Wb(d, c, most_A, sign * tried_Nm);
        if ((tried_Nm <= most_Nm) && (ht_magnet_most_Nm(m, most_A, flux_Wb) >= tried_Nm)) {
            limit_Nm = tried_Nm;
        }
        step_Nm *= 0.5f;
    }
    limit.most_Nm = limit_Nm;
    if (limit_Nm >= c->params.v[HT_P_torque_limit_Nm]) {
        limit.by = (uint16_t)HT_LIMIT_TORQUE;
    } else if (limit_Nm >= most_Nm) {
        limit.by = (uint16_t)HT_LIMIT_VOLTAGE;
    } else {
        /* the current, at the flux that the voltage leaves */
    }
    return limit;
}

/* The flux that costs the least loss, or `least_Wb`, that of the least current. Iron wants less flux: that
 * takes more current, of which there must be enough for this torque and for the one kept in reserve. */
static float economic_Wb(ht_drive *d, const ht_drive_config *c, float most_A, float least_Wb)
{
    const ht_magnet_config *m = &c->control.observer.magnet;
    const float *v = c->params.v;
    float need_Nm = fabsf(d->torque_ref_Nm);
    ht_least_loss_input in;
    float iron_W_Wb2;
    float torque_Nm;
    float flux_Wb;
    if ((v[HT_P_flux_least_loss] == 0.0f) || (d->off_legs != 0u)) { /* without a leg as ramp_flux */
        ht_least_loss_reset(&d->least_loss, least_Wb);
        return least_Wb;
    }
    in = ht_drive_loses(d);
    iron_W_Wb2 = ht_least_loss_iron_W_Wb2(&c->least_loss, in.omega_rad_s);
    torque_Nm = ht_least_loss_torque_Nm(&c->least_loss, &d->least_loss, &in);
    /* Not the adapted R_s: a standstill without load teaches a wrong one, which stays at speed. */
    flux_Wb =
        ht_magnet_flux_Wb(m, ht_magnet_least_loss_A(m, v[HT_P_rs_ohm], iron_W_Wb2, torque_Nm));
    need_Nm = (need_Nm > v[HT_P_flux_reserve_Nm]) ? need_Nm : v[HT_P_flux_reserve_Nm];
    flux_Wb = ht_magnet_needed_Wb(m, most_A, need_Nm, flux_Wb, least_Wb);
    return ht_least_loss_follow(&c->least_loss, &d->least_loss, in.limited, flux_Wb, least_Wb);
}

void ht_magnet_refer(ht_drive *d, const ht_drive_config *c)
{
    const ht_magnet_config *m = &c->control.observer.magnet;
    float most_A = (d->off_legs != 0u)
                       ? ht_drive_derated_A(d, c)
                       : ht_derated_most_A(&c->derating, NULL, d->in.vdc_V, m->psi_f_Wb);
    ht_limit limit;
    float flux_Wb;
    limit = magnet_limit(d, c, most_A);
    d->torque_limited_by = limit.by;
    d->torque_limit_Nm = d->heat_share * limit.most_Nm;
    ht_drive_follow_reference(d, c);
    flux_Wb = ht_smaller(ht_magnet_flux_Wb(m, ht_magnet_least_A(m, d->torque_ref_Nm)),
                         most_flux_Wb(d, c, most_A, d->torque_ref_Nm));
    d->flux_ref_Wb = economic_Wb(d, c, most_A, flux_Wb);
}
