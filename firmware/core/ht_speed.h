/** @file ht_speed.h
 *  Slow loop: speed PI with torque limit, and the flux reference with field
 *  weakening.
 */
#ifndef HT_SPEED_H
#define HT_SPEED_H

typedef struct {
    float kp_Nms_rad;      /**< N m per rad/s (mechanical) */
    float ki_ts_Nms_rad;   /**< integral gain times the slow period */
    float torque_limit_Nm; /**< > 0 */
} ht_speed_config;

typedef struct {
    float integral_Nm;
} ht_speed_state;

/** Torque reference for a speed error in rad/s (mechanical). The integrator
 *  stops where it would push further into the limit. A NaN or infinite error gives
 *  no torque and leaves the integrator alone. */
float ht_speed_step(const ht_speed_config *cfg, ht_speed_state *st, float error_rad_s);

typedef struct {
    float flux_ref_Wb;  /**< reference below base speed */
    float flux_min_Wb;  /**< never weakened below this */
    float reach_pu;     /**< usable phase voltage in units of Vdc, margin included */
    float rs_ohm;
} ht_flux_config;

/** Flux reference that the measured Vdc can still drive at `omega_sync_rad_s`
 *  (electrical) with |i_s| = `i_A`. */
float ht_flux_reference(const ht_flux_config *cfg, float vdc_V, float omega_sync_rad_s, float i_A);

#endif
