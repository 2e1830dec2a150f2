#include "ht_configure.h"

#include "ht_angle.h"
#include "ht_limited.h"
#include "ht_misfit.h"
#include "ht_rotor_rules.h"

#include <math.h>
#include <stddef.h>

#define PI_F 3.14159265f
/* Time constants: the model-based checks average over the transients that a healthy
 * drive shows; mean speed of the flux, quick and slow. */
#define FLUX_CHECK_S 0.2f
#define ENCODER_CHECK_S 0.05f
/* Counts of the encoder in a period, quick mean (HT_COUNTS_SLOW_S). */
#define COUNTS_QUICK_S 0.0003f
#define OMEGA_FILTER_S 0.005f
#define OMEGA_MEAN_S 0.2f
/* Time constant of the mean torque error that the flux of least loss adds. It is long, because the
 * samples hold all of the ripple. */
#define TORQUE_ERROR_S 1.0f
/* The build-up is direct current, where all that the models disagree about is R_s: it
 * is learnt quickly there, or a wrong one would build a wrong flux. */
#define BUILD_ADAPT_S 0.1f
/* And tells the winding's temperature if it takes so many of these time constants. */
#define HEAT_BUILT 2.5f
/* Lost leg: how long evidence is gathered at least, how long a wrong sensor rules a loss out; a set's
 * sum that shows a wrong sensor, share of its trip level; no current in a leg, share of that sum. */
#define LOSS_HOLD_S 0.001f
#define LOSS_WAIT_S 0.01f
#define LOSS_SUM_SHARE 0.3f
#define LOSS_ZERO_SHARE 0.25f
/* L_xy that the check of the legs learns: mean. */
#define LXY_S 0.3f
/* The difference of the sets' resistances: of the means, of the result. */
#define SETS_S 0.05f
#define SETS_SLOW_S 0.2f

ht_range ht_param_range(const ht_port *port, uint16_t id)
{
    ht_range range = {0.0f, 0.0f};
    const ht_param_info *info = ht_param_describe(id);
    if (info != NULL) {
        range.min = info->min;
        range.max = info->max;
    }
    if (id == (uint16_t)HT_P_dead_time_us) {
        ht_dead_range dead = ht_port_dead_range(port);
        range.min = (dead.min_us > range.min) ? dead.min_us : range.min;
        range.max = (dead.max_us < range.max) ? dead.max_us : range.max;
    }
    if (id == (uint16_t)HT_P_min_pulse_us) {
        float least_us = ht_port_min_pulse_us(port);
        range.min = (least_us > range.min) ? least_us : range.min;
    }
    return range;
}

bool ht_configure_valid(const ht_port *port, uint16_t id, float value)
{
    ht_range range = ht_param_range(port, id);
    return ht_param_valid(id, value) && (value >= range.min) && (value <= range.max);
}

/* The law of the scheme that is selected. */
static void configure_law(const ht_params *p, ht_control_config *c)
{
    ht_law_setting given;
    given.scheme = ht_scheme_describe((uint16_t)c->scheme);
    given.machine = &c->observer;
#define HT_LAW_PARAMETER(name) given.name = p->v[HT_P_##name];
#include "ht_law_parameters.def"
#undef HT_LAW_PARAMETER
    ht_control_configure(c, &given);
}

static void configure_leg_loss(const ht_params *p, float ts, ht_leg_loss_config *c)
{
    float least_V = p->v[HT_P_loss_check] * p->v[HT_P_vdc_max_V];
    float hold = LOSS_HOLD_S * p->v[HT_P_f_isr_Hz];
    float wait = LOSS_WAIT_S * p->v[HT_P_f_isr_Hz];
    c->least_V2 = least_V * least_V;
    c->gain = ts / (ts + HT_LEG_LOSS_FILTER_S);
    c->l_per_ts_ohm = p->v[HT_P_lxy_H] * p->v[HT_P_f_isr_Hz];
    c->sum_A = LOSS_SUM_SHARE * p->v[HT_P_i_sum_trip_A];
    c->zero_A = LOSS_ZERO_SHARE * c->sum_A;
    c->hold = (uint16_t)hold;
    c->wait = (uint16_t)wait;
    c->winding = ht_winding_of(p->v);
}

/* Derive the control configuration, or tell why the values do not fit. */
static ht_result configure(const ht_params *p, float pwm_clock_Hz, ht_control_config *c)
{
    float period = pwm_clock_Hz / p->v[HT_P_f_isr_Hz];
    float ts = 1.0f / p->v[HT_P_f_isr_Hz];
    bool shadow = p->v[HT_P_load_mode] == 0.0f;
    float first = p->v[HT_P_write_delay_us] * 1.0e-6f * pwm_clock_Hz;
    if (ht_misfit_of(p, pwm_clock_Hz) != HT_MISFIT_NONE) {
        return HT_ERROR_CONFIG;
    }
    ht_control_select(c, (ht_scheme)(uint16_t)p->v[HT_P_scheme]);
    c->shadow = shadow;
    c->predict = shadow && (p->v[HT_P_predict] != 0.0f);
    c->period.counts = (uint16_t)(period + 0.5f);
    c->period.first = 0u;
    if (!shadow) {
        c->period.first = (uint16_t)(first + 0.5f);
    }
    c->period.shortest = (uint16_t)(ht_counts_up(p->v[HT_P_dead_time_us], pwm_clock_Hz)
                                    + ht_counts_up(p->v[HT_P_min_pulse_us], pwm_clock_Hz));
    c->only_v0 = p->v[HT_P_zero_vector] != 0.0f;
    c->drop_V = p->v[HT_P_drop_V];
    c->build_current_A = p->v[HT_P_build_current_A];
    c->observer.ts_s = ts;
    c->observer.inv_ts = p->v[HT_P_f_isr_Hz];
    c->observer.rs_ohm = p->v[HT_P_rs_ohm];
    c->observer.sigma_ls_H = p->v[HT_P_sigma_ls_H];
    c->observer.inv_sigma_ls = 1.0f / p->v[HT_P_sigma_ls_H];
    c->observer.lxy_H = p->v[HT_P_lxy_H];
    c->observer.kind = (ht_observer_kind)(uint16_t)p->v[HT_P_observer];
    c->observer.hybrid_gain = 2.0f * PI_F * p->v[HT_P_crossover_Hz] * ts;
    c->observer.rotor_decay = ts * p->v[HT_P_rr_ohm] / p->v[HT_P_lr_H];
    c->observer.lm_over_lr = p->v[HT_P_lm_H] / p->v[HT_P_lr_H];
    c->observer.rotor_drive = ts * p->v[HT_P_rr_ohm] * c->observer.lm_over_lr;
    c->observer.torque_gain = 3.0f * p->v[HT_P_pole_pairs];
    c->observer.omega_gain = (ts < OMEGA_FILTER_S) ? (ts / OMEGA_FILTER_S) : 1.0f;
    c->observer.winding = ht_winding_of(p->v);
    c->observer.rotor = ht_rotor_of(p->v);
    HT_ROTOR_DOES(c->observer.rotor, configure, (p->v, &c->observer));
    c->dead.dead_pu = p->v[HT_P_dead_time_us] * 1.0e-6f * p->v[HT_P_f_isr_Hz];
    c->dead.i_zero_A = p->v[HT_P_i_zero_A];
    configure_law(p, c);
    configure_leg_loss(p, ts, &c->leg_loss);
    switch (ht_control_check(c)) {
    case HT_CONFIG_OK:
        return HT_OK;
    case HT_CONFIG_PREDICTION:
        return HT_ERROR_PREDICTION;
    case HT_CONFIG_SAMPLING:
        return HT_ERROR_SAMPLING;
    default:
        return HT_ERROR_CONFIG;
    }
}

/* Torque allowed per flux squared. At constant stator flux the torque peaks at
 * 3 P psi^2 (1 - sigma)/(2 sigma L_s): the top of the circle diagram. */
static float pull_out(const float *v)
{
    float main_H = v[HT_P_lm_H] * v[HT_P_lm_H] / v[HT_P_lr_H]; /* (1 - sigma) L_s */
    float sigma_ls_H = v[HT_P_sigma_ls_H];
    return HT_PULL_OUT_SHARE * 1.5f * v[HT_P_pole_pairs] * main_H
           / (sigma_ls_H * (sigma_ls_H + main_H));
}

/* Gain of a low pass of the encoder's counts in a fast period. */
static float encoder_gain(const float *v, float filter_s)
{
    return 1.0f / (1.0f + filter_s * v[HT_P_f_isr_Hz]);
}

/* Per slow interrupt; 0: off. */
static float adaptation_gain(const float *v, float time_s)
{
    return (time_s > 0.0f) ? (1.0f / (1.0f + time_s * v[HT_P_f_slow_Hz])) : 0.0f;
}

static void apply_protection(const float *v, ht_protect_config *c)
{
    float ratio = v[HT_P_lm_H] / v[HT_P_lr_H];
    c->i_trip_A = v[HT_P_i_trip_A];
    c->i_ab_trip_A = v[HT_P_i_ab_trip_A];
    c->i_sum_trip_A = v[HT_P_i_sum_trip_A];
    c->vdc_min_V = v[HT_P_vdc_min_V];
    c->vdc_max_V = v[HT_P_vdc_max_V];
    c->flux_trip_Wb = v[HT_P_flux_trip_Wb];
    c->speed_trip_rpm = v[HT_P_speed_trip_rpm];
    c->encoder_trip_rpm = v[HT_P_encoder_trip_rpm];
    c->flux_check = v[HT_P_flux_check];
    c->stuck_counts = v[HT_P_stuck_trip_A] * (float)HT_ADC_FULL / (2.0f * v[HT_P_i_full_A]);
    c->ls_H = v[HT_P_sigma_ls_H] + ratio * v[HT_P_lm_H];
    c->sigma = v[HT_P_sigma_ls_H] / c->ls_H;
    c->no_load_A = v[HT_P_flux_ref_Wb] / c->ls_H;
    c->slip_gain = v[HT_P_rr_ohm] * ratio * ratio;
    c->rpm_per_rad_s = 30.0f / (PI_F * v[HT_P_pole_pairs]);
    c->flux_gain = 1.0f / (1.0f + FLUX_CHECK_S * v[HT_P_f_slow_Hz]);
    c->slow_Hz = v[HT_P_f_slow_Hz];
    c->slow_turns_s = 1.0f / (2.0f * PI_F * v[HT_P_f_slow_Hz]);
    c->encoder_gain = 1.0f / (1.0f + ENCODER_CHECK_S * v[HT_P_f_slow_Hz]);
    c->counts_quick = encoder_gain(v, COUNTS_QUICK_S);
    c->counts_slow = encoder_gain(v, HT_COUNTS_SLOW_S);
    c->most_counts = v[HT_P_encoder_trip_rpm] * v[HT_P_encoder_counts_rev]
                     / (60.0f * v[HT_P_f_isr_Hz]);
    c->rotor = ht_rotor_of(v);
    HT_ROTOR_DOES(c->rotor, configure_protect, (v, c));
}

/* No measured voltage is as high. */
#define NO_LEVEL_V 1.0e9f

static void configure_vdc(const float *v, ht_vdc_config *c)
{
    c->high_V = v[HT_P_vdc_high_V];
    c->low_V = v[HT_P_vdc_low_V];
    c->above_V = (c->high_V > 0.0f) ? (c->high_V - v[HT_P_vdc_band_V]) : NO_LEVEL_V;
    c->below_V = (c->low_V > 0.0f) ? (c->low_V + v[HT_P_vdc_band_V]) : -NO_LEVEL_V;
    c->per_band = 1.0f / v[HT_P_vdc_band_V];
    c->kp_Nms_rad = v[HT_P_kp_speed_Nms_rad];
}

/* Rates per slow interrupt. */
static void configure_motion(const float *v, ht_drive_config *c)
{
    float slow_s = 1.0f / v[HT_P_f_slow_Hz];
    c->ramp.up_rpm = v[HT_P_ramp_up_rpm_s] * slow_s;
    c->ramp.down_rpm = v[HT_P_ramp_down_rpm_s] * slow_s;
    c->ramp.jerk_rpm = v[HT_P_ramp_jerk_rpm_s2] * slow_s * slow_s;
    c->stop = c->ramp;
    if (v[HT_P_motion] == (float)HT_MOTION_QUICK_STOP) {
        c->stop.down_rpm = v[HT_P_quick_stop_rpm_s] * slow_s;
        c->stop.jerk_rpm = 0.0f;
    }
}

/* `pull_out_Nm_Wb2`: of the torque limit, per flux squared. */
static void configure_least_loss(const float *v, float pull_out_Nm_Wb2, ht_least_loss_config *c)
{
    float ratio = v[HT_P_lm_H] / v[HT_P_lr_H];
    float main_H = ratio * v[HT_P_lm_H];
    float ls_H = v[HT_P_sigma_ls_H] + main_H;
    float slip_rad_s = v[HT_P_encoder_trip_rpm] * v[HT_P_pole_pairs] * (PI_F / 30.0f);
    float floor_Wb;
    float wait = v[HT_P_flux_wait_s] * v[HT_P_f_slow_Hz];
    c->error_gain = 1.0f / (1.0f + TORQUE_ERROR_S * v[HT_P_f_slow_Hz]);
    c->per_Nm = 1.0f / (3.0f * v[HT_P_pole_pairs] * main_H);
    c->ls2_H2 = ls_H * ls_H;
    c->across2_H2 = v[HT_P_sigma_ls_H] * v[HT_P_sigma_ls_H];
    c->rotor_ohm = v[HT_P_rr_ohm] * ratio * ratio;
    c->hysteresis_ohm = v[HT_P_iron_hysteresis_A_Wb] / 3.0f;
    c->eddy_ohm = v[HT_P_iron_eddy_S] / 3.0f;
    /* Little flux needs much slip, of which a wrong R_r makes a wrong speed of the flux: no more of
     * it than the check of the encoder allows. */
    c->reach_Nm_Wb2 = pull_out_Nm_Wb2;
    if ((slip_rad_s > 0.0f) && (c->rotor_ohm > 0.0f)) {
        float by_slip = 3.0f * v[HT_P_pole_pairs] * slip_rad_s / c->rotor_ohm;
        c->reach_Nm_Wb2 = (by_slip < pull_out_Nm_Wb2) ? by_slip : pull_out_Nm_Wb2;
    }
    floor_Wb = HT_ROTOR_DOES(ht_rotor_of(v), reserve_Wb, (v, c->reach_Nm_Wb2));
    c->floor_Wb = (floor_Wb > v[HT_P_flux_min_Wb]) ? floor_Wb : v[HT_P_flux_min_Wb];
    c->wait = (uint32_t)wait;
}

/* The flux stays raised for so long: at the end of a braking the level limits from time to time. */
#define BRAKE_HOLD_S 0.1f

static void configure_flux_brake(const float *v, ht_flux_brake_config *c)
{
    c->raise_Wb = v[HT_P_flux_brake_share] * v[HT_P_flux_ref_Wb];
    c->most_Wb = v[HT_P_flux_ref_Wb] + c->raise_Wb;
    c->hold = BRAKE_HOLD_S * v[HT_P_f_slow_Hz];
    c->per_check = 0.0f;
    if (v[HT_P_flux_check] > 0.0f) {
        c->per_check = 1.0f / (v[HT_P_flux_check] * v[HT_P_flux_check]);
    }
}

/* A step of the thermal model takes this share of its shortest time constant. */
#define HEAT_STEP 0.03125f
/* Low pass of the squared samples, slow periods: in one of them a leg may have a single one. */
#define HEAT_SAMPLE_PERIODS 2.0f
/* Low pass of the part of the squares that the samples miss, in looks: that of one look scatters. */
#define HEAT_MORE_LOOKS 10.0f
/* Of turns of seven interrupts, four meet each place of a switching period of four. */
#define HEAT_TURNS 4.0f

/* The adapted R_s is exact after so many of its time constants: where the speed fades it, 100 K are far
 * below the model's trust in it then. */
#define HEAT_SETTLED 6.0f

static void configure_heat(const ht_params *p, ht_heat_config *c)
{
    const float *v = p->v;
    float legs = (float)HT_LEGS;
    float per_s = ht_misfit_heat_per_s(p);
    float slow_s = 1.0f / v[HT_P_f_slow_Hz];
    float step_s;
    c->steps = 0.0f;
    c->sample_gain = 0.0f;
    c->more_gain = 0.0f;
    c->look_turns = 0.0f;
    if (per_s > 0.0f) {
        c->steps = (float)(uint32_t)(HEAT_STEP / (per_s * slow_s)) + 1.0f;
    }
    if ((per_s > 0.0f) || (v[HT_P_device_K_W] > 0.0f)) {
        float looks = slow_s * v[HT_P_f_isr_Hz] / (legs + 1.0f); /* of a leg, in a slow period */
        c->sample_gain = 1.0f / (1.0f + HEAT_SAMPLE_PERIODS);
        c->more_gain = 1.0f / (1.0f + HEAT_MORE_LOOKS);
        c->look_turns = looks + HEAT_TURNS;
    }
    step_s = c->steps * slow_s;
    c->to_frame = step_s / v[HT_P_winding_s];
    c->per_W_K = c->to_frame * legs * v[HT_P_winding_K_W];
    c->to_ambient = step_s / v[HT_P_frame_s];
    c->frame_per_W_K = c->to_ambient * v[HT_P_frame_K_W];
    c->frame_per_rise = (per_s > 0.0f) ? (c->frame_per_W_K / (legs * v[HT_P_winding_K_W])) : 0.0f;
    c->ohm_per_K = v[HT_P_rs_ohm] / (v[HT_P_rs_degC] - HT_COPPER_ZERO_DEGC);
    c->ambient_K = v[HT_P_ambient_degC] - HT_COPPER_ZERO_DEGC;
    c->settled = HEAT_SETTLED * v[HT_P_adapt_s] * v[HT_P_f_slow_Hz];
    c->rs_tells = (uint16_t)HT_RS_TELLS_NOTHING;
    if (per_s > 0.0f) {
        c->rs_tells = (uint16_t)v[HT_P_rs_tells];
    }
    c->ambient_degC = v[HT_P_ambient_degC];
    c->limit_degC = v[HT_P_winding_limit_degC];
    c->trip_degC = v[HT_P_winding_trip_degC];
}

static void configure_device_heat(const float *v, ht_device_heat_config *c)
{
    c->K_W = v[HT_P_device_K_W];
    c->gain = 1.0f / (1.0f + v[HT_P_device_s] * v[HT_P_f_slow_Hz]);
    c->drop_V = v[HT_P_drop_V];
    c->ohm = v[HT_P_device_ohm];
    c->share_V = 1.0e-9f * v[HT_P_device_nJ_VA] * v[HT_P_f_isr_Hz];
    c->limit_degC = v[HT_P_device_limit_degC];
    c->trip_degC = v[HT_P_device_trip_degC];
}

static void configure_sensors(const float *v, ht_drive_config *c)
{
    const float readings_Hz = v[HT_P_f_slow_Hz] / (float)HT_SLOW_CHANNELS; /* by turns */
    ht_ntc_configure(&c->ntc[HT_SLOW_WINDING], v[HT_P_winding_ntc_ohm], v[HT_P_winding_ntc_K],
                     v[HT_P_ntc_pull_up_ohm], readings_Hz);
    ht_ntc_configure(&c->ntc[HT_SLOW_SINK], v[HT_P_sink_ntc_ohm], v[HT_P_sink_ntc_K],
                     v[HT_P_ntc_pull_up_ohm], readings_Hz);
    c->heat.sensed = v[HT_P_winding_ntc_ohm] > 0.0f;
    c->heat.heed = 1.0f;
    if (c->heat.sensed) {
        c->heat.rs_tells = (uint16_t)HT_RS_TELLS_NOTHING;
        if (c->heat.steps > 0.0f) {
            c->heat.heed =
                ht_limited(HT_HEAT_SENSOR_HEED / (v[HT_P_winding_s] * readings_Hz), 1.0f);
        }
    }
}

/* The dc link's voltage stands for so long before the relay closes, and the relay takes as long. */
#define CHARGED_S 0.1f

static void configure_outputs(const float *v, ht_outputs_config *c)
{
    c->precharge_V = v[HT_P_precharge_V];
    c->rearm_V = v[HT_P_vdc_min_V];
    c->stands = CHARGED_S * v[HT_P_f_slow_Hz];
    c->opens = v[HT_P_brake_open_s] * v[HT_P_f_slow_Hz];
    c->closes = v[HT_P_brake_close_s] * v[HT_P_f_slow_Hz];
    c->hold_Nm = v[HT_P_brake_Nm];
    c->fan_after = v[HT_P_fan_s] * v[HT_P_f_slow_Hz];
    c->chopper_on_V = NO_LEVEL_V;
    c->chopper_off_V = NO_LEVEL_V;
    if (v[HT_P_chopper_on_V] > 0.0f) {
        c->chopper_on_V = v[HT_P_chopper_on_V];
        c->chopper_off_V = v[HT_P_chopper_off_V];
    }
}

/* How the angle is known that the alignment only checks. */
static void configure_zero(const float *v, ht_drive_config *c)
{
    uint32_t counts_rev = c->alignment.counts_rev;
    uint16_t pairs = c->alignment.pole_pairs;
    c->index.used = c->has_axis && (v[HT_P_rotor_start] == HT_ROTOR_START_INDEX);
    c->index.counts_rev = counts_rev;
    c->index.near_counts = ht_index_near_counts(counts_rev, pairs);
    c->absolute.used = c->has_axis && (v[HT_P_rotor_start] == HT_ROTOR_START_ABSOLUTE);
    if (c->absolute.used) {
        ht_absolute_configure(&c->absolute, counts_rev, v[HT_P_absolute_counts_rev],
                              v[HT_P_absolute_direction] != 0.0f, pairs);
    }
}

void ht_configure_rest(const ht_port *port, ht_drive_config *c)
{
    const float *v = c->params.v;
    float ticks = v[HT_P_build_s] * v[HT_P_f_isr_Hz];
    c->has_axis = HT_ROTOR_DOES(c->control.observer.rotor, has_axis, ());
    c->alignment.first = (c->control.observer.winding == HT_WINDING_30) ? 1u : 0u;
    c->alignment.known = v[HT_P_rotor_start] != 0.0f;
    c->alignment.ticks = (uint32_t)ticks;
    c->alignment.counts_rev = (uint32_t)v[HT_P_encoder_counts_rev];
    c->alignment.pole_pairs = (uint16_t)v[HT_P_pole_pairs];
    configure_zero(v, c);
    c->speed.kp_Nms_rad = v[HT_P_kp_speed_Nms_rad];
    c->speed.ki_ts_Nms_rad = v[HT_P_ki_speed_Nm_rad] / v[HT_P_f_slow_Hz];
    configure_motion(v, c);
    c->measure.rpm_per_count = 60.0f * v[HT_P_f_slow_Hz] / v[HT_P_encoder_counts_rev];
    c->measure.rpm_ticks = 60.0f * (float)HT_CAPTURE_COUNTS * ht_port_capture_clock_Hz(port)
                           / v[HT_P_encoder_counts_rev];
    c->measure.period_rpm = v[HT_P_speed_period_rpm];
    c->flux.flux_min_Wb = v[HT_P_flux_min_Wb];
    c->flux.reach_pu = v[HT_P_fw_margin] * ht_control_reach_pu(&c->control);
    c->flux.rs_ohm = v[HT_P_rs_ohm];
    configure_vdc(v, &c->vdc);
    configure_heat(&c->params, &c->heat);
    configure_sensors(v, c);
    configure_device_heat(v, &c->device_heat);
    c->pull_out_Nm_Wb2 = pull_out(v);
    ht_derating_configure(&c->params, &c->control, &c->derating);
    configure_least_loss(v, c->pull_out_Nm_Wb2, &c->least_loss);
    configure_flux_brake(v, &c->flux_brake);
    c->sets.gain = 1.0f / (1.0f + SETS_S * v[HT_P_f_slow_Hz]);
    /* Where the x-y currents are large, wrong parameters make more of them in the residual than the
     * sets' difference does. */
    c->sets.slow_gain = 0.0f;
    if (ht_scheme_regulates_xy(ht_scheme_describe((uint16_t)c->control.scheme))) {
        c->sets.slow_gain = 1.0f / (1.0f + SETS_SLOW_S * v[HT_P_f_slow_Hz]);
    }
    c->sets.least_A2 = c->control.leg_loss.zero_A * c->control.leg_loss.zero_A;
    c->lxy_gain = 1.0f / (1.0f + LXY_S * v[HT_P_f_slow_Hz]);
    c->omega_mean_gain = 1.0f / (1.0f + OMEGA_MEAN_S * v[HT_P_f_slow_Hz]);
    c->built = HEAT_BUILT * BUILD_ADAPT_S * v[HT_P_f_slow_Hz];
    c->build_gain = 1.0f / (1.0f + BUILD_ADAPT_S * v[HT_P_f_slow_Hz]);
    c->adapt_gain = adaptation_gain(v, v[HT_P_adapt_s]);
    c->flux_gain = adaptation_gain(v, v[HT_P_adapt_psi_f_s]);
    apply_protection(v, &c->protect);
    ht_excitation_configure(&c->params, &c->excitation);
    ht_short_circuit_configure(&c->params, &c->short_circuit);
    configure_outputs(v, &c->outputs);
}

ht_result ht_configure(const ht_port *port, ht_drive_config *c, ht_pwm_setup *setup)
{
    float clock_Hz = ht_port_pwm_clock_Hz(port);
    ht_result result = configure(&c->params, clock_Hz, &c->control);
    if (result != HT_OK) {
        return result;
    }
    setup->period_counts = c->control.period.counts;
    setup->dead_counts = ht_counts_up(c->params.v[HT_P_dead_time_us], clock_Hz);
    setup->shadow = c->control.shadow;
    setup->slow_Hz = c->params.v[HT_P_f_slow_Hz];
    return ht_port_accepts(port, setup) ? HT_OK : HT_ERROR_PORT;
}
