/** @file ht_induction_rules.h
 *  What the drive asks about a rotor with a winding or a cage: rules for its parameters, limits, protection.
 *  Those of another kind have the same names after `ht_<kind>_`, and the same arguments (HT_ROTOR_DOES).
 */
#ifndef HT_INDUCTION_RULES_H
#define HT_INDUCTION_RULES_H

#include "ht_derating.h"
#include "ht_protect.h"

/** Fills in what the kind has in the configuration; the rest is there. */
void ht_induction_configure(const float *v, ht_observer_config *c);

/** Do the parameters `v` meet the demands that only some kinds make? Those of a short circuit of all
 *  terminals are apart. */
bool ht_induction_fits(const float *v, uint16_t misfit);

/** The current of a short circuit does the machine no harm. */
bool ht_induction_bears_short(const ht_params *p);

/** Is R_s adapted wherever the machine shows it? */
bool ht_induction_learns_rs(const float *v);

/** Flux that the torque kept in reserve needs, if the machine makes `reach_Nm_Wb2` times its square. */
float ht_induction_reserve_Wb(const float *v, float reach_Nm_Wb2);

/** Steady current, amplitude, at the torque limit. */
float ht_induction_limit_A(const ht_derating_config *c, const ht_observer_config *machine,
                           const float *v);

/** Fills in what `ht_<kind>_protect` needs of the configuration; the rest is there. */
void ht_induction_configure_protect(const float *v, ht_protect_config *c);

/** The checks of the slow interrupt in RUN (ht_protect_slow).
 *
 *  Flux: the controller holds the estimate on its circle whatever the machine does, so the
 *  size of the estimate proves nothing. But it must fit the current. Let q and t be the stator
 *  current along and across the estimated flux, in units of the no-load current psi/L_s. Every
 *  steady state of a machine lies on the circle diagram (q - c)^2 + t^2 = (c - 1)^2,
 *  c = (1 + 1/sigma)/2; with a wrong flux it does not. While the rotor flux r changes, the machine
 *  takes (L_r/R_r) (d|r|/dt)/((1 - sigma) L_s) along r in addition, and sigma L_s times this of the
 *  stator flux; both are subtracted. So that no transient is seen late, rotor flux and current go
 *  through the same low pass before they are compared. The limit is in amperes, because the
 *  current's ripple does not shrink with the field.
 *
 *  Encoder: the speed of the shaft is the speed of the rotor flux minus the slip. `speed_rpm` and the
 *  flux's speed are means since the slow interrupt before: otherwise a drive that accelerates would look like
 *  one with a wrong encoder. */
uint16_t ht_induction_protect(const ht_protect_config *cfg, ht_protect_state *st,
                              const ht_control_state *c, float speed_rpm);

#endif
