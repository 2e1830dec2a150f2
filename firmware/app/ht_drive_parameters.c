/* From parameters to a drive: what follows from them, whole, either before the interrupts come or handed
 * to the next one. */
#include "ht_drive_inside.h"
#include "ht_misfit.h"

#include <stddef.h>

#define PI_F 3.14159265f
#define ALL_OUTPUTS 0xFFFFu

/* Where the next configuration is written, in `*next`: the copy that is not in force. The interrupt
 * takes nothing over until `staged` is set again. Returns what was staged and not taken yet, or NULL. */
static const ht_drive_config *unstage(ht_drive *d, ht_drive_config **next)
{
    const ht_drive_config *waiting = d->staged;
    d->staged = NULL; /* the interrupt must not take a half-written copy */
    *next = (ht_config_in_force(d) == &d->configs[0]) ? &d->configs[1] : &d->configs[0];
    return waiting;
}

/* After a refusal: if the parameters that were accepted before were still `waiting` in `next`, they are
 * put there again and staged. */
static void restore(ht_drive *d, const ht_drive_config *waiting, ht_drive_config *next)
{
    ht_pwm_setup setup;
    if (waiting == next) { /* its other parts are still those of d->params */
        next->params = d->params;
        (void)ht_configure(d->port, next, &setup);
        d->staged = next;
    }
}

/* New parameters, `next->params`, for a drive that may be running: checked, then handed to the next
 * fast interrupt. After an error the caller restores. */
static ht_result change_live(ht_drive *d, ht_drive_config *next)
{
    ht_pwm_setup setup;
    ht_result result = ht_configure(d->port, next, &setup);
    if (result == HT_OK) {
        d->params = next->params;
        ht_configure_rest(d->port, next);
        d->staged = next;
    }
    return result;
}

/* Scaling and times, which only change with the gates off. */
static void set_scales(ht_drive *d)
{
    const float *v = d->params.v;
    float ticks;
    d->turn_per_count = 2.0f * PI_F * v[HT_P_pole_pairs] / v[HT_P_encoder_counts_rev];
    d->i_per_count = 2.0f * v[HT_P_i_full_A] / (float)HT_ADC_FULL;
    d->v_per_count = v[HT_P_vdc_full_V] / (float)HT_ADC_FULL;
    ticks = v[HT_P_calibration_s] * v[HT_P_f_isr_Hz];
    d->calibration_ticks = (uint16_t)ticks;
    ticks = v[HT_P_build_s] * v[HT_P_f_isr_Hz];
    d->build_ticks = (uint32_t)ticks;
}

static const ht_six none = {{0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f}};

/* Everything that depends on parameters, `next->params`, for a machine without flux. What is known
 * of the shaft and of the faults does not depend on them and stays. After an error the caller
 * restores. */
static ht_result set_up(ht_drive *d, ht_port *port, ht_drive_config *next)
{
    ht_pwm_setup setup;
    ht_result result = ht_configure(port, next, &setup);
    int leg;
    if ((result == HT_OK) && !ht_port_init(port, &setup)) {
        result = HT_ERROR_PORT;
    }
    if (result != HT_OK) {
        return result;
    }
    d->port = port;
    d->params = next->params;
    ht_configure_rest(port, next);
    d->config = next;
    ht_drive_look(d);
    set_scales(d);
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->offset_counts[leg] = (float)HT_ADC_MID;
        d->offset_sum[leg] = 0u;
    }
    ht_drive_set_levels(d);
    d->in.i_A = none;
    d->in.vdc_V = 0.0f;
    d->in.torque_ref_Nm = 0.0f;
    d->in.turn_rad = 0.0f;
    d->in.omega_rad_s = 0.0f;
    ht_drive_set_flux_ref(d, d->params.v[HT_P_flux_ref_Wb]);
    d->flux_ramp_Wb = d->flux_ref_Wb;
    ht_control_reset(&d->config->control, &d->control, &none);
    ht_speed_reset(&d->speed);
    ht_speed_measure_reset(&d->measured);
    d->torque_ref_Nm = 0.0f;
    d->omega_mean_rad_s = 0.0f;
    d->flux_lowered = 0u;
    d->flux_unknown = 1.0f;
    d->catches = 0u;
    d->off_ticks = 0xFFFFu;
    ht_least_loss_reset(&d->least_loss, d->flux_ref_Wb);
    ht_flux_brake_reset(&d->flux_brake);
    d->torque_limit_Nm = d->params.v[HT_P_torque_limit_Nm];
    d->torque_least_Nm = -d->torque_limit_Nm;
    d->torque_limited_by = (uint16_t)HT_LIMIT_TORQUE;
    d->limits = 0u;
    ht_ramp_reset(&d->ramp, 0.0f);
    d->motion = (uint16_t)HT_MOTION_FOLLOW;
    d->along_A = 0.0f;
    d->slow_faults = 0u;
    d->off_legs = 0u;
    d->rotor_faults = 0u;
    d->rotor.electrical = 0u;
    d->in.axis.alpha = 1.0f;
    d->in.axis.beta = 0.0f;
    d->stuck_leg = 0u;
    d->heat_turn = 0u;
    d->looked = 0u;
    d->look_wait = 0u;
    ht_protect_reset(&d->protect);
    ht_short_circuit_reset(&d->short_circuit);
    d->taken_tick = d->tick + 1u;
    ht_drive_enter(d, HT_STATE_IDLE);
    return HT_OK;
}

ht_result ht_drive_init(ht_drive *d, ht_port *port, const ht_params *p)
{
    ht_drive_config *next;
    ht_result result;
    uint16_t id;
    uint16_t row;
    for (id = 0u; id < HT_PARAMS; id++) {
        if (!ht_configure_valid(port, id, p->v[id])) {
            return HT_ERROR_VALUE;
        }
    }
    (void)unstage(d, &next); /* memory may hold anything */
    next->params = *p;
    d->tick = 0u; /* before the set-up, which reads them */
    d->chops = 0u;
    for (row = 0u; row < (uint16_t)HT_LIMITS; row++) {
        d->limit_from[row] = 0u;
        d->limit_to[row] = 0u;
    }
    result = set_up(d, port, next);
    if (result != HT_OK) {
        return result;
    }
    ht_port_read(port, &d->samples); /* the counter may stand anywhere */
    d->position_last = d->samples.position;
    d->position_now = d->samples.position;
    d->speed_rpm = 0.0f;
    d->faults = 0u;
    d->warnings = 0u;
    d->heat_warnings = 0u;
    d->heat_share = 1.0f;
    d->built = 0.0f;
    ht_outputs_reset(&d->outputs);
    ht_port_outputs(port, ALL_OUTPUTS, 0u);
    ht_heat_reset(&d->heat);
    ht_device_heat_reset(&d->device_heat);
    d->heat_faults = 0u;
    d->look_turn = 0u;
    for (row = 0u; row < (uint16_t)HT_SLOW_CHANNELS; row++) {
        ht_ntc_reset(&d->ntc[row]);
        d->sensors[row] = (uint16_t)HT_NTC_WHOLE;
    }
    d->slow_channel = (uint16_t)HT_SLOW_CHANNELS;
    d->snapshot.tick = 0u;
    d->end_counts = 0u;
    d->trips = 0u;
    d->trips_forgotten = 0u;
    d->trips_noticed = 0u;
    d->quiet_s = 0u;
    d->quiet_part_s = 0.0f;
    d->sets.ohm = 0.0f;
    d->tick_last = d->tick - 1u;
    return HT_OK;
}

ht_result ht_drive_write(ht_drive *d, const uint16_t *ids, const float *values, uint16_t n,
                         uint16_t *at)
{
    const ht_drive_config *waiting;
    ht_drive_config *next;
    bool set_up_again = false;
    ht_result result;
    uint16_t k;
    for (k = 0u; k < n; k++) {
        const ht_param_info *info = ht_param_describe(ids[k]);
        *at = ids[k];
        if (info == NULL) {
            return HT_ERROR_ID;
        }
        if (!ht_configure_valid(d->port, ids[k], values[k])) {
            return HT_ERROR_VALUE;
        }
        if (info->when == HT_WHEN_IDLE) {
            if (d->state != (uint16_t)HT_STATE_IDLE) {
                return HT_ERROR_STATE;
            }
            if (d->short_circuit.on != 0u) {
                return HT_ERROR_SHORT_CIRCUIT; /* the set-up takes the gates off */
            }
            set_up_again = true;
        }
    }
    /* The parameters are put together where they will be used: a copy takes much of the stack. */
    waiting = unstage(d, &next);
    next->params = d->params;
    for (k = 0u; k < n; k++) {
        next->params.v[ids[k]] = values[k];
    }
    /* Timing and scaling reach into the PWM: set it all up again. */
    result = set_up_again ? set_up(d, d->port, next) : change_live(d, next);
    if (result == HT_ERROR_CONFIG) {
        *at = (uint16_t)ht_misfit_of(&next->params, ht_port_pwm_clock_Hz(d->port));
    }
    if (result != HT_OK) {
        restore(d, waiting, next);
    }
    return result;
}

ht_result ht_drive_set(ht_drive *d, uint16_t id, float value)
{
    uint16_t at;
    return ht_drive_write(d, &id, &value, 1u, &at);
}

float ht_drive_get(const ht_drive *d, uint16_t id)
{
    return (id < HT_PARAMS) ? d->params.v[id] : 0.0f;
}
