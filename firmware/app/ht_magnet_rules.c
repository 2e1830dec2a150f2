#include "ht_magnet_rules.h"

#include "ht_absolute.h"
#include "ht_angle.h"
#include "ht_misfit.h"

#include <math.h>

#define PI_F 3.14159265f

bool ht_magnet_learns_rs(const float *v)
{
    (void)v;
    return false;
}

float ht_magnet_reserve_Wb(const float *v, float reach_Nm_Wb2)
{
    (void)v;
    (void)reach_Nm_Wb2;
    return 0.0f;
}

/* A harmonic of the induced voltage, over the electrical speed. */
static ht_ab harmonic(float psi_f_Wb, float share, float deg)
{
    ht_ab unit = ht_unit(((deg < 0.0f) ? (deg + 360.0f) : deg) / 360.0f);
    unit.alpha *= psi_f_Wb * share;
    unit.beta *= psi_f_Wb * share;
    return unit;
}

void ht_magnet_configure(const float *v, ht_observer_config *c)
{
    ht_magnet_config *m = &c->magnet;
    float in_xy;
    m->psi_f_Wb = v[HT_P_psi_f_Wb];
    m->inv_psi_f = 1.0f / m->psi_f_Wb;
    m->ld_H = v[HT_P_ld_H];
    m->lq_H = v[HT_P_sigma_ls_H];
    m->inv_ld = 1.0f / m->ld_H;
    m->saliency_H = m->ld_H - m->lq_H;
    m->share = m->saliency_H * m->inv_ld;
    m->torque_gain = c->torque_gain;
    /* Else they are in alpha-beta. */
    in_xy = (c->winding == HT_WINDING_30) ? 1.0f : 0.0f;
    m->emf5_Wb = harmonic(in_xy * m->psi_f_Wb, v[HT_P_emf5_share], v[HT_P_emf5_deg]);
    m->emf7_Wb = harmonic(in_xy * m->psi_f_Wb, v[HT_P_emf7_share], v[HT_P_emf7_deg]);
}

bool ht_magnet_fits(const float *v, uint16_t misfit)
{
    const ht_scheme_info *row = ht_scheme_describe((uint16_t)v[HT_P_scheme]);
    float omega = v[HT_P_speed_trip_rpm] * v[HT_P_pole_pairs] * (PI_F / 30.0f);
    float terminal_Wb =
        ht_magnet_terminal_Wb(v[HT_P_psi_f_Wb], v[HT_P_emf5_share], v[HT_P_emf7_share]);
    bool result = true;
    switch ((ht_misfit)misfit) {
    case HT_MISFIT_SALIENCY:
        result = v[HT_P_ld_H] <= v[HT_P_sigma_ls_H];
        break;
    case HT_MISFIT_CEILING:
        result = (v[HT_P_trip_state] != 0.0f) || (terminal_Wb * omega <= v[HT_P_vdc_max_V]);
        break;
    case HT_MISFIT_RIDE_SHORT:
        result = (v[HT_P_ride_through] == 0.0f) || (v[HT_P_trip_state] == 0.0f);
        break;
    case HT_MISFIT_ABSOLUTE:
        result = (v[HT_P_rotor_start] != HT_ROTOR_START_ABSOLUTE)
                 || (v[HT_P_absolute_counts_rev] >= ht_absolute_least(v[HT_P_pole_pairs]));
        break;
    case HT_MISFIT_LEAST_LOSS:
        result = (v[HT_P_flux_least_loss] == 0.0f) || (v[HT_P_iron_hysteresis_A_Wb] > 0.0f)
                 || (v[HT_P_iron_eddy_S] > 0.0f);
        break;
    case HT_MISFIT_FLUX_BRAKE:
        result = false;
        break;
    case HT_MISFIT_XY_STEP:
    default:
        result = ht_scheme_regulates_xy(row)
                 || (ht_scheme_xy_step_pu(row, ht_winding_of(v)) * v[HT_P_vdc_max_V]
                     <= v[HT_P_i_trip_A] * v[HT_P_lxy_H] * v[HT_P_f_isr_Hz]);
        break;
    }
    return result;
}

/* The shaft may go on to rise beyond the speed at which the drive trips. */
#define BEYOND_TRIP 1.1f

float ht_magnet_trip_short_A(const ht_params *p)
{
    const float *v = p->v;
    float omega = BEYOND_TRIP * v[HT_P_speed_trip_rpm] * v[HT_P_pole_pairs] * (PI_F / 30.0f);
    ht_magnet_config m;
    m.psi_f_Wb = v[HT_P_psi_f_Wb];
    m.ld_H = v[HT_P_ld_H];
    m.lq_H = v[HT_P_sigma_ls_H];
    m.inv_ld = 1.0f / m.ld_H;
    return ht_magnet_short_A(&m, v[HT_P_rs_ohm], omega,
                             v[HT_P_torque_limit_Nm] / (3.0f * v[HT_P_pole_pairs] * m.psi_f_Wb));
}

bool ht_magnet_bears_short(const ht_params *p)
{
    return p->v[HT_P_magnets_bear_A] >= ht_magnet_trip_short_A(p);
}

/* The least that makes this torque. */
float ht_magnet_limit_A(const ht_derating_config *c, const ht_observer_config *machine,
                        const float *v)
{
    ht_dq i = ht_magnet_least_A(&machine->magnet, v[HT_P_torque_limit_Nm]);
    (void)c;
    return sqrtf(i.d * i.d + i.q * i.q);
}

void ht_magnet_configure_protect(const float *v, ht_protect_config *c)
{
    c->inv_psi_f = 1.0f / v[HT_P_psi_f_Wb];
}

uint16_t ht_magnet_protect(const ht_protect_config *cfg, ht_protect_state *st,
                           const ht_control_state *c, float speed_rpm)
{
    ht_ab gap = c->observer.gap_Wb;
    float off2 = cfg->inv_psi_f * cfg->inv_psi_f * (gap.alpha * gap.alpha + gap.beta * gap.beta);
    (void)speed_rpm;
    return ht_protect_flux(cfg, st, off2);
}
