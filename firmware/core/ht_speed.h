/** @file ht_speed.h
 *  The two regulators of the slow loop: speed PI with torque limits, and the flux reference with
 *  field weakening. Speeds in rad/s, torque in N m, flux in Wb.
 */
#ifndef HT_SPEED_H
#define HT_SPEED_H

typedef struct {
    float kp_Nms_rad;    /**< N m per rad/s (mechanical) */
    float ki_ts_Nms_rad; /**< integral gain times the slow period */
} ht_speed_config;

typedef struct {
    float integral_Nm;
} ht_speed_state;

void ht_speed_reset(ht_speed_state *st);

/** Follow a torque reference from elsewhere, so that the regulator continues from it without a
 *  step. */
void ht_speed_follow(ht_speed_state *st, float torque_Nm);

/** Torque reference, from `least_Nm` (< 0) to `most_Nm` (> 0), for a speed error in rad/s (mechanical).
 *  The integrator stops where it would push further into a limit. A NaN or infinite error gives no
 *  torque and does not change the integrator. */
float ht_speed_step(const ht_speed_config *cfg, ht_speed_state *st, float error_rad_s,
                    float least_Nm, float most_Nm);

typedef struct {
    float flux_min_Wb; /**< never weakened below this */
    float reach_pu;    /**< usable phase voltage in units of Vdc, margin included */
    float rs_ohm;
} ht_flux_config;

/** The limits of the flux. */
typedef struct {
    float flux_Wb;          /**< wanted below base speed */
    float vdc_V;            /**< measured */
    float omega_sync_rad_s; /**< electrical speed of the stator flux, either sign */
    float i_A;              /**< |i_s| */
} ht_flux_input;

/** The wanted flux, or the part of it for which Vdc is sufficient. */
float ht_flux_reference(const ht_flux_config *cfg, const ht_flux_input *in);

#endif
