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

#include "ht_modulator.h"
#include "ht_voltage_law.h"
#include "ht_xy_regulator.h"

typedef struct {
    float gain;        /**< share of the flux error that one period takes away, above 0 up to 1 */
    float xy_ki_per_A; /**< x-y integrators, units of Vdc per ampere and period */
    float
        xy_free_A2; /**< beyond this x-y current, squared, a step leaves x-y its voltage; above 0 */
    float
        reach_pu; /**< largest step of the flux with less x-y current, units of Vdc Ts; 0.5 .. 1 */
} ht_deadbeat_law_config;

typedef struct {
    ht_xy_state xy;
} ht_deadbeat_law_state;

/** Configuration of the law and of its modulator. A zero sequence that is clamped at every voltage wants
 *  set 2's carrier to turn at every voltage; another one from 0.3 Vdc on. */
void ht_deadbeat_law_configure(ht_deadbeat_law_config *cfg, const ht_law_setting *given,
                               ht_modulator_config *modulator);

/** True if every value of `cfg` is in its range. */
bool ht_deadbeat_law_check(const ht_deadbeat_law_config *cfg);

/** Integrators: 0. */
void ht_deadbeat_law_reset(ht_deadbeat_law_state *st);

/** Voltage of the period after the one that is committed, units of Vdc. In x-y the proportional
 *  part acts on the prediction and the integrators on the sample, because a wrong prediction
 *  would leave a mean error. */
ht_vsd ht_deadbeat_law_step(const ht_deadbeat_law_config *cfg, const ht_observer_config *machine,
                            ht_deadbeat_law_state *st, const ht_voltage_law_input *in);

#endif
