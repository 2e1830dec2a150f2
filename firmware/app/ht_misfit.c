#include "ht_misfit.h"

#include "ht_absolute.h"
#include "ht_lost_legs.h"
#include "ht_rotor_rules.h"
#include "ht_ntc.h"
#include "ht_schemes.h"
#include "port.h"

#include <math.h>
#include <stddef.h>

#define PI_F 3.14159265f
#define LEAST_LOOKS 50.0f /* at the torque's ripple, in its time constant */
#define ROOT_3 1.73205081f

static const ht_misfit_info table[] = {
#define HT_ORDER(id, less, share, more, touch) {HT_P_##less, HT_P_##more, share, touch != 0},
#define HT_RULE(id, first, second, text) {HT_P_##first, HT_P_##second, 0.0f, false},
#include "ht_misfits.def"
#undef HT_ORDER
#undef HT_RULE
};

const ht_misfit_info *ht_misfit_describe(uint16_t misfit)
{
    bool known = (misfit > (uint16_t)HT_MISFIT_NONE) && (misfit < (uint16_t)HT_MISFITS);
    return known ? &table[misfit - 1u] : NULL;
}

static bool in_order(const float *v, const ht_misfit_info *row)
{
    float limit = row->share * v[row->second];
    return (v[row->first] < limit) || (row->touch && (v[row->first] == limit));
}

/* The slow interrupt is every n-th fast one, n > 1: one that comes late must not take the fast one
 * for lost. */
static bool whole_ratio(float ratio)
{
    float off = ratio - (float)(uint16_t)(ratio + 0.5f);
    return (ratio >= 1.5f) && (off < 1.0e-3f) && (off > -1.0e-3f);
}

static bool release_within_band(float release_Nm, float band_Nm)
{
    return (release_Nm == 0.0f) || ((release_Nm < band_Nm) && (release_Nm > -band_Nm));
}

/* Both in whole counts. */
static bool in_first_half(float write, float period)
{
    uint16_t at = (uint16_t)(write + 0.5f);
    uint16_t end = (uint16_t)(period + 0.5f);
    return at < (end / 2u);
}

uint16_t ht_counts_up(float time_us, float clock_Hz)
{
    float exact = time_us * 1.0e-6f * clock_Hz - HT_DEAD_TOLERANCE_COUNTS;
    uint16_t whole = 0u;
    if (exact > 0.0f) {
        whole = (uint16_t)exact;
    }
    return ((float)whole < exact) ? (uint16_t)(whole + 1u) : whole;
}

/* Room for two shortest pulses, in whole counts. */
static bool holds_pulses(const float *v, float pwm_clock_Hz, float write, float period)
{
    float dead = (float)ht_counts_up(v[HT_P_dead_time_us], pwm_clock_Hz);
    float pulse = (float)ht_counts_up(v[HT_P_min_pulse_us], pwm_clock_Hz);
    return (2.0f * (dead + pulse) + write)
           <= (period - 1.0f); /* both are rounded to the nearest count */
}

/* Can a drive do without these legs? */
static bool can_lose(ht_winding winding, uint16_t legs, bool predicts)
{
    ht_lost_legs lost;
    return (legs == 0u) || (predicts && (ht_lost_legs_of(winding, legs, &lost) != 0u));
}

#define TURN_ALWAYS 2.0f /* carrier_turn */

/* The demands of sets that are 0 or 60 degrees apart. */
static bool sets_fit(const float *v, uint16_t misfit)
{
    const ht_scheme_info *row = ht_scheme_describe((uint16_t)v[HT_P_scheme]);
    bool result = true;
    switch ((ht_misfit)misfit) {
    case HT_MISFIT_WINDING:
        result = ht_scheme_drives(row, ht_winding_of(v));
        break;
    case HT_MISFIT_WINDING_ALIKE:
    default:
        result = (v[HT_P_carrier_turn] != TURN_ALWAYS) && (v[HT_P_clamp] == 0.0f);
        break;
    }
    return result;
}

/* The demands of a short circuit as the trip state. */
static bool short_fits(const ht_params *p, uint16_t misfit)
{
    const float *v = p->v;
    bool result = true;
    switch ((ht_misfit)misfit) {
    case HT_MISFIT_SHORT_KIND:
        result = HT_ROTOR_DOES(ht_rotor_of(v), induces, ());
        break;
    case HT_MISFIT_SHORT_BEARS:
        result = HT_ROTOR_DOES(ht_rotor_of(v), bears_short, (p));
        break;
    case HT_MISFIT_SHORT_SEEN:
    default:
        /* As much of the sensors' range as a trip may take. */
        result = v[HT_P_magnets_bear_A]
                 <= table[(uint16_t)HT_MISFIT_I_TRIP - 1u].share * v[HT_P_i_full_A];
        break;
    }
    return result;
}

/* Periods from a voltage to the torque that answers it, and the share of the band within which the
 * voltage may move meanwhile. */
#define VDC_PERIODS 3.0f
#define VDC_SHARE 0.33333333f

float ht_misfit_band_V(const ht_params *p)
{
    const float *v = p->v;
    float most_rad_s = v[HT_P_speed_trip_rpm] * (PI_F / 30.0f);
    float base_rad_s = v[HT_P_vdc_max_V] / (ROOT_3 * v[HT_P_pole_pairs] * v[HT_P_flux_ref_Wb]);
    float level_V = (v[HT_P_vdc_low_V] > 0.0f) ? v[HT_P_vdc_low_V] : v[HT_P_vdc_high_V];
    float power_W = v[HT_P_torque_limit_Nm] * ((base_rad_s < most_rad_s) ? base_rad_s : most_rad_s);
    if (!(level_V > 0.0f) || !(v[HT_P_link_F] > 0.0f)) {
        return 0.0f;
    }
    return power_W * VDC_PERIODS / (VDC_SHARE * v[HT_P_f_isr_Hz] * level_V * v[HT_P_link_F]);
}

/* Of i_trip_A, what the ripple of interleaved carriers may take. */
#define RIPPLE_SHARE 0.25f

float ht_misfit_ripple_Hz(const ht_params *p)
{
    const float *v = p->v;
    float ripple_pu = ht_scheme_xy_ripple_pu(ht_scheme_describe((uint16_t)v[HT_P_scheme]));
    return ripple_pu * v[HT_P_vdc_max_V] / (RIPPLE_SHARE * v[HT_P_i_trip_A] * v[HT_P_lxy_H]);
}

float ht_misfit_stop_s(const ht_params *p, uint16_t misfit)
{
    const float *v = p->v;
    bool quick = misfit == (uint16_t)HT_MISFIT_QUICK_STOP_TIME;
    float rpm_s = v[quick ? HT_P_quick_stop_rpm_s : HT_P_ramp_down_rpm_s];
    float stop_s = 0.0f;
    if (rpm_s > 0.0f) {
        stop_s = v[HT_P_speed_trip_rpm] / rpm_s;
        if (!quick && (v[HT_P_ramp_jerk_rpm_s2] > 0.0f)) {
            stop_s += rpm_s / v[HT_P_ramp_jerk_rpm_s2];
        }
    }
    return stop_s;
}

float ht_misfit_heat_per_s(const ht_params *p)
{
    const float *v = p->v;
    if (v[HT_P_winding_K_W] == 0.0f) {
        return 0.0f;
    }
    return 1.0f / v[HT_P_winding_s]
           + (1.0f + v[HT_P_frame_K_W] / v[HT_P_winding_K_W]) / v[HT_P_frame_s];
}

/* The demands of the dc link's limits, if there are any. */
static bool vdc_fits(const ht_params *p, uint16_t misfit)
{
    const float *v = p->v;
    float low_V = v[HT_P_vdc_low_V];
    float high_V = v[HT_P_vdc_high_V];
    bool result = true;
    switch ((ht_misfit)misfit) {
    case HT_MISFIT_VDC_LOW:
        result = (low_V == 0.0f) || (low_V > 1.03f * v[HT_P_vdc_min_V]);
        break;
    case HT_MISFIT_VDC_LEVELS:
        result = (low_V == 0.0f) || (high_V == 0.0f)
                 || ((high_V - 2.0f * v[HT_P_vdc_band_V]) > low_V);
        break;
    case HT_MISFIT_VDC_BAND:
    default:
        result = v[HT_P_vdc_band_V] >= ht_misfit_band_V(p);
        break;
    }
    return result;
}

/* The largest raised flux, over the trip. */
#define RAISED_SHARE (1.0f / 1.2f)

/* The demands of flux braking. */
static bool flux_brake_fits(const float *v, uint16_t misfit)
{
    bool result = true;
    switch ((ht_misfit)misfit) {
    case HT_MISFIT_FLUX_BRAKE:
        result = HT_ROTOR_DOES(ht_rotor_of(v), fits, (v, misfit));
        break;
    case HT_MISFIT_FLUX_BRAKE_LEVEL:
        result = v[HT_P_vdc_high_V] > 0.0f;
        break;
    case HT_MISFIT_FLUX_BRAKE_VOLTAGE:
        result = v[HT_P_field_weakening] != 0.0f;
        break;
    case HT_MISFIT_FLUX_BRAKE_TRIP:
    default:
        result = (1.0f + v[HT_P_flux_brake_share]) * v[HT_P_flux_ref_Wb]
                 <= RAISED_SHARE * v[HT_P_flux_trip_Wb];
        break;
    }
    return result;
}

/* The demands of relay, brake and chopper. */
static bool outputs_fit(const float *v, uint16_t misfit)
{
    bool result = true;
    if (misfit == (uint16_t)HT_MISFIT_PRECHARGE) {
        result = (v[HT_P_precharge_V] == 0.0f)
                 || ((v[HT_P_precharge_V] > 1.03f * v[HT_P_vdc_min_V])
                     && (v[HT_P_precharge_V] < v[HT_P_vdc_max_V]));
    } else if (misfit == (uint16_t)HT_MISFIT_CHOPPER_OFF) {
        result = (v[HT_P_chopper_on_V] == 0.0f)
                 || (v[HT_P_chopper_off_V] > 1.03f * v[HT_P_vdc_min_V]);
    } else {
        float negative_Nm = v[HT_P_torque_negative_Nm];
        float most_Nm = v[HT_P_torque_limit_Nm];
        if ((v[HT_P_brake_Nm] < 0.0f) && (negative_Nm > 0.0f) && (negative_Nm < most_Nm)) {
            most_Nm = negative_Nm;
        }
        result = (v[HT_P_brake_open_s] == 0.0f) || (fabsf(v[HT_P_brake_Nm]) <= most_Nm);
    }
    return result;
}

/* The demands of a thermistor. */
static bool ntc_fits(const float *v, uint16_t ohm, uint16_t beta_K, float hot_degC)
{
    ht_ntc_config c;
    if (v[ohm] == 0.0f) {
        return true;
    }
    ht_ntc_configure(&c, v[ohm], v[beta_K], v[HT_P_ntc_pull_up_ohm], 1.0f);
    return ht_ntc_reaches(&c, hot_degC);
}

float ht_misfit_ntc_degC(const ht_params *p, uint16_t misfit)
{
    const float most = (float)HT_NTC_HOT_DEGC;
    float trip_degC = p->v[HT_P_winding_trip_degC];
    return ((misfit == (uint16_t)HT_MISFIT_WINDING_NTC) && (trip_degC > most)) ? trip_degC : most;
}

static bool fits(const ht_params *p, float pwm_clock_Hz, uint16_t misfit)
{
    const float *v = p->v;
    float f_isr_Hz = v[HT_P_f_isr_Hz];
    float period = pwm_clock_Hz / f_isr_Hz;
    float write = v[HT_P_write_delay_us] * 1.0e-6f * pwm_clock_Hz;
    bool immediate = v[HT_P_load_mode] != 0.0f;
    bool result = true;
    switch ((ht_misfit)misfit) {
    case HT_MISFIT_PERIOD:
        result = (period <= 65535.0f) && (period >= 8.0f);
        break;
    case HT_MISFIT_RATIO:
        result = whole_ratio(f_isr_Hz / v[HT_P_f_slow_Hz]);
        break;
    case HT_MISFIT_RELEASE:
        result = release_within_band(v[HT_P_torque_release_Nm], v[HT_P_torque_band_Nm]);
        break;
    case HT_MISFIT_WRITE:
        result = !immediate || in_first_half(write, period);
        break;
    case HT_MISFIT_DEAD_TIME:
        result = v[HT_P_dead_time_us] * 1.0e-6f * f_isr_Hz <= 0.5f;
        break;
    case HT_MISFIT_ROTOR:
        result = v[HT_P_rr_ohm] < 0.5f * v[HT_P_lr_H] * f_isr_Hz;
        break;
    case HT_MISFIT_LOST_LEGS:
        result = can_lose(ht_winding_of(v), (uint16_t)v[HT_P_lost_legs],
                          !immediate && (v[HT_P_predict] != 0.0f));
        break;
    case HT_MISFIT_LOST_RIDE:
        result = (v[HT_P_lost_legs] == 0.0f) || (v[HT_P_ride_through] != 0.0f);
        break;
    case HT_MISFIT_RATED:
        result = (v[HT_P_ride_through] == 0.0f) || (v[HT_P_i_rated_A] > 0.0f);
        break;
    case HT_MISFIT_MIN_PULSE:
        result = holds_pulses(v, pwm_clock_Hz, immediate ? write : 0.0f, period);
        break;
    case HT_MISFIT_COMPARATOR_I:
        result = v[HT_P_i_trip_A] <= (1.0f - v[HT_P_comparator_above_pu]) * v[HT_P_i_full_A];
        break;
    case HT_MISFIT_COMPARATOR_VDC:
        result = v[HT_P_vdc_max_V]
                 <= (1.0f - 0.5f * v[HT_P_comparator_above_pu]) * v[HT_P_vdc_full_V];
        break;
    case HT_MISFIT_SALIENCY:
    case HT_MISFIT_CEILING:
    case HT_MISFIT_XY_STEP:
    case HT_MISFIT_RIDE_SHORT:
    case HT_MISFIT_ABSOLUTE:
    case HT_MISFIT_LEAST_LOSS:
        result = HT_ROTOR_DOES(ht_rotor_of(v), fits, (v, misfit));
        break;
    case HT_MISFIT_WINDING:
    case HT_MISFIT_WINDING_ALIKE:
        result = (ht_winding_of(v) == HT_WINDING_30) || sets_fit(v, misfit);
        break;
    case HT_MISFIT_VDC_LOW:
    case HT_MISFIT_VDC_LEVELS:
    case HT_MISFIT_VDC_BAND:
        result = vdc_fits(p, misfit);
        break;
    case HT_MISFIT_HEAT_AMBIENT:
        result = (v[HT_P_winding_K_W] == 0.0f)
                 || (v[HT_P_winding_limit_degC] > v[HT_P_ambient_degC]);
        break;
    case HT_MISFIT_DEVICE_AMBIENT:
        result = (v[HT_P_device_K_W] == 0.0f) || (v[HT_P_device_limit_degC] > v[HT_P_ambient_degC]);
        break;
    case HT_MISFIT_HEAT_TIMES:
        result = ht_misfit_heat_per_s(p) <= 0.125f * v[HT_P_f_slow_Hz];
        break;
    case HT_MISFIT_PRECHARGE:
    case HT_MISFIT_BRAKE:
    case HT_MISFIT_CHOPPER_OFF:
        result = outputs_fit(v, misfit);
        break;
    case HT_MISFIT_HEAT_RS:
        result = (v[HT_P_rs_tells] == 0.0f) || HT_ROTOR_DOES(ht_rotor_of(v), learns_rs, (v));
        break;
    case HT_MISFIT_WINDING_NTC:
        result = ntc_fits(v, (uint16_t)HT_P_winding_ntc_ohm, (uint16_t)HT_P_winding_ntc_K,
                          ht_misfit_ntc_degC(p, misfit));
        break;
    case HT_MISFIT_SINK_NTC:
        result = ntc_fits(v, (uint16_t)HT_P_sink_ntc_ohm, (uint16_t)HT_P_sink_ntc_K,
                          ht_misfit_ntc_degC(p, misfit));
        break;
    case HT_MISFIT_STOP_TIME:
    case HT_MISFIT_QUICK_STOP_TIME:
        result = v[HT_P_stop_s] >= ht_misfit_stop_s(p, misfit);
        break;
    case HT_MISFIT_TORQUE_MEAN:
        result = (v[HT_P_torque_mean_s] == 0.0f)
                 || (v[HT_P_torque_mean_s] * v[HT_P_f_slow_Hz] >= LEAST_LOOKS);
        break;
    case HT_MISFIT_FLUX_BRAKE:
    case HT_MISFIT_FLUX_BRAKE_LEVEL:
    case HT_MISFIT_FLUX_BRAKE_VOLTAGE:
    case HT_MISFIT_FLUX_BRAKE_TRIP:
        result = (v[HT_P_flux_brake_share] == 0.0f) || flux_brake_fits(v, misfit);
        break;
    case HT_MISFIT_XY_RIPPLE:
        result = f_isr_Hz >= ht_misfit_ripple_Hz(p);
        break;
    case HT_MISFIT_SHORT_KIND:
    case HT_MISFIT_SHORT_BEARS:
    case HT_MISFIT_SHORT_SEEN:
        result = (v[HT_P_trip_state] == 0.0f) || short_fits(p, misfit);
        break;
    default:
        result = in_order(v, &table[misfit - 1u]);
        break;
    }
    return result;
}

ht_misfit ht_misfit_of(const ht_params *p, float pwm_clock_Hz)
{
    uint16_t misfit = 1u;
    while ((misfit < (uint16_t)HT_MISFITS) && fits(p, pwm_clock_Hz, misfit)) {
        misfit++;
    }
    return (misfit < (uint16_t)HT_MISFITS) ? (ht_misfit)misfit : HT_MISFIT_NONE;
}
