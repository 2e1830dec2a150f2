/** @file ht_modulator.h
 *  Carrier modulation of the six legs: one toggle per leg and period, from the comparison with
 *  two triangular carriers, one for each three-phase set.
 *
 *  A period is one flank of the carrier. A leg starts low and rises once, or it starts high
 *  and falls once; the next period is the other way round. This takes compare register A
 *  alone. The switching frequency is half the sampling frequency, less what legs save that stay
 *  on a rail.
 *
 *  Zero sequence, in each set on its own: midway between the rails (centred), or such that the
 *  leg with the largest command stays on its rail (clamped), or a mixture of both.
 *
 *  Turn: in every second 30 degrees of the voltage's direction the carrier of set 2 runs
 *  opposite to the carrier of set 1. The sets' ripples then cancel each other in alpha-beta,
 *  where they would add.
 *
 *  Sets that are 0 or 60 degrees apart make the same voltage if nothing of it is in x-y. At 0 degrees
 *  they then have the same commands, and their carriers run together; at 60 degrees the commands of
 *  set 2 are those of set 1 with the other sign, and its carrier runs opposite. Either way both sets
 *  switch at the same instants, and no ripple is in x-y.
 */
#ifndef HT_MODULATOR_H
#define HT_MODULATOR_H

#include "ht_pattern.h"

/** From this voltage above `kappa_from_pu` on, `kappa` counts in full; units of Vdc. */
#define HT_KAPPA_RAMP_PU 0.02f
/** For `turn_pu`: no inverter makes that voltage. */
#define HT_NEVER_PU 100.0f

typedef struct {
    float kappa;         /**< zero sequence: 0 centred, 1 clamped, between: a mixture */
    float kappa_from_pu; /**< below this voltage the zero sequence is centred; units of Vdc.
                          *   0: `kappa` counts at every voltage */
    float turn_pu;       /**< set 2's carrier turns where the voltage exceeds this; units of Vdc */
    bool alternate; /**< clamped legs alternate between the rails by 15 degrees of the voltage */
    ht_winding winding;
    /** Set 2's carrier turns where alpha times beta of the voltage's cube exceeds this: 0, in every
     *  second 30 degrees; -HT_NEVER_PU, everywhere. */
    float opposite_from;
} ht_modulator_config;

typedef struct {
    bool falling;  /**< legs of set 1 start high in the next period */
    bool opposite; /**< set 2's carrier runs opposite to set 1's */
} ht_modulator_state;

/** The modulator's input besides its own configuration and state. */
typedef struct {
    const ht_dead_time *dead;
    const ht_six *i_A;       /**< latest currents: they tell what the dead time will take */
    const ht_period *period; /**< begins at count 0 */
    uint16_t before;         /**< state word at the end of the period before */
} ht_modulator_input;

/** The rules that keep both sets alike in a winding whose sets are 0 or 60 degrees apart: set 2's carrier never
 *  or always turned, and the same clamped leg. 30 degrees: as configured before. */
void ht_modulator_wind(ht_modulator_config *cfg, ht_winding winding);

/** Centred zero sequences; set 2's carrier turns in every second sector, or never. */
void ht_modulator_centre(ht_modulator_config *cfg, bool turned);

/** True if every value is in its range: kappa 0..1, the voltages 0 or more. */
bool ht_modulator_check(const ht_modulator_config *cfg);

/** First period of set 1 rising, carriers in phase. */
void ht_modulator_reset(ht_modulator_state *st);

/** For a winding whose sets are not 30 degrees apart: what ht_modulator_step must be told to make `v_pu`.
 *  Where the legs of a set do not fit, x and y give way in `v_pu`. */
ht_vsd ht_modulator_legs(ht_winding winding, ht_vsd *v_pu);

/** What a voltage asks of the sets. */
typedef struct {
    float kappa[2]; /**< share of each set's clamped zero sequence; below 0: to the lower rail */
    bool opposite;  /**< set 2's carrier turns */
} ht_sets;

/** What ht_modulator_step does at the voltage `v_pu`, units of Vdc, with sets 30 degrees apart, clamped legs that
 *  alternate, and a carrier that turns at every voltage. */
ht_sets ht_modulator_alternating(float kappa, float kappa_from_pu, ht_ab v_pu);

/** One period's pattern for the voltage `v_pu`, units of Vdc. Where the legs of a set do not
 *  fit between the rails, x and y give way first, in `v_pu` too; then the legs are limited. A leg
 *  whose command lies between its rail and the shortest pulse takes the nearer of both.
 *
 *  Whatever goes in, NaN included: CA from `shortest` to `counts` - `shortest`, or CA = `counts` for a
 *  leg that stays on its rail; CB = `counts`. So every pulse, also one that the next period's start ends,
 *  has its length. `applied` and `toggles` describe the pattern for ht_volt_seconds. */
void ht_modulator_step(const ht_modulator_config *cfg, ht_modulator_state *st, ht_vsd *v_pu,
                       const ht_modulator_input *in, ht_compare *out, ht_applied *applied,
                       ht_toggles *toggles);

#endif
