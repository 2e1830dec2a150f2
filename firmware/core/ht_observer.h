/** @file ht_observer.h
 *  Estimates stator flux and torque at the latest sample, and predicts both one sampling period
 *  ahead. There are three observers:
 *
 *  - Voltage model, as in the papers: d psi/dt = v - R_s i. It needs R_s only. It is a pure
 *    integrator: every error of v and i adds up, and the control loop hides the error because it
 *    holds the estimate on its circle.
 *  - Compensated voltage model. A flux offset drives direct current through the machine. This
 *    model corrects the flux against the dc part of the measured currents. It needs
 *    sigma L_s as well. (A low-pass instead of the integrator would not help: the controller
 *    keeps the estimate free of dc, so the low-pass would have nothing to remove while the flux
 *    of the machine drifts.)
 *  - Hybrid: the voltage model, corrected towards the flux of the current model with the gain g0.
 *    Below the crossover g0 the current model decides. It needs the rotor's parameters and the
 *    encoder as well. The difference of the two models shows which resistance is wrong
 *    (`ht_observer_adapt`).
 *
 *  The prediction needs sigma L_s and the x-y inductance.
 */
#ifndef HT_OBSERVER_H
#define HT_OBSERVER_H

#include "ht_magnet.h"
#include "ht_rotor.h"

typedef enum {
    HT_OBSERVER_VOLTAGE = 0,
    HT_OBSERVER_COMPENSATED = 1,
    HT_OBSERVER_HYBRID = 2
} ht_observer_kind;

#define HT_OBSERVERS 3u

typedef struct {
    ht_observer_kind kind;
    float ts_s;         /**< sampling period, s */
    float inv_ts;       /**< 1 / ts_s */
    float rs_ohm;       /**< stator resistance */
    float sigma_ls_H;   /**< stator transient inductance, sigma L_s */
    float inv_sigma_ls; /**< 1 / sigma_ls_H */
    float lxy_H;        /**< x-y plane inductance */
    float torque_gain;  /**< 3 P (amplitude-invariant six-phase transform) */
    float hybrid_gain;  /**< g0 Ts: pull towards the current model times period */
    float rotor_decay;  /**< Ts R_r / L_r */
    float rotor_drive;  /**< Ts R_r L_m / L_r */
    float lm_over_lr;
    float omega_gain;        /**< Ts-normalised low-pass gain of omega_sync, 0..1 */
    ht_winding winding;      /**< angle of set 2 ahead of set 1 */
    ht_rotor rotor;          /**< its kind; with magnets sigma_ls_H is L_q */
    ht_magnet_config magnet; /**< that of `rotor` is used, others may hold anything */
} ht_observer_config;

typedef struct {
    ht_ab psi_Wb;   /**< stator flux */
    ht_ab psi_r_Wb; /**< rotor flux of the current model; with magnets as the stator sees it */
    ht_ab gap_Wb;   /**< voltage model's stator flux minus the current model's */
    ht_ab i_dc_A;   /**< dc part of the currents (compensated) */
    ht_ab i_A;      /**< currents of the latest sample */
    float
        omega_sync_rad_s; /**< mean electrical speed of the stator flux; with magnets, of the rotor */
    float rs_ohm;         /**< stator resistance in use */
    float rr_scale;       /**< rotor resistance in use, relative to the configured one */
    float more_Wb;        /**< with magnets: their flux in use less the configured one */
} ht_observer_state;

/** Machine quantities at one instant. */
typedef struct {
    ht_ab psi_Wb;
    float torque_Nm;
} ht_estimate;

/** Start from a demagnetised machine with currents `i_A` and the configured
 *  resistances. */
void ht_observer_reset(const ht_observer_config *cfg, ht_observer_state *st, ht_ab i_A);

/** Take the flux to stand still: while it is being built, and still too small for its speed to
 *  mean anything. */
void ht_observer_stand_still(ht_observer_state *st);

/** Advance by one sampling period. `v_V`: mean voltage since the last sample. `i_A`: currents
 *  now. `turn_rad`: electrical angle by which the rotor has turned since the last sample, used by
 *  the hybrid observer only. (A measured speed would be late by a slow period; the resulting
 *  error of the rotor flux would act like a negative inertia.) `inv_psi_ref2`:
 *  1 / (flux reference)^2, 1/Wb^2. */
ht_estimate ht_observer_update(const ht_observer_config *cfg, ht_observer_state *st, ht_ab v_V,
                               ht_ab i_A, float turn_rad, float inv_psi_ref2);

/** Every observer, one period without current, because the gates are off: the stator has the flux that the
 *  rotor's makes in it. This turns with the rotor, by `turn_rad`, and decays. */
void ht_observer_coast(const ht_observer_config *cfg, ht_observer_state *st, float turn_rad);

/** Every observer, while a turning shaft is caught, before ht_observer_update: the current model goes on
 *  where the observer itself has none. It begins with ht_observer_coast. */
void ht_observer_follow(const ht_observer_config *cfg, ht_observer_state *st, ht_ab i_A,
                        float turn_rad);

/** And after it: pulls the flux of the observer to that of the current model by this share of their
 *  distance. The rotor's electrical speed is `omega_rad_s`, and the flux turns with it. */
ht_estimate ht_observer_pull(const ht_observer_config *cfg, ht_observer_state *st, float share,
                             float omega_rad_s);

/** Hybrid observer: correct the resistances in use. For the slow loop, while torque control
 *  runs. `gain`, 0..1: the share of the observed error that one call removes; 0 returns to
 *  the configured values.
 *
 *  In steady state the difference D of the two models is, to first order,
 *
 *    (g0 + j w) D = r i - q h,   h = w (L_m/L_r) psi_r x/(1 + j x),  x = i_q/i_d
 *
 *  with the speed w of the flux, the error r of R_s and the relative error q of R_r. Each call
 *  is a gradient step that lowers |.|^2 in r and q, so it cannot diverge. An error that has
 *  no effect (at no load, or w = 0) stays as it is. An error of L_m causes a D as well, which
 *  grows with w; therefore adaptation fades out above `ADAPT_RAD_S`. */
void ht_observer_adapt(const ht_observer_config *cfg, ht_observer_state *st, float gain);

/** Begin with this R_s, within what the adaptation allows. */
void ht_observer_begin_with(const ht_observer_config *cfg, ht_observer_state *st, float rs_ohm);

/** R_s as it is adapted; 0 where it has reached a bound of the adaptation. */
float ht_observer_adapted_ohm(const ht_observer_config *cfg, const ht_observer_state *st);

/** What the difference D of the two models tells: (g0 + j w) D. */
ht_ab ht_observer_disagreement_V(const ht_observer_config *cfg, const ht_observer_state *st);

/** Corrects R_s alone, by this share of what the models disagree about along the current. */
void ht_observer_adapt_rs(const ht_observer_config *cfg, ht_observer_state *st, float weight);

/** Rotor flux seen from the stator, psi_s - sigma L_s i_s, one period after `psi_Wb` and `i_A`:
 *  it turns on with the mean speed of the stator flux. */
ht_ab ht_observer_predict_rotor(const ht_observer_config *cfg, const ht_observer_state *st,
                                ht_ab psi_Wb, ht_ab i_A);

/** The estimate one period ahead, under the mean voltage `v_V` that is already
 *  committed. The rotor flux seen from the stator, psi_s - sigma L_s i_s, is
 *  taken to turn on with the mean speed of the stator flux, so no rotor
 *  parameter is needed. */
ht_estimate ht_observer_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                                ht_estimate now, ht_ab v_V, ht_ab i_A);

/** The estimate of the x-y flux one period ahead, L_xy i now. `v_V`: less what is induced there. */
ht_xy ht_observer_predict_xy(const ht_observer_config *cfg, const ht_observer_state *st, ht_xy v_V,
                             ht_xy i_A);

#endif
