/** @file ht_voltage_law.h
 *  The common part of the laws that command a voltage (HT_VOLTAGE_LAW in ht_laws.def).
 *
 *  Such a law sees the machine one period ahead, at the end of the period whose pattern is committed.
 *  So it needs shadow load and prediction, and a machine that is sampled fast enough for them. The
 *  modulator makes a pattern of any voltage, NaN and infinity included.
 */
#ifndef HT_VOLTAGE_LAW_H
#define HT_VOLTAGE_LAW_H

#include "ht_law_setting.h"
#include "ht_observer.h"

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

/** The machine one period ahead, and what is asked of it. */
typedef struct {
    ht_ab psi_Wb;    /**< stator flux */
    ht_ab rotor_Wb;  /**< rotor flux seen from the stator, r = psi - sigma L_s i */
    ht_xy psi_xy_Wb; /**< x-y flux, L_xy i */
    ht_vsd i_A;      /**< currents of the latest sample */
    float turn_rad;  /**< angle that the flux turns in a period */
    float rs_ohm;    /**< stator resistance in use */
    float torque_ref_Nm;
    float flux_ref_Wb;
    float vdc_V;
    ht_xy emf_V; /**< mean voltage that the rotor induces in x-y in the period that is decided on */
} ht_voltage_law_input;

/** Samples in a time constant of a current that a law that predicts needs at least. */
#define HT_LEAST_SAMPLES 5.0f

/** Lowest sampling frequency for stator resistance, transient and x-y inductance. Within a period
 *  R_s may take away a fifth of either current: the prediction counts the drop with the current at
 *  the period's start, which then leaves 2 % of what it predicts. */
float ht_voltage_law_least_Hz(float rs_ohm, float sigma_ls_H, float lxy_H);

/** True if the machine is sampled at this frequency or above. */
bool ht_voltage_law_fast_enough(const ht_observer_config *machine);

/** Gain of the x-y integrators, units of Vdc per ampere and period. */
float ht_voltage_law_xy_ki_per_A(const ht_law_setting *given);

#endif
