/** @file ht_magnet_rules.h
 *  What the drive asks about a rotor with permanent magnets; ht_induction_rules.h says what each is for.
 */
#ifndef HT_MAGNET_RULES_H
#define HT_MAGNET_RULES_H

#include "ht_derating.h"
#include "ht_protect.h"

void ht_magnet_configure(const float *v, ht_observer_config *c);

bool ht_magnet_fits(const float *v, uint16_t misfit);

bool ht_magnet_bears_short(const ht_params *p);

/** Largest current of a short circuit of all legs, A, just beyond `speed_trip_rpm`. */
float ht_magnet_trip_short_A(const ht_params *p);

/** An error of psi_f would be taken for one of R_s. */
bool ht_magnet_learns_rs(const float *v);

/** The reserve depends on the current, too: there is no such flux. */
float ht_magnet_reserve_Wb(const float *v, float reach_Nm_Wb2);

float ht_magnet_limit_A(const ht_derating_config *c, const ht_observer_config *machine,
                        const float *v);

void ht_magnet_configure_protect(const float *v, ht_protect_config *c);

/** The flux of the voltage model must be the one that the rotor's angle and the current have, within
 *  `flux_check` of the magnets' flux, rms. */
uint16_t ht_magnet_protect(const ht_protect_config *cfg, ht_protect_state *st,
                           const ht_control_state *c, float speed_rpm);

#endif
