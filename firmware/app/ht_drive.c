#include "ht_drive.h"

#define ADC_MID 2048.0f
#define ADC_FULL 4096.0f
#define OFFSET_MAX_COUNTS 200.0f
/* Share of the range that is left on either side at the largest offset, less 2 %. */
#define TRIP_SHARE 0.885f
#define PI_F 3.14159265f
/* No shaft turns further in a period (electrical angle). A counter that jumps must not
 * blow up the rotor flux: it is for the protection to find. */
#define TURN_MAX_RAD 1.5f
/* The model-based checks average over the transients that a healthy drive shows. */
#define FLUX_CHECK_S 0.2f
#define ENCODER_CHECK_S 0.05f
/* Time constant of the flux's mean speed. */
#define OMEGA_FILTER_S 0.005f
/* The build-up is direct current, where all that the models disagree about is R_s: it
 * is learnt quickly there, or a wrong one would build a wrong flux. */
#define BUILD_ADAPT_S 0.1f
/* Flux speed that is too low for R_r to show, mean over OMEGA_MEAN_S; load, as i_q/i_d,
 * from which on R_r matters; and the share of the flux that is given up there. */
#define DODGE_RAD_S 2.5f
#define DODGE_LOAD 0.4f
#define DODGE_FLUX 0.9f
#define OMEGA_MEAN_S 0.2f
/* Share of the pull-out torque that is asked for: beyond it more slip gives less
 * torque, and the controller, which answers with more slip, loses the machine. */
#define PULL_OUT_SHARE 0.8f

/* Largest circle inside the dodecagon of each scheme's mean vectors, units of
 * Vdc. Pairs count at their zero-mean share. */
static const float reach_pu[HT_SCHEMES] = {0.622008f, 0.577350f, 0.577350f,
                                           0.577350f, 0.577350f, 0.422650f};

static bool finite_below(float value, float limit)
{
    return (value < limit) && (value > -limit);
}

static uint16_t torque_levels(const ht_params *p)
{
    static const uint16_t choice[4] = {0u, 2u, 3u, 5u};
    uint16_t levels = choice[(uint16_t)p->v[HT_P_torque_levels]];
    if (levels == 0u) {
        levels = ((uint16_t)p->v[HT_P_scheme] == (uint16_t)HT_DTC3) ? 5u : 3u;
    }
    return levels;
}

/* Derive the control configuration. Returns false if the values do not fit. */
static bool configure(const ht_params *p, float pwm_clock_Hz, ht_control_config *c)
{
    float period = pwm_clock_Hz / p->v[HT_P_f_isr_Hz];
    float ts = 1.0f / p->v[HT_P_f_isr_Hz];
    bool shadow = p->v[HT_P_load_mode] == 0.0f;
    float first = p->v[HT_P_write_delay_us] * 1.0e-6f * pwm_clock_Hz;
    float ratio;
    if (!(period <= 65535.0f) || !(period >= 8.0f)) {
        return false;
    }
    if ((p->v[HT_P_torque_inner_Nm] > p->v[HT_P_torque_band_Nm])
        || (p->v[HT_P_flux_min_Wb] > p->v[HT_P_flux_ref_Wb])
        || (p->v[HT_P_vdc_min_V] >= p->v[HT_P_vdc_max_V])
        || (p->v[HT_P_flux_trip_Wb] <= p->v[HT_P_flux_ref_Wb])) {
        return false;
    }
    /* The slow interrupt is every n-th fast one. */
    ratio = p->v[HT_P_f_isr_Hz] / p->v[HT_P_f_slow_Hz];
    if (!finite_below(ratio - (float)(uint16_t)(ratio + 0.5f), 1.0e-3f)) {
        return false;
    }
    /* A trip level that a saturated converter cannot reach protects nothing. */
    if ((p->v[HT_P_i_trip_A] > TRIP_SHARE * p->v[HT_P_i_full_A])
        || (p->v[HT_P_vdc_max_V] > 0.95f * p->v[HT_P_vdc_full_V])) {
        return false;
    }
    if ((p->v[HT_P_torque_release_Nm] > 0.0f)
        && (p->v[HT_P_torque_release_Nm] >= p->v[HT_P_torque_band_Nm])) {
        return false;
    }
    c->scheme = (ht_scheme)(uint16_t)p->v[HT_P_scheme];
    c->table = (ht_table)(uint16_t)p->v[HT_P_table];
    c->torque_levels = torque_levels(p);
    c->shadow = shadow;
    c->predict = shadow && (p->v[HT_P_predict] != 0.0f);
    c->hold_on_zero = p->v[HT_P_zero_hold] != 0.0f;
    c->period_counts = (uint16_t)(period + 0.5f);
    c->first_counts = 0u;
    if (!shadow) {
        c->first_counts = (uint16_t)(first + 0.5f);
    }
    c->flux_band_Wb = p->v[HT_P_flux_band_Wb];
    c->torque_band_Nm = p->v[HT_P_torque_band_Nm];
    c->torque_inner_Nm = p->v[HT_P_torque_inner_Nm];
    c->torque_release_Nm = p->v[HT_P_torque_release_Nm];
    c->flux_hold = p->v[HT_P_flux_hold];
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
    c->xy.kp_pu_A = p->v[HT_P_kp_xy_pu_A];
    c->xy.ki_ts_pu_A = p->v[HT_P_ki_xy_pu_As] * ts;
    c->dead.dead_pu = p->v[HT_P_dead_time_us] * 1.0e-6f * p->v[HT_P_f_isr_Hz];
    c->dead.inv_2i_zero = 0.5f / p->v[HT_P_i_zero_A];
    return ht_control_check(c) == HT_CONFIG_OK;
}

/* Torque allowed per flux squared. At constant stator flux the torque peaks at
 * 3 P psi^2 (1 - sigma)/(2 sigma L_s): the top of the circle diagram. */
static float pull_out(const float *v)
{
    float main_H = v[HT_P_lm_H] * v[HT_P_lm_H] / v[HT_P_lr_H]; /* (1 - sigma) L_s */
    float sigma_ls_H = v[HT_P_sigma_ls_H];
    return PULL_OUT_SHARE * 1.5f * v[HT_P_pole_pairs] * main_H
           / (sigma_ls_H * (sigma_ls_H + main_H));
}

static void apply_protection(ht_drive *d)
{
    const float *v = d->params.v;
    ht_protect_config *c = &d->protect_config;
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
    c->stuck_counts = v[HT_P_stuck_trip_A] * ADC_FULL / (2.0f * v[HT_P_i_full_A]);
    c->ls_H = v[HT_P_sigma_ls_H] + ratio * v[HT_P_lm_H];
    c->sigma = v[HT_P_sigma_ls_H] / c->ls_H;
    c->no_load_A = v[HT_P_flux_ref_Wb] / c->ls_H;
    c->slip_gain = v[HT_P_rr_ohm] * ratio * ratio;
    c->rpm_per_rad_s = 30.0f / (PI_F * v[HT_P_pole_pairs]);
    c->flux_gain = 1.0f / (1.0f + FLUX_CHECK_S * v[HT_P_f_slow_Hz]);
    /* A mean over the slow period is half a period old, the flux's speed a time constant. */
    c->estimate_back = 0.5f - OMEGA_FILTER_S * v[HT_P_f_slow_Hz];
    c->estimate_back = (c->estimate_back > 0.0f) ? c->estimate_back : 0.0f;
    c->encoder_gain = 1.0f / (1.0f + ENCODER_CHECK_S * v[HT_P_f_slow_Hz]);
}

/* Everything outside the control configuration that parameters decide. */
static void apply_slow(ht_drive *d)
{
    const float *v = d->params.v;
    d->speed_config.kp_Nms_rad = v[HT_P_kp_speed_Nms_rad];
    d->speed_config.ki_ts_Nms_rad = v[HT_P_ki_speed_Nm_rad] / v[HT_P_f_slow_Hz];
    d->speed_config.torque_limit_Nm = v[HT_P_torque_limit_Nm];
    d->measure_config.rpm_per_count = 60.0f * v[HT_P_f_slow_Hz] / v[HT_P_encoder_counts_rev];
    d->measure_config.rpm_ticks = 60.0f * (float)HT_CAPTURE_COUNTS
                                  * ht_port_capture_clock_Hz(d->port)
                                  / v[HT_P_encoder_counts_rev];
    d->measure_config.period_rpm = v[HT_P_speed_period_rpm];
    d->flux_config.flux_ref_Wb = v[HT_P_flux_ref_Wb];
    d->flux_config.flux_min_Wb = v[HT_P_flux_min_Wb];
    d->flux_config.reach_pu = v[HT_P_fw_margin] * reach_pu[(uint16_t)v[HT_P_scheme]];
    d->flux_config.rs_ohm = v[HT_P_rs_ohm];
    d->pull_out_Nm_Wb2 = pull_out(v);
    d->omega_mean_gain = 1.0f / (1.0f + OMEGA_MEAN_S * v[HT_P_f_slow_Hz]);
    d->build_gain = 1.0f / (1.0f + BUILD_ADAPT_S * v[HT_P_f_slow_Hz]);
    d->adapt_gain =
        (v[HT_P_adapt_s] > 0.0f) ? (1.0f / (1.0f + v[HT_P_adapt_s] * v[HT_P_f_slow_Hz])) : 0.0f;
    apply_protection(d);
    d->turn_per_count = 2.0f * PI_F * v[HT_P_pole_pairs] / v[HT_P_encoder_counts_rev];
    d->i_per_count = 2.0f * v[HT_P_i_full_A] / ADC_FULL;
    d->v_per_count = v[HT_P_vdc_full_V] / ADC_FULL;
    d->calibration_ticks = (uint16_t)(v[HT_P_calibration_s] * v[HT_P_f_isr_Hz]);
    d->build_ticks = (uint32_t)(v[HT_P_build_s] * v[HT_P_f_isr_Hz]);
}

static void enter(ht_drive *d, ht_state state)
{
    d->state_ticks = 0u; /* first: the interrupt acts on the state */
    d->state = (uint16_t)state;
}

static void set_flux_ref(ht_drive *d, float flux_Wb)
{
    d->in.flux_ref_Wb = flux_Wb;
    d->in.inv_flux_ref2 = (flux_Wb > 0.0f) ? (1.0f / (flux_Wb * flux_Wb)) : 0.0f;
}

/* Parameters to control configuration and PWM set-up, checked as a whole. */
static ht_result prepare(const ht_port *port, const ht_params *p, ht_control_config *config,
                         ht_pwm_setup *setup)
{
    float clock_Hz = ht_port_pwm_clock_Hz(port);
    if (!configure(p, clock_Hz, config)) {
        return HT_ERROR_CONFIG;
    }
    setup->period_counts = config->period_counts;
    setup->dead_counts = (uint16_t)(p->v[HT_P_dead_time_us] * 1.0e-6f * clock_Hz + 0.5f);
    setup->shadow = config->shadow;
    return ht_port_accepts(port, setup) ? HT_OK : HT_ERROR_PORT;
}

/* All that parameters decide, from a machine without flux on. What is known of the
 * shaft and of the faults so far is no matter of parameters and stays. */
static ht_result set_up(ht_drive *d, ht_port *port, const ht_params *p)
{
    ht_control_config config;
    ht_pwm_setup setup;
    ht_result result;
    ht_six none = {{0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f}};
    int leg;
    result = prepare(port, p, &config, &setup);
    if (result != HT_OK) {
        return result;
    }
    if (!ht_port_init(port, &setup)) {
        return HT_ERROR_PORT;
    }
    d->port = port;
    d->params = *p;
    d->config = config;
    d->staged = config;
    d->staged_ready = 0u;
    apply_slow(d);
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->offset_counts[leg] = ADC_MID;
        d->offset_sum[leg] = 0u;
    }
    d->in.i_A = none;
    d->in.vdc_V = 0.0f;
    d->in.torque_ref_Nm = 0.0f;
    d->in.turn_rad = 0.0f;
    set_flux_ref(d, p->v[HT_P_flux_ref_Wb]);
    ht_control_reset(&d->config, &d->control, &none);
    d->speed.integral_Nm = 0.0f;
    ht_speed_measure_reset(&d->measured);
    d->torque_ref_Nm = 0.0f;
    d->flux_ref_Wb = p->v[HT_P_flux_ref_Wb];
    d->flux_top_Wb = p->v[HT_P_flux_ref_Wb];
    d->omega_mean_rad_s = 0.0f;
    d->dodging = 0u;
    d->slow_faults = 0u;
    d->stuck_leg = 0u;
    ht_protect_reset(&d->protect);
    enter(d, HT_STATE_IDLE);
    return HT_OK;
}

ht_result ht_drive_init(ht_drive *d, ht_port *port, const ht_params *p)
{
    ht_result result;
    uint16_t id;
    for (id = 0u; id < HT_PARAMS; id++) {
        if (!ht_param_valid(id, p->v[id])) {
            return HT_ERROR_VALUE;
        }
    }
    result = set_up(d, port, p);
    if (result != HT_OK) {
        return result;
    }
    d->tick = 0u;
    ht_port_read(port, &d->samples); /* the counter may stand anywhere */
    d->position_last = d->samples.position;
    d->position_now = d->samples.position;
    d->speed_rpm = 0.0f;
    d->faults = 0u;
    d->snapshot.tick = 0u;
    return HT_OK;
}

static void measure(ht_drive *d)
{
    const ht_samples *s = &d->samples;
    float turn = (float)(int32_t)(s->position - d->position_now) * d->turn_per_count;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->in.i_A.p[leg] = ((float)s->adc[HT_ADC_I + leg] - d->offset_counts[leg]) * d->i_per_count;
    }
    d->in.vdc_V = (float)s->adc[HT_ADC_VDC] * d->v_per_count;
    d->in.turn_rad = (turn > TURN_MAX_RAD) ? TURN_MAX_RAD
                                           : ((turn < -TURN_MAX_RAD) ? -TURN_MAX_RAD : turn);
    d->position_now = s->position;
}

/* The latch was released in the first interrupt of BUILD. */
static bool gates_should_be_on(const ht_drive *d)
{
    return (d->state == (uint16_t)HT_STATE_RUN)
           || ((d->state == (uint16_t)HT_STATE_BUILD) && (d->state_ticks > 1u));
}

static void fault(ht_drive *d, uint16_t bits)
{
    ht_port_gates_off(d->port);
    if (d->state != (uint16_t)HT_STATE_FAULT) {
        d->snapshot.tick = d->tick;
        d->snapshot.state = d->state;
        d->snapshot.faults = bits;
        d->snapshot.samples = d->samples;
        d->snapshot.in = d->in;
        d->snapshot.estimate = d->control.estimate;
        d->snapshot.speed_rpm = d->speed_rpm;
        enter(d, HT_STATE_FAULT);
    }
    d->faults = (uint16_t)(d->faults | bits);
}

/* Everything that is known before the control step. */
static uint16_t protect(ht_drive *d)
{
    bool powered = gates_should_be_on(d);
    uint16_t faults =
        ht_protect_samples(&d->protect_config, &d->in, d->speed_rpm, powered);
    if (powered) {
        faults |= ht_protect_stuck(&d->protect_config, &d->protect, &d->samples, d->stuck_leg);
        d->stuck_leg = (uint16_t)((d->stuck_leg + 1u) % HT_LEGS);
        if (ht_port_tripped(d->port)) {
            faults |= HT_FAULT_EXTERNAL;
        }
    }
    if (d->state == (uint16_t)HT_STATE_RUN) {
        faults |= d->slow_faults;
    }
    return faults;
}

static void calibrate(ht_drive *d)
{
    int leg;
    if (d->state_ticks == 1u) { /* all legs low before the gates ever come on */
        ht_compare low;
        ht_control_low_pattern(&d->config, &low);
        ht_port_write(d->port, &low);
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->offset_sum[leg] += d->samples.adc[HT_ADC_I + leg];
    }
    if (d->state_ticks < d->calibration_ticks) {
        return;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        float mean = (float)d->offset_sum[leg] / (float)d->state_ticks;
        if (!finite_below(mean - ADC_MID, OFFSET_MAX_COUNTS)) {
            fault(d, HT_FAULT_CALIBRATION);
            return;
        }
        d->offset_counts[leg] = mean;
    }
    measure(d);
    ht_protect_reset(&d->protect);
    d->slow_faults = 0u; /* of the run before: the slow loop may not have come by since */
    ht_control_reset(&d->config, &d->control, &d->in.i_A);
    d->speed.integral_Nm = 0.0f;
    d->torque_ref_Nm = 0.0f;
    enter(d, HT_STATE_BUILD);
}

static void build(ht_drive *d, ht_compare *out)
{
    float share = (float)d->state_ticks / (float)(d->build_ticks + 1u);
    set_flux_ref(d, d->params.v[HT_P_flux_ref_Wb] * ((share < 1.0f) ? share : 1.0f));
    d->in.torque_ref_Nm = 0.0f;
    ht_control_build_step(&d->config, &d->control, &d->in, out);
    ht_port_write(d->port, out);
    if (d->state_ticks == 1u) {
        ht_port_gates_on(d->port); /* only once a pattern is in place */
    }
    if (d->state_ticks >= d->build_ticks) {
        set_flux_ref(d, d->params.v[HT_P_flux_ref_Wb]);
        d->flux_ref_Wb = d->params.v[HT_P_flux_ref_Wb];
        d->flux_top_Wb = d->params.v[HT_P_flux_ref_Wb];
        d->omega_mean_rad_s = 0.0f;
        d->dodging = 0u;
        enter(d, HT_STATE_RUN);
    }
}

static void run(ht_drive *d, ht_compare *out)
{
    d->in.torque_ref_Nm = d->torque_ref_Nm;
    if (d->in.flux_ref_Wb != d->flux_ref_Wb) {
        set_flux_ref(d, d->flux_ref_Wb);
    }
    ht_control_step(&d->config, &d->control, &d->in, out);
    ht_port_write(d->port, out);
}

void ht_drive_fast_isr(ht_drive *d)
{
    ht_compare out;
    uint16_t faults;

    ht_port_begin_fast(d->port);
    ht_port_read(d->port, &d->samples);
    d->tick++;
    if ((d->state != (uint16_t)HT_STATE_IDLE) && (d->state != (uint16_t)HT_STATE_FAULT)) {
        d->state_ticks++; /* else a start that this interrupt comes into would lose a tick */
    }
    if (d->staged_ready != 0u) {
        d->config = d->staged;
        d->staged_ready = 0u;
    }
    measure(d);
    if ((d->state != (uint16_t)HT_STATE_IDLE) && (d->state != (uint16_t)HT_STATE_FAULT)) {
        faults = protect(d);
        if (faults != 0u) {
            fault(d, faults);
        }
    }
    switch ((ht_state)d->state) {
    case HT_STATE_CALIBRATE:
        calibrate(d);
        break;
    case HT_STATE_BUILD:
        build(d, &out);
        break;
    case HT_STATE_RUN:
        run(d, &out);
        break;
    case HT_STATE_IDLE:
    case HT_STATE_FAULT:
    default:
        if (!ht_port_tripped(d->port)) {
            ht_port_gates_off(d->port); /* whoever released the latch: not in these states */
        }
        break;
    }
    if ((d->state == (uint16_t)HT_STATE_RUN) || (d->state == (uint16_t)HT_STATE_BUILD)) {
        faults = ht_protect_results(&d->protect_config, &d->control, d->in.torque_ref_Nm);
        if (ht_port_overrun(d->port)) {
            faults |= HT_FAULT_OVERRUN;
        }
        if (faults != 0u) {
            fault(d, faults);
        }
    }
    ht_port_ack_fast(d->port);
}

/* What the parameters allow and the flux can give. */
static float torque_limit(const ht_drive *d)
{
    float limit = d->params.v[HT_P_torque_limit_Nm];
    float reach = d->pull_out_Nm_Wb2 * d->flux_ref_Wb * d->flux_ref_Wb;
    return (reach < limit) ? reach : limit;
}

/* Where load and speed make the flux stand still, nothing tells R_r, and a drive with a
 * wrong one may settle just there: more flux, less slip, no more turning. A little less
 * flux makes more slip, and the flux turns again. */
static void keep_off_zero_frequency(ht_drive *d)
{
    const float *v = d->params.v;
    float psi = d->flux_top_Wb;
    /* i_q/i_d of the reference */
    float load = d->torque_ref_Nm * d->protect_config.ls_H
                 / (d->config.observer.torque_gain * psi * psi);
    float size;
    d->omega_mean_rad_s +=
        d->omega_mean_gain * (d->control.observer.omega_sync_rad_s - d->omega_mean_rad_s);
    size = (d->omega_mean_rad_s < 0.0f) ? -d->omega_mean_rad_s : d->omega_mean_rad_s;
    if ((d->config.observer.kind != HT_OBSERVER_HYBRID) || !(v[HT_P_adapt_s] > 0.0f)
        || finite_below(load, DODGE_LOAD) || (size > 2.0f * DODGE_RAD_S)) {
        d->dodging = 0u;
    } else if (size < DODGE_RAD_S) {
        d->dodging = 1u;
    } else {
        /* as it was */
    }
}

/* A new flux reference is approached as fast as the build-up is: a step would tear the
 * stator's flux from the rotor's, which cannot follow. */
static void ramp_flux_top(ht_drive *d)
{
    const float *v = d->params.v;
    float wanted = v[HT_P_flux_ref_Wb] * ((d->dodging != 0u) ? DODGE_FLUX : 1.0f);
    float larger = (wanted > d->flux_top_Wb) ? wanted : d->flux_top_Wb;
    float step = larger / (v[HT_P_build_s] * v[HT_P_f_slow_Hz]);
    float missing = wanted - d->flux_top_Wb;
    d->flux_top_Wb += (missing > step) ? step : ((missing < -step) ? -step : missing);
}

void ht_drive_slow_isr(ht_drive *d)
{
    const float *v = d->params.v;
    uint32_t position = d->position_now; /* once: the fast interrupt may come in between */
    int32_t moved = (int32_t)(position - d->position_last);
    ht_speed_config speed = d->speed_config;
    ht_capture capture;
    d->position_last = position;
    ht_port_read_capture(d->port, &capture);
    d->speed_rpm = ht_speed_measure_step(&d->measure_config, &d->measured, moved, &capture);
    if (d->state != (uint16_t)HT_STATE_RUN) {
        d->slow_faults = 0u;
        if ((d->state == (uint16_t)HT_STATE_BUILD) && (d->adapt_gain > 0.0f)
            && (d->config.observer.kind == HT_OBSERVER_HYBRID)) {
            ht_observer_adapt(&d->config.observer, &d->control.observer, d->build_gain);
        }
        return;
    }
    d->slow_faults =
        ht_protect_slow(&d->protect_config, &d->protect, &d->control, d->speed_rpm);
    /* Where nothing adapts, the resistances in use are the configured ones. */
    ht_observer_adapt(&d->config.observer, &d->control.observer,
                      (d->config.observer.kind == HT_OBSERVER_HYBRID) ? d->adapt_gain : 0.0f);
    keep_off_zero_frequency(d);
    ramp_flux_top(d);
    if (v[HT_P_field_weakening] != 0.0f) {
        ht_flux_config flux = d->flux_config;
        ht_ab i = d->control.observer.i_prev_A.ab;
        float a = (i.alpha < 0.0f) ? -i.alpha : i.alpha;
        float b = (i.beta < 0.0f) ? -i.beta : i.beta;
        /* |i| within 4 %: alpha max plus beta min */
        float size = (a > b) ? (0.96f * a + 0.398f * b) : (0.96f * b + 0.398f * a);
        flux.flux_ref_Wb = d->flux_top_Wb;
        d->flux_ref_Wb = ht_flux_reference(&flux, d->in.vdc_V,
                                           d->control.observer.omega_sync_rad_s, size);
    } else {
        d->flux_ref_Wb = d->flux_top_Wb;
    }
    /* The flux may be on its way down: the torque goes first. */
    speed.torque_limit_Nm = torque_limit(d);
    if (v[HT_P_control_mode] != 0.0f) {
        float limit = speed.torque_limit_Nm;
        float wanted = v[HT_P_torque_ref_Nm];
        d->torque_ref_Nm = (wanted > limit) ? limit : ((wanted < -limit) ? -limit : wanted);
        d->speed.integral_Nm = d->torque_ref_Nm; /* bumpless return to speed mode */
    } else {
        float error = (v[HT_P_speed_ref_rpm] - d->speed_rpm) * (PI_F / 30.0f);
        d->torque_ref_Nm = ht_speed_step(&speed, &d->speed, error);
    }
}

ht_result ht_drive_start(ht_drive *d)
{
    int leg;
    if ((d->state != (uint16_t)HT_STATE_IDLE) || (d->faults != 0u)) {
        return HT_ERROR_STATE; /* a fault that a stop overtook still wants its clear */
    }
    if (!finite_below(d->speed_rpm, d->params.v[HT_P_start_max_rpm])) {
        return HT_ERROR_TURNING;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->offset_sum[leg] = 0u;
        d->offset_counts[leg] = ADC_MID;
    }
    enter(d, HT_STATE_CALIBRATE);
    return HT_OK;
}

void ht_drive_stop(ht_drive *d)
{
    /* State first: a fast interrupt in between must not turn the gates on again. */
    if (d->state != (uint16_t)HT_STATE_FAULT) {
        enter(d, HT_STATE_IDLE);
    }
    ht_port_gates_off(d->port);
}

ht_result ht_drive_clear(ht_drive *d)
{
    if ((d->state != (uint16_t)HT_STATE_FAULT) && (d->faults == 0u)) {
        return HT_ERROR_STATE;
    }
    d->faults = 0u;
    enter(d, HT_STATE_IDLE);
    return HT_OK;
}

ht_result ht_drive_set(ht_drive *d, uint16_t id, float value)
{
    ht_params trial = d->params;
    ht_control_config config;
    ht_pwm_setup setup;
    ht_result result;
    const ht_param_info *info = ht_param_describe(id);
    if (info == 0) {
        return HT_ERROR_ID;
    }
    if (!ht_param_valid(id, value)) {
        return HT_ERROR_VALUE;
    }
    if ((info->when == HT_WHEN_IDLE) && (d->state != (uint16_t)HT_STATE_IDLE)) {
        return HT_ERROR_STATE;
    }
    trial.v[id] = value;
    result = prepare(d->port, &trial, &config, &setup);
    if (result != HT_OK) {
        return result;
    }
    if (info->when == HT_WHEN_IDLE) {
        /* Timing and scaling reach into the PWM: set it all up again. */
        return set_up(d, d->port, &trial);
    }
    d->params = trial;
    d->staged_ready = 0u; /* the interrupt must not take a half-written copy */
    d->staged = config;
    d->staged_ready = 1u;
    apply_slow(d);
    return HT_OK;
}

float ht_drive_get(const ht_drive *d, uint16_t id)
{
    return (id < HT_PARAMS) ? d->params.v[id] : 0.0f;
}
