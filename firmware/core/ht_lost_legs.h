/** @file ht_lost_legs.h
 *  Changes while legs are off and the drive goes on. Then every law commands a voltage.
 *
 *  Leg k lies at theta_k in alpha-beta and in a direction of its own in x-y, at 5 theta_k where the
 *  sets are 30 degrees apart. Let a and b be the unit vectors of these directions. No current flows in the leg: a.i_ab + b.i_xy = 0. The voltage of its terminal
 *  is unknown. It acts along a and along b by the same amount, so
 *
 *    w = a.v_ab - b.v_xy
 *
 *  does not depend on it. Along a the machine has twice the resistance, and the x-y inductance in
 *  series with the transient one:
 *
 *    w = 2 R a.i + d(a.psi)/dt + L_xy d(a.i)/dt - b.e
 *
 *  where e is what magnets induce in x-y: the functions take v_xy less e for v_xy. The current along a
 *  follows the flux through sigma L_s, which magnets have for L_q. Where L_d is less, that is exact while the
 *  flux along the magnets stays as it is.
 *  R is that of the other set than the leg's: along a it carries all of the current. Across these
 *  directions nothing has changed. All this holds in every winding. Such a pair (a, b) is an axis here. One lost leg is
 *  one axis; two legs that are 90 degrees apart, or a whole set, are two. On one axis the x-y
 *  current across b is left to choose. None gives the least copper loss. Minus the current across a
 *  gives the most torque from the rated phase current; then no current flows in the leg that is 90
 *  degrees away, and it may as well be off. Where the sets are 0 or 60 degrees apart, no leg is 90
 *  degrees away: one at 0 or 180 degrees carries twice the current along a, whatever flows across b.
 */
#ifndef HT_LOST_LEGS_H
#define HT_LOST_LEGS_H

#include "ht_voltage_law.h"

typedef struct {
    ht_ab a;
    ht_xy b;
    float more_ohm; /**< R of the set that carries the current, less the mean of both sets */
} ht_lost_axis;

typedef struct {
    ht_winding winding;
    uint16_t axes; /**< 0: no leg is lost; 1 or 2 */
    bool set;      /**< a whole set: none of its legs is left */
    bool of_set2;  /**< the leg of the first axis is of set 2 */
    ht_lost_axis axis[2];
} ht_lost_legs;

/** Legs that must be off where those of the state word `legs` are lost: these, or their whole set.
 *  The axes go to `lost`. 0 if no torque worth speaking of is left: other combinations. */
uint16_t ht_lost_legs_of(ht_winding winding, uint16_t legs, ht_lost_legs *lost);

/** The difference of the sets' resistances: that of set 2 is `set2_ohm` above the mean of both. After
 *  ht_lost_legs_of, which assumes none. */
void ht_lost_legs_differ(ht_lost_legs *lost, float set2_ohm);

/** The legs of the state word `legs`, and, if it is a single one, the leg that is 90 degrees away, if
 *  there is one. */
uint16_t ht_lost_legs_paired(ht_winding winding, uint16_t legs);

/** Voltage that really acts. `v_V`: mean of a period as the pattern makes it, with any voltage of the
 *  lost legs, less what magnets induce; `from` and `to`: x-y currents at the period's ends. These show the voltage along b,
 *  because a winding induces none in x-y, also where the diodes of a lost leg conduct. */
ht_vsd ht_lost_legs_voltage(const ht_lost_legs *lost, const ht_observer_config *machine,
                            float rs_ohm, ht_vsd v_V, ht_xy from, ht_xy to);

/** Alpha-beta voltage of a period that is to come, from the currents `i_A` and the rotor flux seen from the
 *  stator, `r_Wb`, at its beginning. `turn_rad`: angle that this turns. */
ht_ab ht_lost_legs_expected(const ht_lost_legs *lost, const ht_observer_config *machine,
                            float rs_ohm, ht_vsd v_V, ht_ab i_A, ht_ab r_Wb, float turn_rad);

/** The part of an x-y quantity that is left to regulate: none along b. */
ht_xy ht_lost_legs_across(const ht_lost_legs *lost, ht_xy value);

/** The direction (ht_twelfth) in which a rotor with magnets is aligned: along it the legs force the least
 *  current on x-y, and harmonics of the induced voltage turn the rotor least with that. One lost leg leaves
 *  0.26 of the current in alpha-beta, or none where the sets are not 30 degrees apart. Two or a set leave all
 *  of it in every direction. The first of equal ones, 0 if no leg is lost. */
uint16_t ht_lost_legs_aligning(const ht_lost_legs *lost);

/** Current of the most loaded leg, `i_A` being that in alpha-beta. */
float ht_lost_legs_most_A(const ht_lost_legs *lost, ht_ab i_A);

/** The voltage that the remaining legs must be given for a law's voltage, units of Vdc. The
 *  lost leg's own command is free. It is chosen such that the other two legs of its set are near
 *  the lower rail while the machine's voltage drives the lost leg's terminal up, and near the upper
 *  rail while it drives it down: otherwise the diodes of a leg whose switches are off would
 *  conduct. */
ht_vsd ht_lost_legs_command(const ht_lost_legs *lost, const ht_observer_config *machine,
                            const ht_voltage_law_input *in, ht_vsd v_pu);

#endif
