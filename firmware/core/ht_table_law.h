/** @file ht_table_law.h
 *  The control law of both papers: hysteresis comparators of torque and flux, a switching
 *  table, and one active or zero vector per period (paper A, Fig. 4; paper B, Figs. 3 and 5).
 *  The vector is a single one, one of a pair, or a virtual vector made of three (ht_schemes.h).
 *
 *  The law decides on flux and torque at the instant at which its pattern takes effect. It
 *  cannot fail: every input, NaN and infinity included, gives a pattern.
 */
#ifndef HT_TABLE_LAW_H
#define HT_TABLE_LAW_H

#include "ht_duty.h"
#include "ht_law_setting.h"
#include "ht_modulator.h"
#include "ht_switching.h"
#include "ht_vector_law.h"
#include "ht_xy_regulator.h"

typedef struct {
    ht_vectors vectors; /**< how an active vector is made */
    uint16_t group;     /**< HT_L, HT_ML or HT_S */
    bool regulated;     /**< the x-y regulator sets the duty ratios */
    ht_table table;
    uint16_t torque_levels;  /**< 2, 3 or 5 */
    float flux_band_Wb;      /**< half band of the flux comparator */
    float torque_band_Nm;    /**< outer half band (H_B) */
    float torque_inner_Nm;   /**< inner half band (H_A), five levels only */
    float torque_release_Nm; /**< three levels: back to zero at this error */
    float flux_hold;         /**< no zero vector below (1 - this) x reference; 0: always allowed */
    bool hold_on_zero;       /**< the x-y integrators hold during zero vectors */
    ht_xy_config xy;
    float xy_limit_pu; /**< limit of the x-y command per axis, > 0 if `regulated` */
} ht_table_law_config;

typedef struct {
    int16_t torque_level; /**< comparator's output, -2..2 */
    int16_t flux_level;   /**< comparator's output: 1 raise, 0 lower */
    ht_xy_state xy;
} ht_table_law_state;

/** Take over what a scheme's row says: vectors, group, levels, regulator and its limit. */
void ht_table_law_select(ht_table_law_config *cfg, const ht_scheme_info *row);

/** The rest of the configuration, after ht_table_law_select, and that of the modulator, which a drive
 *  without some of its legs uses. */
void ht_table_law_configure(ht_table_law_config *cfg, const ht_law_setting *given,
                            ht_modulator_config *modulator);

/** Largest mean voltage, units of Vdc, of a scheme with `reach_pu` in its row. */
float ht_table_law_reach_pu(const ht_table_law_config *cfg, float reach_pu);

/** The same of a drive without some of its legs. */
float ht_table_law_left_pu(const ht_table_law_config *cfg);

/** True if the law can work with `cfg`. */
bool ht_table_law_check(const ht_table_law_config *cfg);

/** True if the law decides by the x-y flux. */
bool ht_table_law_needs_xy(const ht_table_law_config *cfg);

/** Comparators: no torque, raise the flux. Integrators: 0. */
void ht_table_law_reset(ht_table_law_state *st);

/** Decide on one period: state words into `s`, x-y command in units of Vdc into `v_xy_pu`
 *  (0 without a regulator). Returns the action points. */
ht_action_points ht_table_law_step(const ht_table_law_config *cfg, ht_table_law_state *st,
                                   const ht_vector_law_input *in, ht_xy *v_xy_pu, uint16_t s[3]);

/** The same for a drive without some of its legs: a voltage, units of Vdc, that the others are to
 *  make (ht_lost_legs_command). No vector of them points that way without x-y current. */
ht_vsd ht_table_law_voltage(const ht_table_law_config *cfg, ht_table_law_state *st,
                            const ht_vector_law_input *in);

#endif
