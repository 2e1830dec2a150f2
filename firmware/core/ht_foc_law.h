/** @file ht_foc_law.h
 *  Rotor-field-oriented control: PI regulators of the stator current in the frame of the rotor
 *  flux, and carrier modulation. It is a reference: what most engineers would try first.
 *
 *  The rotor flux seen from the stator, r = psi - sigma L_s i, has the direction of the rotor flux.
 *  So u = r/|r| is the frame, and a product with its conjugate is the transformation: no angle, no
 *  trigonometry. The torque is 3 P |r| i_q; i_d gives the stator flux the length that the drive asks
 *  for, whatever the rotor flux is.
 *
 *  The law cannot fail: every input, NaN and infinity included, gives a voltage.
 */
#ifndef HT_FOC_LAW_H
#define HT_FOC_LAW_H

#include "ht_modulator.h"
#include "ht_voltage_law.h"
#include "ht_xy_regulator.h"

typedef struct {
    float alpha_ts;    /**< bandwidth of the current times the period, above 0 up to 0.5 */
    float xy_ki_per_A; /**< x-y integrators, units of Vdc per ampere and period */
} ht_foc_law_config;

typedef struct {
    ht_xy_state xy;
    ht_ab along;      /**< unit vector of the frame at the present sample, as it was predicted */
    ht_ab integral_A; /**< current regulators, d and q: what they add to the current in a period */
    ht_ab wanted_A;   /**< reference of the step before, as far as the voltage reached */
    bool begun;       /**< the integrals fit the machine */
} ht_foc_law_state;

/** Configuration of the law and of its modulator: centred zero sequences, and the carriers that the
 *  scheme's row names. */
void ht_foc_law_configure(ht_foc_law_config *cfg, const ht_law_setting *given,
                          ht_modulator_config *modulator);

/** True if every value of `cfg` is in its range. */
bool ht_foc_law_check(const ht_foc_law_config *cfg);

/** Before the first step. */
void ht_foc_law_reset(ht_foc_law_state *st);

/** Voltage of the period after the one that is committed, units of Vdc.
 *
 *  In the frame, with the prediction i1, a period adds to the current what is commanded:
 *
 *    i2 = i1 + a (i* - 2 i1) + J,  J += a^2 (i*' - i),  a = alpha Ts
 *
 *  with the reference i*' of the step before. Both poles are at 1 - a, and one of them cancels in
 *  the response to i*: it is of first order, without overshoot. The integrals act on the sampled
 *  current i, because a wrong prediction would leave a mean error. A voltage beyond the linear
 *  range is shortened, and the integrals get the reference that it realises. */
ht_vsd ht_foc_law_step(const ht_foc_law_config *cfg, const ht_observer_config *machine,
                       ht_foc_law_state *st, const ht_voltage_law_input *in);

#endif
