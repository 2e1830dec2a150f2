/** @file ht_flux_brake.h
 *  Flux braking: while the upper level of the dc link limits the braking torque of an induction machine,
 *  more flux than the torque needs makes losses that take up the power of the shaft. In steady state
 *
 *    T w = 3 R_s |i_s|^2 + 3 R_r |i_r|^2 + psi^2 (k_h |w| + k_e w^2)
 *
 *  with nothing left for the link; without torque |i_s| is psi/L_s.
 */
#ifndef HT_FLUX_BRAKE_H
#define HT_FLUX_BRAKE_H

#include <stdbool.h>

typedef struct {
    float most_Wb;   /**< the raised flux */
    float raise_Wb;  /**< of it, what is above the flux without it; 0: off */
    float hold;      /**< steps for which the flux stays after the level has limited */
    float per_check; /**< 1/flux_check^2; 0: the flux is not checked */
} ht_flux_brake_config;

typedef struct {
    float left; /**< steps for which the flux stays */
} ht_flux_brake_state;

typedef struct {
    bool limits;        /**< the upper level of the dc link limits the torque */
    bool may;           /**< the machine bears more flux: all legs, nothing hot */
    float torque_share; /**< of the torque limit, that the level leaves */
    float flux_Wb;      /**< flux reference at present */
    float along_A;      /**< current along the flux, without its ripple */
    float most_A;       /**< current that is asked for at most */
    float off2;         /**< the square that `flux_check` limits, of how far the current is off */
    float turns_V;      /**< voltage that field weakening has for the flux */
    float omega_rad_s;  /**< of the flux, electrical */
} ht_flux_brake_input;

void ht_flux_brake_reset(ht_flux_brake_state *st);

/** One step of the slow loop: `normal_Wb`, or more. The more torque the level leaves, the less flux is added:
 *  torque brakes better. The current along the flux is measured, so a saturated machine gets what it bears:
 *  as much as leaves the torque half of the squared current. The check of the flux takes saturation for a
 *  wrong flux: from half of its limit on nothing is added. */
float ht_flux_brake_step(const ht_flux_brake_config *cfg, ht_flux_brake_state *st,
                         const ht_flux_brake_input *in, float normal_Wb);

#endif
