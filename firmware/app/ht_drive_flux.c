/* The references of an induction machine in RUN. */
#include "ht_drive_slow.h"

#include "ht_limited.h"

#include <math.h>
#include <stddef.h>

/* Below the first speed of the flux R_r has no visible effect. From the load HT_LOWER_LOAD on,
 * R_r matters, and the flux is lowered to the share below until its speed is above
 * HT_TURNING_RAD_S. Lowering it increases the slip of a rated load, 9.4 rad/s, by 1.7 rad/s: that limit
 * lies above 2.5 + 1.7, or the drive would switch back and forth. */
#define STANDING_RAD_S 2.5f
#define LOWER_FLUX 0.92f

/* Where load and speed make the flux stand still, R_r cannot be observed, and a drive with a wrong
 * R_r may settle at that very point: more flux, less slip, standstill of the flux. A little less
 * flux gives more slip, and the flux turns again. */
static void keep_off_zero_frequency(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    float size;
    size = (d->omega_mean_rad_s < 0.0f) ? -d->omega_mean_rad_s : d->omega_mean_rad_s;
    if ((c->control.observer.kind != HT_OBSERVER_HYBRID) || !(v[HT_P_adapt_s] > 0.0f)
        || (ht_drive_load(d, c) < HT_LOWER_LOAD) || (size > HT_TURNING_RAD_S)) {
        d->flux_lowered = 0u;
    } else if (size < STANDING_RAD_S) {
        d->flux_lowered = 1u;
    } else {
        /* as it was */
    }
}

/* After the loss of a leg the flux takes this share of the steps: each of them shows in the currents,
 * which are larger then. */
#define DERATING_STEP 0.2f

/* The flux without weakening and derating: the parameter's, or less where that costs less. A drive
 * without a leg keeps the parameter's: its losses and its reserve are other ones. */
static float wanted_Wb(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    float most_Wb = v[HT_P_flux_ref_Wb];
    ht_least_loss_input in;
    if ((v[HT_P_flux_least_loss] == 0.0f) || (d->off_legs != 0u)) {
        ht_least_loss_reset(&d->least_loss, most_Wb);
        return most_Wb;
    }
    in = ht_drive_loses(d);
    return ht_least_loss_step(&c->least_loss, &d->least_loss, &in, most_Wb);
}

/* The flux that brakes, or `normal_Wb`. */
static float braking_Wb(ht_drive *d, const ht_drive_config *c, float normal_Wb)
{
    ht_flux_brake_input in;
    in.limits = ((unsigned)d->limits & (unsigned)HT_LIMIT_VDC_HIGH) != 0u;
    in.may = (d->off_legs == 0u) && (d->flux_lowered == 0u) && !(d->heat_share < 1.0f);
    in.torque_share = fabsf(d->in.torque_ref_Nm) / d->torque_limit_Nm;
    in.flux_Wb = d->flux_ref_Wb;
    in.along_A = d->along_A;
    in.most_A = ht_derated_most_A(&c->derating, NULL, d->in.vdc_V, d->flux_ref_Wb);
    in.off2 = (d->protect.off2 > d->protect.circle2) ? d->protect.off2 : d->protect.circle2;
    in.turns_V = c->flux.reach_pu * d->in.vdc_V;
    in.omega_rad_s = d->omega_mean_rad_s;
    return ht_flux_brake_step(&c->flux_brake, &d->flux_brake, &in, normal_Wb);
}

/* A new flux reference is approached as fast as in the build-up. The rotor's flux could not follow
 * a step of the stator's. */
static void ramp_flux(ht_drive *d, const ht_drive_config *c)
{
    const float *v = c->params.v;
    float wanted = wanted_Wb(d, c) * ((d->flux_lowered != 0u) ? LOWER_FLUX : 1.0f);
    float share = 1.0f;
    float larger;
    float step;
    float missing;
    wanted = braking_Wb(d, c, wanted);
    if (d->off_legs != 0u) {
        float most = ht_derated_Wb(&c->derating, ht_drive_derated_A(d, c));
        wanted = (most < wanted) ? most : wanted;
        share = DERATING_STEP;
    }
    larger = (wanted > d->flux_ramp_Wb) ? wanted : d->flux_ramp_Wb;
    step = share * larger / (v[HT_P_build_s] * v[HT_P_f_slow_Hz]);
    missing = wanted - d->flux_ramp_Wb;
    d->flux_ramp_Wb += ht_limited(missing, step);
}

/* Speed of the flux over the shaft's, at least: the slip of a machine that brakes. */
#define BRAKING_SHARE 0.95f

/* The flux reference: the ramp, or what Vdc can drive of it. */
static float weakened_Wb(const ht_drive *d, const ht_drive_config *c)
{
    ht_flux_input flux;
    ht_ab i = d->control.observer.i_A;
    float a = (i.alpha < 0.0f) ? -i.alpha : i.alpha;
    float b = (i.beta < 0.0f) ? -i.beta : i.beta;
    float omega_rad_s = d->control.observer.omega_sync_rad_s;
    float least_rad_s;
    if (c->params.v[HT_P_field_weakening] == 0.0f) {
        return d->flux_ramp_Wb;
    }
    /* |i| within 4 %: alpha max plus beta min */
    flux.i_A = (a > b) ? (0.96f * a + 0.398f * b) : (0.96f * b + 0.398f * a);
    flux.flux_Wb = d->flux_ramp_Wb;
    flux.vdc_V = d->in.vdc_V;
    /* A step of the torque turns the flux back for a moment, and the shaft does not take part in that: a
     * flux reference that did would rise beyond the voltage, and the torque be lost. */
    least_rad_s = BRAKING_SHARE * fabsf(d->speed_rpm)
                  * (c->params.v[HT_P_pole_pairs] * HT_RAD_S_PER_RPM);
    flux.omega_sync_rad_s = (fabsf(omega_rad_s) > least_rad_s) ? omega_rad_s : least_rad_s;
    return ht_flux_reference(&c->flux, &flux);
}

void ht_induction_refer(ht_drive *d, const ht_drive_config *c)
{
    keep_off_zero_frequency(d, c);
    ramp_flux(d, c);
    d->flux_ref_Wb = weakened_Wb(d, c);
    ht_drive_limit_torque(d, c);
    ht_drive_follow_reference(d, c);
}

float ht_induction_across_A(const ht_drive *d, const ht_drive_config *c)
{
    return d->torque_ref_Nm / (c->control.observer.torque_gain * ht_drive_rotor_Wb(d));
}
