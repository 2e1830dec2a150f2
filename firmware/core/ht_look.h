/** @file ht_look.h
 *  The mean squares of the phase currents over one sampling period, from its pattern and the currents at
 *  its ends. A sample lies at one place of the ripple, so its square is not the mean: between the samples
 *  each current follows the legs' voltages,
 *
 *    i(t) = i_0 + (i_1 - i_0) t/T + integral of Y (v - its mean),
 *
 *  with the transient inductance in alpha-beta and L_xy in x-y behind Y. What both samples show has no
 *  model: induced voltage, resistances and a wrong V_dc move the ends. The legs' edges are late by the
 *  dead time where the current makes them so.
 */
#ifndef HT_LOOK_H
#define HT_LOOK_H

#include "ht_observer.h"
#include "ht_pattern.h"

/** Edges of a leg in a period: at its first effect, by CA and by CB. */
#define HT_LOOK_EDGES 3

/** What a look takes with it. */
typedef struct {
    ht_compare pattern
        [2]; /**< of the period before, which tells the legs' states at the begin, and of it */
    ht_six i_A[2]; /**< at its begin and end */
    ht_ab axis;    /**< d axis of a rotor with magnets, at its end */
    /* What is computed of it, which a stack has no room for: */
    unsigned before;                     /**< state word before the edges */
    uint16_t at[HT_LEGS][HT_LOOK_EDGES]; /**< counts; those that there are not lie at the end */
    float high[HT_LEGS];                 /**< share of the period in which each leg is high */
    float away[HT_LEGS];                 /**< of a leg from that, while a state word lasts */
    float A[HT_LEGS]
           [HT_LEGS]; /**< what a phase's current (first index) changes by in a period while
                                *   a leg is high, and the others are low */
} ht_look;

/** What the currents follow. */
typedef struct {
    const ht_observer_config *machine;
    float lxy_H;
    float vdc_V;
    const ht_period *period;
    const ht_dead_time *dead;
    uint16_t off_legs; /**< a state word: no current flows there, whatever the pattern says */
} ht_look_circuit;

/** Mean square of each phase's current. */
void ht_look_squares(ht_look *look, const ht_look_circuit *circuit, ht_six *square_A2);

#endif
