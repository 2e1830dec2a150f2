/** @file ht_vdc.h
 *  Keeps the dc link between two levels: a drive that brakes charges the capacitor, and one whose source
 *  is lost discharges it. Torques in N m, speed in rad/s (mechanical).
 */
#ifndef HT_VDC_H
#define HT_VDC_H

typedef struct {
    float high_V;     /**< no braking torque from here on */
    float low_V;      /**< no driving torque from here down */
    float above_V;    /**< above this `high_V` limits the torque; beyond any voltage: off */
    float below_V;    /**< below this `low_V` does; negative: off */
    float per_band;   /**< 1/V: one over the distance of each level from where it begins to limit */
    float kp_Nms_rad; /**< of the speed PI: the drive brakes no harder to a standstill */
} ht_vdc_config;

/** Share of the torque limit that may drive the shaft to lower the voltage. The tables' mean torque is
 *  below its reference: with small-2kw at 2800 r/min by 0.13 of the limit. A reference of 0 would
 *  charge the capacitor further. */
#define HT_VDC_PUSH 0.3f
/** The push ends at this multiple of the speed at which it began: the source may hold the voltage, and
 *  would run the shaft up. At standstill there is none. */
#define HT_VDC_FASTER 1.1f

/** `torque_Nm`, or the torque next to it that leaves the link of `vdc_V` within its levels at this
 *  speed; `limit_Nm`: of the torque reference, either sign; `from_rad_s`: size of the speed at which the
 *  voltage came beyond `above_V`. */
float ht_vdc_torque_Nm(const ht_vdc_config *cfg, float torque_Nm, float limit_Nm, float omega_rad_s,
                       float from_rad_s, float vdc_V);

#endif
