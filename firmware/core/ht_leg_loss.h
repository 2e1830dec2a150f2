/** @file ht_leg_loss.h
 *  Finds a leg that does not do what it is told: an open phase, both switches off, or one switch
 *  that stays off.
 *
 *  The machine induces no voltage in x-y. There the voltage that the legs really make is
 *  R i + L_xy di/dt, which the currents show. What it exceeds the commanded voltage by is the
 *  residual. It is zero in a healthy drive, whatever the machine does. A leg k whose terminal is
 *  lower than commanded by u, because its upper switch does not conduct, makes a residual of -u/3
 *  along (cos 5 theta_k, sin 5 theta_k), and one whose lower switch does not conduct the opposite.
 *  The twelve directions are 30 degrees apart. A leg that carries no current at all shows whichever
 *  of its two directions the current should have flowed in at that time.
 *
 *  A current sensor that is wrong makes a residual, too, along the same directions. But then the
 *  three currents of its set do not add up to zero. This rules out a loss for a while; a smaller sum
 *  makes a larger residual necessary. (With two sensors a set this could not be told.)
 *
 *  Wrong machine parameters make a residual, too, or turn it into the next direction. But a lost leg
 *  carries no current while it makes a residual. So no leg is named that carries current. Once a leg
 *  is off the residual has one direction and its opposite, and only shows that one more is lost.
 */
#ifndef HT_LEG_LOSS_H
#define HT_LEG_LOSS_H

#include "ht_types.h"

typedef struct {
    float least_V2;     /**< smallest residual that counts, squared; 0 = off */
    float gain;         /**< of the residual's low pass, per period */
    float l_per_ts_ohm; /**< L_xy / Ts */
    float sum_A;        /**< a set's sum from which on a sensor is wrong */
    uint16_t hold;      /**< periods for which the residual must point the same way */
    uint16_t wait;      /**< periods for which a wrong sensor rules out a loss */
} ht_leg_loss_config;

typedef struct {
    ht_xy low_V;          /**< low pass of the residual */
    float low_A2;         /**< the same of the x-y current, squared */
    float tolerance_ohm2; /**< residual per x-y current that wrong machine parameters may cause,
                             *   squared; the slow interrupt writes it */
    uint16_t direction;   /**< where the residual points, 0..11 by 30 degrees */
    uint16_t count;       /**< for so many periods */
    float leg_A;          /**< |current| of that direction's leg, summed over these periods */
    float all_A;          /**< the same of all six */
    uint16_t wait;        /**< periods until a loss may be found again */
    uint16_t found;       /**< 0: none, else 1 + direction */
    bool off;             /**< a leg is off already: a direction does not name the next one */
    ht_xy sum_V;          /**< residual of the periods since it became large, added up */
} ht_leg_loss_state;

/** What a direction of the residual means. */
typedef struct {
    uint16_t leg;
    bool lower; /**< the lower switch does not conduct, else the upper one */
} ht_leg_loss;

void ht_leg_loss_reset(ht_leg_loss_state *st);

/** One period: `v_V` commanded (dead time included), `from` and `to` x-y currents at its ends,
 *  `i_A` the currents at its end. What is found stays in `st->found` until a reset. */
void ht_leg_loss_step(const ht_leg_loss_config *cfg, ht_leg_loss_state *st, ht_xy v_V, ht_xy from,
                      ht_xy to, const ht_six *i_A, float rs_ohm);

/** For the slow interrupt: what parameters that are wrong by HT_LEG_LOSS_TOLERANCE may cause while
 *  the flux turns with `omega_rad_s`. The largest harmonics of the x-y currents are the fifth and
 *  the seventh, which the low pass attenuates. */
void ht_leg_loss_tolerate(ht_leg_loss_state *st, float rs_ohm, float lxy_H, float omega_rad_s);
#define HT_LEG_LOSS_TOLERANCE 0.3f

/** Time constant of the low pass. */
#define HT_LEG_LOSS_FILTER_S 0.002f

/** Meaning of a direction 0..11. */
ht_leg_loss ht_leg_loss_of(uint16_t direction);

#endif
