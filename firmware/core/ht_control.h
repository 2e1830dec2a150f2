/** @file ht_control.h
 *  The control law: one `step` per sampling period, in the order of the papers'
 *  block diagrams (paper A, Fig. 4; paper B, Figs. 3 and 5):
 *
 *    currents, Vdc -> observer -> (prediction) -> comparators -> switching table
 *      -> scheme -> (x-y regulator -> duties) -> compare registers
 *
 *  The caller owns config and state; any number of drives can live side by side.
 *  `step` cannot fail: every input, NaN and infinity included, gives a pattern
 *  that the PWM can realise; whether the gates stay on is the caller's decision.
 */
#ifndef HT_CONTROL_H
#define HT_CONTROL_H

#include "ht_observer.h"
#include "ht_pattern.h"
#include "ht_switching.h"
#include "ht_xy_regulator.h"

typedef enum {
    HT_DTC1 = 0,  /**< paper B: one large vector per period */
    HT_DTC2 = 1,  /**< paper B: large or medium-large, whichever lowers psi_xy */
    HT_DTC3 = 2,  /**< paper B: adds the small vectors and five torque levels */
    HT_FDR = 3,   /**< paper A: three large vectors, fixed duty ratios */
    HT_DDR = 4,   /**< paper A: three large vectors, duties from the x-y regulator */
    HT_DDR_ML = 5 /**< paper A: the same on medium-large vectors */
} ht_scheme;

#define HT_SCHEMES 6u

typedef struct {
    ht_scheme scheme;
    ht_table table;
    uint16_t torque_levels;  /**< 2, 3 or 5 */
    bool shadow;             /**< a pattern takes effect one period after its step */
    bool predict;            /**< decide on the state one period ahead */
    bool hold_on_zero;       /**< x-y integrators hold during zero vectors */
    uint16_t period_counts;  /**< TBPRD + 1 */
    uint16_t first_counts;   /**< write instant under immediate load, else 0 */
    float flux_band_Wb;
    float torque_band_Nm;    /**< outer band (H_B) */
    float torque_inner_Nm;   /**< five-level inner band (H_A) */
    float torque_release_Nm; /**< three-level: back to zero at this error */
    bool only_v0;            /**< zero vectors: V0 only, else the one with the fewest transitions */
    float flux_hold;         /**< zero vectors give way below (1 - this) x reference; 0 = never */
    float drop_V;            /**< threshold voltage of switches and diodes, their mean; 0 = ideal */
    float build_current_A;   /**< current limit of the flux build-up */
    ht_observer_config observer;
    ht_xy_config xy;
    float xy_limit_pu;       /**< limit of the x-y command: ht_tmvcl_pu of the scheme's group */
    ht_dead_time dead;
} ht_control_config;

typedef enum {
    HT_CONFIG_OK = 0,
    HT_CONFIG_SCHEME = 1, /**< scheme, table, number of torque levels or x-y limit */
    HT_CONFIG_TIMING = 2, /**< period, write instant, dead time or sampling period */
    HT_CONFIG_MACHINE = 3 /**< resistance or inductance */
} ht_config_status;

typedef struct {
    ht_observer_state observer;
    ht_xy_state xy;
    ht_spill spill;
    ht_applied active;    /**< on the legs during the period that just ended */
    ht_applied next;      /**< shadow load: on the legs from this sample on */
    ht_six i_prev_A;
    ht_flow flow_prev;    /**< where these flow */
    ht_estimate estimate; /**< now */
    ht_estimate decided;  /**< what the comparators saw (now or one period ahead) */
    ht_xy i_xy_A;         /**< of the latest sample */
    ht_xy psi_xy_Wb;      /**< x-y flux decided on: HT_DTC2 and HT_DTC3 only */
    ht_xy v_xy_pu;        /**< x-y command, units of Vdc */
    int16_t torque_level; /**< -2..2 */
    int16_t flux_level;   /**< 1 raise, 0 lower */
    uint16_t sector;      /**< 0..11 */
} ht_control_state;

typedef struct {
    ht_six i_A;
    float vdc_V;
    float torque_ref_Nm;
    float flux_ref_Wb;
    float turn_rad;      /**< electrical angle the rotor turned since the last sample */
    float inv_flux_ref2; /**< 1 / flux_ref_Wb^2, prepared by the slow loop */
} ht_control_input;

/** VSD transform of six phase quantities. */
ht_vsd ht_vsd_from_six(const ht_six *s);

/** Check a configuration; `ht_control_step` relies on it. */
ht_config_status ht_control_check(const ht_control_config *cfg);

/** Demagnetised machine, currents `i`, all legs low. */
void ht_control_reset(const ht_control_config *cfg, ht_control_state *st, const ht_six *i_A);

/** The pattern that `ht_control_reset` assumes on the legs: all low. */
void ht_control_low_pattern(const ht_control_config *cfg, ht_compare *out);

/** One sampling period. `build`: flux build-up at standstill instead of normal operation,
 *  the zero-mean virtual vector along 15 degrees, current limited, until |psi| is at the
 *  reference. */
void ht_control_step(const ht_control_config *cfg, ht_control_state *st, const ht_control_input *in,
                     bool build, ht_compare *out);

#endif
