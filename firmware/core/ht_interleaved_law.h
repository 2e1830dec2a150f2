/** @file ht_interleaved_law.h
 *  Deadbeat control of flux and torque of each three-phase set on its own, with interleaved carriers.
 *
 *  psi_a = psi + s conj(psi_xy), s = 1 for set 1 and -1 for set 2, has the voltage of set a alone: its
 *  derivative is X_a - R (i + s conj(i_xy)), X_a = v + s conj(v_xy), and leg k of the set has the command
 *  Re(X_a exp(-j theta_k)). So each set is a three-phase machine of its own. At the begin of a half of its
 *  carrier its ripple is known (ht_interleaved.h), and there it is decided: the flux w = (a + j b) r of the
 *  deadbeat law is its reference, and X_a takes it there within the half.
 *
 *  Without some of the legs, and to catch a shaft, the deadbeat law and the modulator take its place. A carrier's
 *  half is then one period.
 *
 *  The law cannot fail: every input, NaN and infinity included, gives a pattern.
 */
#ifndef HT_INTERLEAVED_LAW_H
#define HT_INTERLEAVED_LAW_H

#include "ht_deadbeat_law.h"
#include "ht_interleaved.h"

typedef struct {
    ht_deadbeat_law_config deadbeat; /**< gains, and the whole law without some legs */
    ht_interleaved_config positions;
} ht_interleaved_law_config;

typedef struct {
    ht_deadbeat_law_state deadbeat; /**< integrators of x-y */
    ht_interleaved_state positions;
    ht_ab off_pu[2]; /**< by what each set's flux is off its mean at its next begin, Vdc Ts */
    ht_ab v_pu[2];   /**< voltage of each set */
    bool begun;
} ht_interleaved_law_state;

/** Configuration of the law, and of the modulator where that takes its place. */
void ht_interleaved_law_configure(ht_interleaved_law_config *cfg, const ht_law_setting *given,
                                  ht_modulator_config *modulator);

/** True if every value of `cfg` is in its range. */
bool ht_interleaved_law_check(const ht_interleaved_law_config *cfg);

/** Integrators: 0. Set 1 begins. */
void ht_interleaved_law_reset(ht_interleaved_law_state *st);

/** Without some of the legs: voltage of the period after the one that is committed, units of Vdc. */
ht_vsd ht_interleaved_law_step(const ht_interleaved_law_config *cfg,
                               const ht_observer_config *machine, ht_interleaved_law_state *st,
                               const ht_voltage_law_input *in);

/** Pattern of the period after the one that is committed. Returns its mean x-y voltage, units of Vdc. */
ht_xy ht_interleaved_law_pattern(const ht_interleaved_law_config *cfg,
                                 const ht_observer_config *machine, ht_interleaved_law_state *st,
                                 const ht_voltage_law_input *in, const ht_modulator_input *pwm,
                                 ht_compare *out, ht_applied *applied, ht_toggles *toggles);

#endif
