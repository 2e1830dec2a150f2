/** @file ht_deadbeat_law.h
 *  Deadbeat control of stator flux and torque: the voltage that takes both to their
 *  references within the next period, from the machine's state one period ahead.
 *
 *  With the rotor flux seen from the stator, r = psi - sigma L_s i, the torque is
 *  3 P r x psi / (sigma L_s). A flux reference psi* = a r + b J r (J: 90 degrees ahead) has
 *  the torque's component b by that equation and the length asked for by a. Over one
 *  period it turns with the flux; what is missing, plus the resistive drop, is the
 *  voltage. Nothing is rotated by an angle: no trigonometry.
 *
 *  The law cannot fail: every input, NaN and infinity included, gives a voltage; the modulator
 *  makes a pattern of any voltage.
 */
#ifndef HT_DEADBEAT_LAW_H
#define HT_DEADBEAT_LAW_H

#include "ht_observer.h"
#include "ht_xy_regulator.h"

/* Common to this law and the field-oriented one. */
/** A flux reference that steps would take all voltage from the torque: a tenth of it. */
#define HT_LAW_FLUX_SHARE 0.1f
/** Least part of the flux reference that is along the rotor flux, squared. */
#define HT_LAW_RADIAL2_LEAST 0.01f
/** The smallest square of the rotor flux that is divided by. */
#define HT_LAW_LEAST_WB2 1.0e-8f
/** Share of the x-y current that one period takes away. */
#define HT_LAW_XY_SHARE 0.4f
/** Limit of the x-y integrators, units of Vdc. */
#define HT_LAW_XY_LIMIT_PU 0.1f

typedef struct {
    float gain;        /**< share of the flux error that one period takes away, above 0 up to 1 */
    float xy_ki_per_A; /**< x-y integrators, units of Vdc per ampere and period */
} ht_deadbeat_law_config;

typedef struct {
    ht_xy_state xy;
} ht_deadbeat_law_state;

/** The machine one period ahead, and what is asked of it. */
typedef struct {
    ht_ab psi_Wb;    /**< stator flux */
    ht_ab rotor_Wb;  /**< rotor flux seen from the stator, r */
    ht_xy psi_xy_Wb; /**< x-y flux, L_xy i */
    ht_xy i_xy_A;    /**< x-y currents of the latest sample */
    float turn_rad;  /**< angle that the flux turns in a period */
    float rs_ohm;    /**< stator resistance in use */
    float torque_ref_Nm;
    float flux_ref_Wb;
    float vdc_V;
} ht_deadbeat_law_input;

/** True if every value of `cfg` is in its range. */
bool ht_deadbeat_law_check(const ht_deadbeat_law_config *cfg);

/** Lowest sampling frequency for stator resistance, transient and x-y inductance. Within a period
 *  R_s may take away a fifth of either current: the prediction counts the drop with the current at
 *  the period's start, which then leaves 2 % of what it predicts. */
float ht_deadbeat_law_least_Hz(float rs_ohm, float sigma_ls_H, float lxy_H);

/** True if the machine is sampled at this frequency or above. */
bool ht_deadbeat_law_fast_enough(const ht_observer_config *machine);

/** Integrators: 0. */
void ht_deadbeat_law_reset(ht_deadbeat_law_state *st);

/** Voltage of the period after the one that is committed, units of Vdc. In x-y the proportional
 *  part acts on the prediction and the integrators on the sample, because a wrong prediction
 *  would leave a mean error. */
ht_vsd ht_deadbeat_law_step(const ht_deadbeat_law_config *cfg, const ht_observer_config *machine,
                            ht_deadbeat_law_state *st, const ht_deadbeat_law_input *in);

#endif
