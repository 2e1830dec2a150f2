/** @file ht_catch.h
 *  Catches a turning shaft: the flux step that builds the flux up, or takes over what is left of it,
 *  without torque.
 *
 *  Without slip the flux stands still as the rotor sees it. So its reference has a direction that turns
 *  with the shaft: that of the flux which is left, or any, if there is none.
 *
 *  At first the current model's flux is controlled. An error D of its rotor flux then changes no current.
 *  With the voltage model's flux it would change the current by D / (sigma L_s). The voltage model, which
 *  is better at speed, takes over by and by, while the rotor's flux comes to its reference.
 */
#ifndef HT_CATCH_H
#define HT_CATCH_H

#include "ht_observer.h"

typedef struct {
    ht_ab along;   /**< direction of the flux reference, of length 1 */
    float periods; /**< since it began */
    ht_ab step_Wb; /**< of the period that the pattern written last is for, without R_s i */
} ht_catch_state;

typedef struct {
    ht_ab psi_Wb; /**< stator flux at the latest sample */
    ht_ab i_A;
    float turn_rad; /**< electrical angle that the rotor has turned since the sample before */
    float flux_ref_Wb;
    float vdc_V;
    bool shadow; /**< the step is made one period after this one */
} ht_catch_input;

/** Begin with this stator flux, without current. */
void ht_catch_begin(ht_catch_state *st, ht_ab psi_Wb);

/** One more period has passed: the share by which the flux is pulled to the current model's now. */
float ht_catch_pull(ht_catch_state *st);

/** The voltage of the next pattern times its period. */
ht_ab ht_catch_step(const ht_observer_config *machine, const ht_observer_state *flux,
                    ht_catch_state *st, const ht_catch_input *in);

#endif
