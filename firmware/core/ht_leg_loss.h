/** @file ht_leg_loss.h
 *  Finds a leg that does not do what it is told: an open phase, both switches off, or one switch
 *  that stays off.
 *
 *  The machine induces no voltage in x-y. There the voltage that the legs really make is
 *  R i + L_xy di/dt, which the currents show. The residual is this voltage minus the commanded
 *  one. It is zero in a healthy drive, whatever the machine does. A leg k whose terminal is
 *  lower than commanded by u, because its upper switch does not conduct, makes a residual of -u/3
 *  along (cos 5 theta_k, sin 5 theta_k), and one whose lower switch does not conduct the opposite.
 *
 *  While the low pass of the residual is large, evidence is gathered for each of the twelve switches.
 *  If the upper one is lost, current out of the leg flows through the lower diode, so the terminal is
 *  low and the residual is known from the command. Current into the leg flows as ever, without a
 *  residual. While no current flows, any residual along the axis speaks for the loss. An open phase
 *  may carry its current on in an arc, whose voltage opposes the current and may be small: so a
 *  residual of any size speaks for the leg whose direction it has, if it opposes the leg's current.
 *  A period that does not fit speaks against the loss. The switch is named for which there is clearly
 *  more evidence than for any other. Wrong machine parameters make a residual, too, but it does not
 *  keep to any leg's currents. Large x-y currents and an L_xy that is far from the true one may name
 *  a leg even so. So before that, the same periods are asked whether one L_xy explains the residual
 *  of all of them: it is along the change of the current then, whatever the direction. That L_xy is
 *  learnt, and the evidence begins again. It is asked once; a residual that stays is a lost leg's.
 *  A leg that carries no current at all shows whichever of its switches
 *  should have conducted at that time.
 *
 *  A current sensor that is wrong makes a residual along the same directions. But then the three
 *  currents of its set do not add up to zero. This rules out a loss for a while; a smaller sum
 *  makes a larger residual necessary. (With two sensors a set this could not be told.)
 *
 *  Once a leg is lost, only one x-y direction remains for the current, and for the
 *  residual: it tells that another leg is lost, not which. The currents may tell (ht_leg_loss_dead).
 */
#ifndef HT_LEG_LOSS_H
#define HT_LEG_LOSS_H

#include "ht_pattern.h"

#define HT_SWITCHES 12u /* of six legs */

typedef struct {
    ht_winding winding;
    float least_V2;     /**< smallest residual that counts, squared; 0 = off */
    float gain;         /**< of the residual's low pass, per period */
    float l_per_ts_ohm; /**< L_xy / Ts */
    float sum_A;        /**< a set's sum from which on a sensor is wrong */
    float zero_A;       /**< a leg with less carries no current */
    uint16_t hold;      /**< periods for which evidence is gathered at least */
    uint16_t wait;      /**< periods for which a wrong sensor rules out a loss */
} ht_leg_loss_config;

/** The evidence of a leg while the residual is large. */
typedef struct {
    float upper_V; /**< how much speaks for a lost upper switch, 0 or more */
    float lower_V; /**< and for a lost lower one */
    float sum_A;   /**< its current without sign, added up */
} ht_leg_evidence;

/** Sums over the periods since the residual became large. */
typedef struct {
    float both_VA;   /**< residual times the change of the x-y current */
    float change_A2; /**< this change, squared */
    float residual_V2;
    float sums_A2; /**< of the sets' currents: change of the sums, squared; slow: sums, squared */
} ht_leg_loss_fit;

typedef struct {
    ht_xy low_V;          /**< low pass of the residual */
    float low_V2;         /**< the same of the residual, squared */
    float low_A2;         /**< and of the x-y current, squared */
    float tolerance_ohm2; /**< residual per x-y current that wrong machine parameters may cause,
                             *   squared; the slow interrupt writes it */
    uint16_t count;       /**< periods for which evidence is gathered */
    ht_leg_evidence leg[HT_LEGS];
    uint16_t wait;    /**< periods until a loss may be found again */
    uint16_t found;   /**< 0: none, else what ht_leg_loss_of explains; without a leg already, 1
                       *   only tells that there is another */
    uint16_t without; /**< legs that are lost already, a state word */
    ht_xy sum_V;      /**< residual of the periods since it became large, added up */
    ht_leg_loss_fit fit;
    float more_ohm; /**< learnt: what L_xy / Ts has beyond the configured one */
    bool learnt;    /**< since the residual became large */
    ht_xy now_V;    /**< residual of the latest period, for the slow interrupt */
    ht_xy change_A; /**< and what the x-y current changed by in it */
    ht_leg_loss_fit
        slow; /**< of the latest periods of slow interrupts in which nothing was suspected */
} ht_leg_loss_state;

/** The finding. */
typedef struct {
    uint16_t leg;
    bool lower; /**< the lower switch does not conduct, else the upper one */
} ht_leg_loss;

void ht_leg_loss_reset(ht_leg_loss_state *st);

/** L_xy that is learnt is up to so many times what the parameter says, or as small a part of it. An
 *  estimated leakage is right within 2.3, and L_xy is 0.3 to 1 times the leakage, believed is 0.55. */
#define HT_LEG_LOSS_MOST_FACTOR 4.2f

/** One period. */
typedef struct {
    const ht_applied *applied; /**< the legs' commands */
    const ht_toggles *toggles;
    const ht_six *begin_A; /**< phase currents at its begin */
    const ht_six *end_A;   /**< and at its end */
    float vdc_V;
    float rs_ohm; /**< as the observer has it */
} ht_leg_loss_period;

/** One period: `v_V` commanded (dead time included), `from` and `to` x-y currents at its ends. What
 *  is found stays in `st->found` until a reset. */
void ht_leg_loss_step(const ht_leg_loss_config *cfg, ht_leg_loss_state *st,
                      const ht_leg_loss_period *in, ht_xy v_V, ht_xy from, ht_xy to);

/** For the slow interrupt: what parameters that are wrong by HT_LEG_LOSS_TOLERANCE may cause while
 *  the flux turns with `omega_rad_s`. The largest harmonics of the x-y currents are the fifth and
 *  the seventh, which the low pass attenuates. */
void ht_leg_loss_tolerate(ht_leg_loss_state *st, float rs_ohm, float lxy_H, float omega_rad_s);
#define HT_LEG_LOSS_TOLERANCE 0.3f

/** For the slow interrupt: learn L_xy from its latest period, while no leg is suspected, the residual is
 *  not unusually large, and the x-y currents change so much, and not by noise, that an L_xy 30 % wrong
 *  makes a residual that counts. Where they are regulated they do not, and nothing needs to be learnt.
 *  `i_A`: phase currents; `gain`: of the means, per slow interrupt. */
void ht_leg_loss_learn(const ht_leg_loss_config *cfg, ht_leg_loss_state *st, const ht_six *i_A,
                       float gain);

/** For the slow interrupt: whether evidence is being gathered, or the residual is beyond 0.4 of its
 *  limit. Then a leg may be lost whose arc is too small to be found while it burns. Never while the
 *  check is off. */
bool ht_leg_loss_maybe(const ht_leg_loss_config *cfg, const ht_leg_loss_state *st);

/** Time constant of the low pass. */
#define HT_LEG_LOSS_FILTER_S 0.002f

/** The leg, a state word, that carried next to no current while the residual was large; 0 if that is
 *  not one alone. Legs that are lost already are left out. */
uint16_t ht_leg_loss_dead(const ht_leg_loss_state *st);

/** Meaning of ht_leg_loss_state::found, 1..12. */
ht_leg_loss ht_leg_loss_of(uint16_t found);

#endif
