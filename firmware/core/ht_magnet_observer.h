/** @file ht_magnet_observer.h
 *  The observer of a machine whose rotor has permanent magnets. It is the hybrid one (ht_observer.h): the current
 *  model's flux is what the d axis and the currents make.
 */
#ifndef HT_MAGNET_OBSERVER_H
#define HT_MAGNET_OBSERVER_H

#include "ht_observer.h"

/** The voltage model, pulled to the flux that currents and axis have. */
ht_estimate ht_magnet_update(const ht_observer_config *cfg, ht_observer_state *st, ht_ab v_V,
                             ht_ab i_A, float turn_rad, ht_ab axis, float inv_psi_ref2);

/** The rotor has been aligned: its d axis is `axis`, the machine carries `i_A`. */
void ht_magnet_align(const ht_observer_config *cfg, ht_observer_state *st, ht_ab i_A, ht_ab axis);

/** R_s alone (as ht_observer_adapt), where the voltage that they induce is below half of the drop: above
 *  this speed R_s stays as it is, because an error of psi_f would be taken for one of R_s. */
void ht_magnet_adapt(const ht_observer_config *cfg, ht_observer_state *st, float gain);

/** The flux of the magnets, where they induce more than `least_V` and four times the drop: to first order
 *  the difference D of the two models is then, with the error m of the flux along the d axis u,
 *
 *    (g0 + j w) D = j w m u
 *
 *  An R_s that is 30 % wrong moves it by 7.5 % at most. */
void ht_magnet_adapt_flux(const ht_observer_config *cfg, ht_observer_state *st, float gain,
                          float least_V);

/** The d axis, now `axis`, turns on with the rotor's mean speed; r, which goes to `rotor_Wb`, turns with it, and
 *  follows the flux along it. */
ht_estimate ht_magnet_predict(const ht_observer_config *cfg, const ht_observer_state *st,
                              ht_estimate now, ht_ab v_V, ht_ab i_A, ht_ab axis, ht_ab *rotor_Wb);

#endif
