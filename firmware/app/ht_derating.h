/** @file ht_derating.h
 *  Torque and flux that a current can make: of a drive without some of its legs, where no phase is to
 *  carry more than its rated current, and of every drive while its flux changes.
 */
#ifndef HT_DERATING_H
#define HT_DERATING_H

#include "ht_control.h"
#include "ht_params.h"

typedef struct {
    float rated_A;     /**< amplitude of the rated phase current */
    float trip_A;      /**< over-current trip of a phase */
    float limit_A;     /**< current at the torque limit and the flux reference, steady state */
    float ripple_A_V;  /**< step of a phase's current in a period, per volt of the dc link */
    float flux_band_A; /**< the flux comparator's half band as a current */
    float torque_band_Nm;
    float ls_H;        /**< stator inductance */
    float lean;        /**< 1/(2 c), c the centre of the circle diagram, units of psi/L_s */
    float best_Wb_A;   /**< flux with the most torque, per ampere in alpha-beta */
    float torque_gain; /**< 3 P */
    float sigma_ls_H;  /**< stator transient inductance */
    float lxy_H;
    float
        left_pu; /**< usable phase voltage in units of Vdc without some of the legs, margin included */
} ht_derating_config;

/** `control`: as it is configured by these parameters. */
void ht_derating_configure(const ht_params *p, const ht_control_config *control,
                           ht_derating_config *c);

/** Current in alpha-beta, amplitude, with which the most loaded phase carries `phase_A`, where at least
 *  one leg is lost. */
float ht_derated_A(const ht_lost_legs *lost, float phase_A);

/** What of the voltage of a drive without some of its legs is left to turn its flux with `omega_rad_s`.
 *  Where the others make up for a lost leg, R_s and L_xy take their voltage of the current `i_A` once more. */
float ht_derated_V(const ht_derating_config *c, float vdc_V, float rs_ohm, float omega_rad_s,
                   float i_A);

/** Stator flux that makes the most torque of the current `i_A`. More flux leaves too little of the
 *  current for torque. */
float ht_derated_Wb(const ht_derating_config *c, float i_A);

/** Current in alpha-beta that is asked for at most at this dc-link voltage and flux reference, with
 *  which no phase trips. `lost`: NULL with all legs. It is 80 % of the trip level or less: the rest
 *  is what the bands and a period of a vector, in alpha-beta and in x-y, add. But it is not below what
 *  the parameters allow for ever: the current at the torque limit and the flux reference, or without
 *  a leg the rated one. */
float ht_derated_most_A(const ht_derating_config *c, const ht_lost_legs *lost, float vdc_V,
                        float flux_Wb);

/** Torque at this flux and current: what the circle diagram (ht_protect_slow) has, up to its top. */
float ht_derated_Nm(const ht_derating_config *c, float i_A, float flux_Wb);

/** The same at a rotor flux that has not followed yet: `rotor_Wb`, as seen from the stator
 *  (ht_protect.h). The stator flux is its vector sum with sigma L_s i, so the three lengths
 *  make a triangle, and the torque is its area times 6 P/(sigma L_s). 0 if they make none. */
float ht_derated_now_Nm(const ht_derating_config *c, float i_A, float flux_Wb, float rotor_Wb);

/** Torque with which the current becomes this long if it has the part `along_A` along the flux. It
 *  needs no inductance. 0 if that part alone is longer. */
float ht_derated_beside_Nm(const ht_derating_config *c, float i_A, float flux_Wb, float along_A);

/** `flux_Wb`, or the flux next to it that this current can make while the rotor flux is `rotor_Wb`.
 *  A flux that rises leaves 44 % of the current for torque. */
float ht_derated_flux_Wb(const ht_derating_config *c, float i_A, float flux_Wb, float rotor_Wb);

#endif
