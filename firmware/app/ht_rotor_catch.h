/** @file ht_rotor_catch.h
 *  A start that catches a turning rotor with a flux of its own, whose angle the drive believes to know.
 *
 *  All legs are low for a few periods. The rotor's voltage then drives a current through the machine's
 *  inductance, and its direction tells the rotor's angle. If it is the one that the believed angle
 *  expects, control begins with the flux of that angle: its voltages match what the rotor induces.
 */
#ifndef HT_ROTOR_CATCH_H
#define HT_ROTOR_CATCH_H

#include "ht_observer.h"

typedef struct {
    ht_dq expected_A;
    float periods;
} ht_rotor_catch_state;

typedef enum { HT_CATCHING = 0, HT_CAUGHT = 1, HT_NOT_CAUGHT = 2 } ht_rotor_catch;

/** Slowest electrical speed at which it works: the current must be large enough to be judged, `most_A` being the
 *  range of what is measured. */
float ht_rotor_catch_least_rad_s(const ht_observer_config *machine, float most_A);

/** The gates are about to go on. */
void ht_rotor_catch_begin(ht_rotor_catch_state *st);

/** A period with all legs low has ended, at the electrical speed `omega_rad_s`, with the current `i_A`; the
 *  d axis is believed to be `axis`. */
ht_rotor_catch ht_rotor_catch_step(const ht_observer_config *machine, ht_rotor_catch_state *st,
                                   float omega_rad_s, ht_ab axis, ht_ab i_A, float most_A);

#endif
