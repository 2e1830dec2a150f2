#include "ht_derating.h"

#include "ht_rotor_rules.h"
#include "ht_schemes.h"
#include "ht_tables.h"

#include <math.h>
#include <stddef.h>

#define ROOT_2 1.41421356f
/* Current in alpha-beta over the amplitude of the most loaded phase. The amplitude of a phase at phi
 * is |exp(-j phi) - (1 + g)/2 exp(j(4 theta - 5 phi)) - s (1 - g)/2 exp(j 5 phi)| times that current,
 * with s = 1 for a leg of set 1 and -1 for one of set 2. g is the share of the current across the
 * lost leg's axis that flows in x-y, too. */
#define ONE_LEG 0.554700196f /* g = 0: 2/sqrt(13) */
/* Sets 0 or 60 degrees apart, any g: a leg along the same axis carries twice the current. */
#define ONE_LEG_ALIKE 0.5f
#define TWO_LEGS 0.577350269f /* 90 degrees apart, g = 1: 1/sqrt(3) */
#define WITHOUT_SET 0.5f
/* Share of `i_trip_A` that is asked for at most; the rest is for the ripple. */
#define MOST_SHARE 0.8f
/* Share of the current that raises the flux at most. What is across it: sqrt(1 - 0.9^2). */
#define RISING_SHARE 0.9f

static void configure_ripple(const float *v, ht_derating_config *c)
{
    const ht_scheme_info *scheme = ht_scheme_describe((uint16_t)v[HT_P_scheme]);
    bool bands = scheme->torque_levels != 0u;
    ht_winding winding = ht_winding_of(v);
    c->ripple_A_V = (ht_longest_pu(winding) / v[HT_P_sigma_ls_H]
                     + ht_scheme_xy_step_pu(scheme, winding) / v[HT_P_lxy_H])
                    / v[HT_P_f_isr_Hz];
    c->flux_band_A = bands ? (v[HT_P_flux_band_Wb] / v[HT_P_sigma_ls_H]) : 0.0f;
    c->torque_band_Nm = bands ? v[HT_P_torque_band_Nm] : 0.0f;
}

void ht_derating_configure(const ht_params *p, const ht_control_config *control,
                           ht_derating_config *c)
{
    const float *v = p->v;
    const ht_observer_config *machine = &control->observer;
    float sigma;
    c->ls_H = v[HT_P_sigma_ls_H] + v[HT_P_lm_H] * v[HT_P_lm_H] / v[HT_P_lr_H];
    sigma = v[HT_P_sigma_ls_H] / c->ls_H;
    c->sigma_ls_H = v[HT_P_sigma_ls_H];
    c->lxy_H = v[HT_P_lxy_H];
    c->left_pu = v[HT_P_fw_margin] * ht_control_left_pu(control);
    c->rated_A = ROOT_2 * v[HT_P_i_rated_A];
    c->trip_A = v[HT_P_i_trip_A];
    c->lean = sigma / (1.0f + sigma);
    c->best_Wb_A = c->ls_H * sqrtf(0.5f - c->lean + c->lean * c->lean) / (1.0f - c->lean);
    c->torque_gain = 3.0f * v[HT_P_pole_pairs];
    c->limit_A = HT_ROTOR_DOES(machine->rotor, limit_A, (c, machine, v));
    configure_ripple(v, c);
}

float ht_derated_A(const ht_lost_legs *lost, float phase_A)
{
    float part = TWO_LEGS;
    if (lost->set) {
        part = WITHOUT_SET;
    } else if (lost->axes == 1u) {
        part = (lost->winding == HT_WINDING_30) ? ONE_LEG : ONE_LEG_ALIKE;
    } else {
        /* as it is */
    }
    return part * phase_A;
}

float ht_derated_most_A(const ht_derating_config *c, const ht_lost_legs *lost, float vdc_V,
                        float flux_Wb)
{
    float most_A = c->trip_A - c->ripple_A_V * vdc_V - c->flux_band_A
                   - c->torque_band_Nm / (c->torque_gain * flux_Wb);
    float share_A = MOST_SHARE * c->trip_A;
    float least_A = (lost != NULL) ? c->rated_A : c->limit_A;
    most_A = (most_A < share_A) ? most_A : share_A;
    most_A = (most_A > least_A) ? most_A : least_A;
    return (lost != NULL) ? ht_derated_A(lost, most_A) : most_A;
}

float ht_derated_V(const ht_derating_config *c, float vdc_V, float rs_ohm, float omega_rad_s,
                   float i_A)
{
    float x_ohm = omega_rad_s * c->lxy_H;
    float left_V = c->left_pu * vdc_V - sqrtf(rs_ohm * rs_ohm + x_ohm * x_ohm) * i_A;
    return (left_V > 0.0f) ? left_V : 0.0f;
}

float ht_derated_Wb(const ht_derating_config *c, float i_A)
{
    return c->best_Wb_A * i_A;
}

float ht_derated_Nm(const ht_derating_config *c, float i_A, float flux_Wb)
{
    /* In units of psi/L_s: (q - c)^2 + t^2 = (c - 1)^2 and q^2 + t^2 = i^2. */
    float unit_A = flux_Wb / c->ls_H;
    float i2 = (i_A / unit_A) * (i_A / unit_A);
    float q = 1.0f + c->lean * (i2 - 1.0f);
    float centre = 0.5f / c->lean;
    float t2 = i2 - q * q;
    if (q > centre) { /* beyond the top */
        t2 = (centre - 1.0f) * (centre - 1.0f);
    }
    return (t2 > 0.0f) ? (c->torque_gain * flux_Wb * unit_A * sqrtf(t2)) : 0.0f;
}

float ht_derated_now_Nm(const ht_derating_config *c, float i_A, float flux_Wb, float rotor_Wb)
{
    float across_Wb = c->sigma_ls_H * i_A;
    float flux2 = flux_Wb * flux_Wb;
    float rotor2 = rotor_Wb * rotor_Wb;
    float dot = 0.5f * (flux2 + rotor2 - across_Wb * across_Wb);
    float area2 = flux2 * rotor2; /* of the parallelogram; at a right angle it is largest */
    if (dot > 0.0f) {
        area2 -= dot * dot;
    }
    return (area2 > 0.0f) ? (c->torque_gain / c->sigma_ls_H * sqrtf(area2)) : 0.0f;
}

float ht_derated_beside_Nm(const ht_derating_config *c, float i_A, float flux_Wb, float along_A)
{
    float across2 = i_A * i_A - along_A * along_A;
    return (across2 > 0.0f) ? (c->torque_gain * flux_Wb * sqrtf(across2)) : 0.0f;
}

float ht_derated_flux_Wb(const ht_derating_config *c, float i_A, float flux_Wb, float rotor_Wb)
{
    float across_Wb = c->sigma_ls_H * i_A;
    float most = rotor_Wb + RISING_SHARE * across_Wb;
    float least = rotor_Wb - across_Wb;
    if (flux_Wb > most) {
        return most;
    }
    return (flux_Wb < least) ? least : flux_Wb;
}
