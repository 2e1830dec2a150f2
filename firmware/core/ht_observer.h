/** @file ht_observer.h
 *  Stator flux and torque, and their value one period ahead.
 *
 *  Voltage model (the papers'): d psi/dt = v - R_s i. Needs R_s only, but it is a
 *  pure integrator: whatever is wrong with v or i adds up, and the control loop
 *  hides it by holding the estimate on its circle.
 *
 *  Hybrid: adds g (psi_cm - psi), where psi_cm is the current model's flux, so
 *  that below the crossover g the current model rules. Needs the rotor's
 *  parameters and the measured speed as well.
 *
 *  The prediction also needs sigma L_s and the x-y inductance.
 */
#ifndef HT_OBSERVER_H
#define HT_OBSERVER_H

#include "ht_types.h"

typedef struct {
    float ts_s;             /**< sampling period, s */
    float inv_ts;           /**< 1 / ts_s */
    float rs_ohm;           /**< stator resistance */
    float sigma_ls_H;       /**< stator transient inductance, sigma L_s */
    float inv_sigma_ls;     /**< 1 / sigma_ls_H */
    float lxy_H;            /**< x-y plane inductance */
    float torque_gain;      /**< 3 P (amplitude-invariant six-phase transform) */
    float hybrid_gain;      /**< g Ts: crossover times period, 0 = voltage model */
    float rotor_decay;      /**< Ts R_r / L_r */
    float rotor_drive;      /**< Ts R_r L_m / L_r */
    float lm_over_lr;
    float omega_gain;       /**< Ts-normalised low-pass gain of omega_sync, 0..1 */
} ht_observer_config;

typedef struct {
    ht_ab psi_Wb;           /**< stator flux */
    ht_ab psi_r_Wb;         /**< rotor flux of the current model */
    ht_vsd i_prev_A;        /**< currents at the sample before */
    float omega_sync_rad_s; /**< mean electrical speed of the stator flux */
} ht_observer_state;

/** Machine quantities at one instant. */
typedef struct {
    ht_ab psi_Wb;
    float torque_Nm;
    ht_xy psi_xy_Wb; /**< L_xy i_xy */
} ht_estimate;

/** Start from a demagnetised machine with currents `i`. */
void ht_observer_reset(ht_observer_state *st, const ht_vsd *i);

/** Advance by one period: `v_V` is the mean voltage since the last sample, `i`
 *  the currents now, `omega_r` the rotor's electrical speed (hybrid only),
 *  `inv_psi_ref2` = 1 / (flux reference)^2. */
ht_estimate ht_observer_update(const ht_observer_config *cfg, ht_observer_state *st,
                               const ht_vsd *v_V, const ht_vsd *i, float omega_r,
                               float inv_psi_ref2);

/** The estimate one period ahead, under the mean voltage `v_V` that is already
 *  committed. The rotor flux seen from the stator, psi_s - sigma L_s i_s, is
 *  taken to turn on with the mean speed of the stator flux, so no rotor
 *  parameter is needed. */
ht_estimate ht_observer_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                                const ht_estimate *now, const ht_vsd *v_V, const ht_vsd *i);

#endif
