/** @file ht_least_loss.h
 *  The stator flux with which a machine makes a torque with the least loss. That of magnets is found by
 *  `ht_magnet_least_loss_A`.
 *
 *  In steady state the current of an induction machine has the parts d along the rotor flux and q across it, and
 *
 *    T = 3 P (L_m^2/L_r) d q,   psi^2 = (L_s d)^2 + (sigma L_s q)^2
 *    loss = 3 (a d^2 + b q^2)
 *    a = R_s + k L_s^2,   b = R_s + R_r (L_m/L_r)^2 + k (sigma L_s)^2
 *    k = (k_h |w| + k_e w^2)/3
 *
 *  with the iron's loss psi^2 (k_h |w| + k_e w^2) at the flux's speed w. The torque fixes the product
 *  d q, so the loss is least where a d^2 = b q^2.
 */
#ifndef HT_LEAST_LOSS_H
#define HT_LEAST_LOSS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    float error_gain;     /**< of the mean error, per step */
    float per_Nm;         /**< d q of a torque: L_r/(3 P L_m^2) */
    float ls2_H2;         /**< L_s^2 */
    float across2_H2;     /**< (sigma L_s)^2 */
    float rotor_ohm;      /**< R_r (L_m/L_r)^2 as configured */
    float hysteresis_ohm; /**< k_h/3 as k is made, per rad/s */
    float eddy_ohm;       /**< k_e/3, per (rad/s)^2 */
    float reach_Nm_Wb2;   /**< torque asked for at most over flux squared, while the flux rises */
    float floor_Wb;       /**< no less */
    uint32_t wait;        /**< steps until the flux falls */
} ht_least_loss_config;

typedef struct {
    float error_Nm; /**< slow mean of the torque less its reference: the tables keep one */
    float held_Wb;  /**< the flux in use */
    float asked_Wb; /**< the largest that was asked for since `waited` began */
    uint32_t waited;
} ht_least_loss_state;

/** The variables of the loss. */
typedef struct {
    float torque_ref_Nm;
    float torque_Nm;   /**< estimated, with its ripple; either has either sign */
    float omega_rad_s; /**< of the flux, electrical, either sign */
    float rs_ohm;      /**< in use */
    float rr_scale;    /**< rotor resistance in use, relative to the configured one */
    bool limited;      /**< the torque wants more flux than there is */
} ht_least_loss_input;

/** Hold the flux `most_Wb`. */
void ht_least_loss_reset(ht_least_loss_state *st, float most_Wb);

/** The iron's loss over flux squared at this electrical speed, of either sign, and over 3: W/Wb^2. */
float ht_least_loss_iron_W_Wb2(const ht_least_loss_config *cfg, float omega_rad_s);

/** The mean torque of this reference. Every step of the slow loop learns its error. */
float ht_least_loss_torque_Nm(const ht_least_loss_config *cfg, ht_least_loss_state *st,
                              const ht_least_loss_input *in);

/** The flux of least loss of an induction machine at this torque, without limits. */
float ht_least_loss_Wb(const ht_least_loss_config *cfg, const ht_least_loss_input *in,
                       float torque_Nm);

/** One step of the slow loop: the flux `wanted_Wb` between floor and `most_Wb`, which it is if `limited`. It
 *  rises at once. It falls, after the wait, to the largest that was asked for meanwhile: a load that comes
 *  again and again finds its flux. */
float ht_least_loss_follow(const ht_least_loss_config *cfg, ht_least_loss_state *st, bool limited,
                           float wanted_Wb, float most_Wb);

/** The same with the flux of an induction machine. */
float ht_least_loss_step(const ht_least_loss_config *cfg, ht_least_loss_state *st,
                         const ht_least_loss_input *in, float most_Wb);

#endif
