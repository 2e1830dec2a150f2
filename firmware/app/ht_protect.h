/** @file ht_protect.h
 *  Protection: finds the faults that must turn the gates off, from samples, estimates and speed.
 *  The functions only return fault bits (ht_faults.h); the drive acts on them. A NaN fails every
 *  check.
 */
#ifndef HT_PROTECT_H
#define HT_PROTECT_H

#include "ht_control.h"
#include "ht_faults.h"
#include "port.h"

typedef struct {
    float i_trip_A;     /**< any phase */
    float i_ab_trip_A;  /**< magnitude in alpha-beta */
    float i_sum_trip_A; /**< sum of a set */
    float vdc_min_V;
    float vdc_max_V;
    float flux_trip_Wb; /**< either component of the estimate */
    float speed_trip_rpm;
    float encoder_trip_rpm; /**< measured against estimated speed; 0 = off */
    float flux_check;       /**< distance from the circle diagram, rms, units of
                             *   `no_load_A`; 0 = off */
    float no_load_A;        /**< no-load current at the flux reference, psi/L_s */
    float stuck_counts;     /**< counts that a phase may move while its reading stays; 0 = off */
    float ls_H;             /**< stator inductance */
    float sigma;            /**< leakage factor */
    float slip_gain;        /**< R_r (L_m/L_r)^2, configured */
    float rpm_per_rad_s;    /**< electrical rad/s to r/min of the shaft */
    float flux_gain;        /**< low-pass gain of `flux_check` per slow interrupt */
    float rotor_gain;       /**< low-pass gain of rotor flux and current per slow interrupt */
    float magnetise_A_Wb;   /**< current that the low pass of the rotor flux takes to rise, per
                             *   weber by which the rotor flux is ahead of it */
    float slow_Hz;          /**< of the slow interrupt */
    float slow_turns_s;     /**< its period over a turn, s/rad */
    float encoder_gain;     /**< low-pass gain of `encoder_trip_rpm` per slow interrupt */
    ht_rotor rotor;         /**< its kind */
    float inv_psi_f;        /**< 1 / flux linkage of the magnets */
    float counts_quick;     /**< low-pass gains of the encoder's counts per fast interrupt */
    float counts_slow;
    float most_counts; /**< `encoder_trip_rpm` as counts in a fast period; 0 = off */
} ht_protect_config;

typedef struct {
    uint16_t count[HT_LEGS]; /**< reading at the last change */
    uint16_t other[HT_LEGS]; /**< sum of the set's other two readings then */
    uint16_t same[HT_LEGS];  /**< checks since then */
    float circle2;           /**< mean square distance from the circle diagram */
    float rotor_Wb;          /**< low pass of the rotor flux, as seen from the stator */
    float rotor_now_Wb;      /**< the rotor flux itself */
    ht_ab i_A;               /**< low pass of the current along and across the rotor flux */
    ht_ab flux_Wb;           /**< of the rotor, at the slow interrupt before; 0: not known */
    float omega_rad_s;       /**< the flux's speed by the observer then */
    float speed_error_rpm;   /**< mean of measured minus estimated speed */
    float counts_quick; /**< of a rotor with a d axis: means of the encoder's counts in a period */
    float counts_slow;
    float off2; /**< the latest square that `circle2` is the mean of */
} ht_protect_state;

void ht_protect_reset(ht_protect_state *st);

/** Check the samples of a fast interrupt. `powered`: the gates are on and the current sensors'
 *  offsets are known. */
uint16_t ht_protect_samples(const ht_protect_config *cfg, const ht_control_input *in,
                            float speed_rpm, bool powered);

/** Check one leg's current sensor; each fast interrupt checks the next leg. The sensor is stuck
 *  if its reading has not changed over `HT_STUCK_LOOKS` checks while the sum of the set's other
 *  two readings, which is minus the phase's current, changed by `stuck_counts`. (One of the two
 *  alone may change: under a load at standstill, across the phase's axis.) */
uint16_t ht_protect_stuck(const ht_protect_config *cfg, ht_protect_state *st, const ht_samples *s,
                          uint16_t leg);
#define HT_STUCK_LOOKS 50u

/** Of a rotor with a d axis, in each fast interrupt: `moved` counts of the encoder in the last period. No shaft
 *  changes its speed by 30 %, and by `encoder_trip_rpm`, within the time between the two means. The
 *  field follows the encoder, so the flux's speed tells nothing about it. */
uint16_t ht_protect_encoder(const ht_protect_config *cfg, ht_protect_state *st, float moved);

/** Check the results of the control step: finite, and currents and flux within bounds. */
uint16_t ht_protect_results(const ht_protect_config *cfg, const ht_control_state *c,
                            float torque_ref_Nm);

/** For the slow interrupt in BUILD: nothing is checked, but rotor flux and current are followed. */
void ht_protect_follow(const ht_protect_config *cfg, ht_protect_state *st,
                       const ht_control_state *c);

/** For the slow interrupt in RUN: what the kind of rotor tells about flux and encoder (`ht_<kind>_protect`). */
uint16_t ht_protect_slow(const ht_protect_config *cfg, ht_protect_state *st,
                         const ht_control_state *c, float speed_rpm);

/** The flux is off by the square root of `off2`, units of `flux_check`, at present. Is its mean square
 *  beyond the limit? */
uint16_t ht_protect_flux(const ht_protect_config *cfg, ht_protect_state *st, float off2);

#endif
