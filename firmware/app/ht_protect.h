/** @file ht_protect.h
 *  Protection: what must turn the gates off, found from samples, estimates and
 *  speed. Pure functions over their own config and state; the drive acts on the
 *  bits they return. A NaN fails every check.
 */
#ifndef HT_PROTECT_H
#define HT_PROTECT_H

#include "ht_control.h"
#include "ht_faults.h"
#include "port.h"

typedef struct {
    float i_trip_A;         /**< any phase */
    float i_ab_trip_A;      /**< magnitude in alpha-beta */
    float i_sum_trip_A;     /**< sum of a set */
    float vdc_min_V;
    float vdc_max_V;
    float flux_trip_Wb;     /**< either component of the estimate */
    float speed_trip_rpm;
    float encoder_trip_rpm; /**< measured against estimated speed; 0 = off */
    float flux_check;       /**< distance from the circle diagram, rms, units of
                             *   `no_load_A`; 0 = off */
    float no_load_A;        /**< no-load current at the flux reference, psi/L_s */
    float stuck_counts;     /**< converter counts a phase must have moved unseen; 0 = off */
    float ls_H;             /**< stator inductance */
    float sigma;            /**< leakage factor */
    float slip_gain;        /**< R_r (L_m/L_r)^2, configured */
    float rpm_per_rad_s;    /**< electrical rad/s to r/min of the shaft */
    float flux_gain;        /**< low-pass gain of `flux_check` per slow interrupt */
    float estimate_back;    /**< by which share of a slow period the measured speed is
                             *   older than the flux's, 0..0.5 */
    float encoder_gain;     /**< low-pass gain of `encoder_trip_rpm` per slow interrupt */
} ht_protect_config;

typedef struct {
    uint16_t count[HT_LEGS]; /**< reading at the last change */
    uint16_t other[HT_LEGS]; /**< sum of the set's other two readings then */
    uint16_t same[HT_LEGS];  /**< looks since then */
    float circle2;           /**< mean square distance from the circle diagram */
    float estimated_rpm;     /**< of the slow interrupt before */
    float speed_error_rpm;   /**< mean of measured minus estimated speed */
} ht_protect_state;

void ht_protect_reset(ht_protect_state *st);

/** Samples of every fast interrupt. `powered`: the gates are on, offsets known. */
uint16_t ht_protect_samples(const ht_protect_config *cfg, const ht_control_input *in,
                            float speed_rpm, bool powered);

/** One look at one leg's sensor, for every fast interrupt in turn: stuck, if the
 *  reading has not moved by one count over `HT_STUCK_LOOKS` looks while the sum of
 *  its set's other two moved by `stuck_counts`, which tells where the phase went. (One
 *  of them alone may move: a load at standstill, across the phase's axis.) */
uint16_t ht_protect_stuck(const ht_protect_config *cfg, ht_protect_state *st,
                          const ht_samples *s, uint16_t leg);
#define HT_STUCK_LOOKS 50u

/** Results of the control step: finite, and currents and flux within bounds. */
uint16_t ht_protect_results(const ht_protect_config *cfg, const ht_control_state *c,
                            float torque_ref_Nm);

/** For the slow interrupt in RUN.
 *
 *  Flux: the controller holds the estimate on its circle whatever the machine does,
 *  so its size proves nothing. What it must fit is the current. With the stator
 *  current along and across the estimated flux, in units of its no-load current
 *  psi/L_s, as q and t, every steady state of a machine lies on the circle diagram
 *  (q - c)^2 + t^2 = (c - 1)^2, c = (1 + 1/sigma)/2; a wrong flux does not. The limit
 *  is in amperes: with a weakened field the current's ripple does not shrink.
 *
 *  Encoder: the shaft's speed is that of the flux minus slip, at one and the same time:
 *  a drive that accelerates must not look like one with a wrong encoder. */
uint16_t ht_protect_slow(const ht_protect_config *cfg, ht_protect_state *st,
                         const ht_control_state *c, float speed_rpm);

#endif
