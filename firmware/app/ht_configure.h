/** @file ht_configure.h
 *  Derives the values that the interrupts use from the parameters.
 */
#ifndef HT_CONFIGURE_H
#define HT_CONFIGURE_H

#include "ht_absolute.h"
#include "ht_alignment.h"
#include "ht_index.h"
#include "ht_control.h"
#include "ht_derating.h"
#include "ht_device_heat.h"
#include "ht_excitation.h"
#include "ht_flux_brake.h"
#include "ht_heat.h"
#include "ht_least_loss.h"
#include "ht_look.h"
#include "ht_ntc.h"
#include "ht_outputs.h"
#include "ht_params.h"
#include "ht_protect.h"
#include "ht_ramp.h"
#include "ht_result.h"
#include "ht_set_difference.h"
#include "ht_short_circuit.h"
#include "ht_speed.h"
#include "ht_speed_measure.h"
#include "ht_vdc.h"
#include "port.h"

/** The values that the interrupts derive from the parameters. They are prepared as a whole and taken over as a
 *  whole, because interrupts may come at any time. What concerns the PWM or the scaling changes
 *  with the gates off only; that is in the drive itself. */
typedef struct {
    ht_control_config control;
    ht_protect_config protect;
    ht_speed_config speed;
    ht_ramp_config ramp; /**< of the speed reference */
    ht_ramp_config stop; /**< the same for a stop, by `motion` */
    ht_speed_measure_config measure;
    ht_flux_config flux;
    ht_vdc_config vdc;
    ht_heat_config heat;
    ht_device_heat_config device_heat;
    float omega_mean_gain;
    float lxy_gain;        /**< of L_xy that the check of the legs learns, per slow interrupt */
    float pull_out_Nm_Wb2; /**< torque limit per flux squared */
    ht_derating_config derating;
    ht_least_loss_config least_loss;
    ht_set_difference_config sets;
    float adapt_gain; /**< of the resistances, per slow interrupt */
    float build_gain; /**< the same during the build-up */
    float flux_gain;  /**< of the rotor's own flux */
    float built;      /**< slow interrupts of a build-up whose R_s tells something */
    ht_params params; /**< the parameters that all this is derived from */
    ht_excitation_config excitation;
    bool has_axis;                 /**< the rotor has a d axis: it is aligned, not magnetised */
    ht_alignment_config alignment; /**< of a rotor with a d axis */
    ht_short_circuit_config short_circuit;
    ht_outputs_config outputs;
    ht_ntc_config ntc[HT_SLOW_CHANNELS];
    ht_index_config index;
    ht_absolute_config absolute;
    ht_flux_brake_config flux_brake;
} ht_drive_config;

/** Range of a parameter on the hardware behind `port`: the table's, except for the dead time,
 *  which the board limits further. Empty (0 .. 0) for an unknown id. */
typedef struct {
    float min;
    float max;
} ht_range;

ht_range ht_param_range(const ht_port *port, uint16_t id);

/** Share of the pull-out torque that is asked for: beyond it more slip gives less torque, and the
 *  controller, which answers with more slip, loses the machine. */
#define HT_PULL_OUT_SHARE 0.8f

/** With magnets: time constant of the slow mean of the encoder's counts. A shaft must not change its
 *  speed by `encoder_trip_rpm` within it; the quick mean has a tenth of it, so an encoder that stops is
 *  found within 2 ms. */
#define HT_COUNTS_SLOW_S 0.003f

/** True if `value` is finite, in `ht_param_range` and, for choices, whole. */
bool ht_configure_valid(const ht_port *port, uint16_t id, float value);

/** Value of the parameter `rotor_start` with which the index is waited for. */
#define HT_ROTOR_START_INDEX 2.0f

/** Values of the parameter `motion`. */
enum { HT_MOTION_FOLLOW = 0, HT_MOTION_STOP = 1, HT_MOTION_QUICK_STOP = 2 };

/** Control configuration and PWM set-up of `c->params`, which are each in range. Refuses
 *  those that do not fit together (HT_ERROR_CONFIG) or the hardware (HT_ERROR_PORT).
 *  `c->control` is then half-written. */
ht_result ht_configure(const ht_port *port, ht_drive_config *c, ht_pwm_setup *setup);

/** The values outside the control configuration that follow from `c->params` and may change while
 *  the drive runs: speed loop, flux reference, protection. */
void ht_configure_rest(const ht_port *port, ht_drive_config *c);

#endif
