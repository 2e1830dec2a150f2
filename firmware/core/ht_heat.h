/** @file ht_heat.h
 *  The temperatures of the machine, as its currents tell them: two bodies, the winding and the frame.
 *  The winding has six parts, one on each leg, because a standing rotor or a lost leg heats them
 *  unequally.
 *
 *    (C/6) d theta_k/dt = R_s(theta_k) i_k^2 - (theta_k - theta_f)/(6 R)
 *    C_f d theta_f/dt = sum of (theta_k - theta_f)/(6 R) + P_f - (theta_f - ambient)/R_f
 *    R_s(theta) = R_s (1 + alpha (theta - theta_s))
 *
 *  P_f: losses of rotor and iron. The state holds rises above the ambient, so that zeros are a cold
 *  machine.
 *
 *  The adapted R_s is a second witness where it is exact. A single one of it cannot tell a warm winding
 *  from an R_s that was told too small: 1 % of R_s is 2.5 K. So one of the two must be known at a reset.
 *  What R_s tells is the mean of the parts, weighted by their squared currents: so its drop acts.
 *
 *  A sensor in the winding of u1 beats both: it moves all temperatures to where its own part has the
 *  measured one, at the first reading at once. Without a thermal resistance
 *  all parts have the measured temperature. Steps are as long as the time constants allow: the many small ones of each slow interrupt
 *  would be lost in a float.
 */
#ifndef HT_HEAT_H
#define HT_HEAT_H

#include <stdbool.h>

#include "ht_types.h"

/** Change of a copper winding's resistance per kelvin, relative to that at 20 degC. */
#define HT_COPPER_PPM_K 3930
#define HT_COPPER_PER_K (1.0e-6f * (float)HT_COPPER_PPM_K)
/** Copper has no resistance at this temperature, as a straight line through that at 20 degC tells. */
#define HT_COPPER_ZERO_DEGC (20.0f - 1.0f / HT_COPPER_PER_K)

/** A sensor's temperature is followed so many times as quickly as the winding's heat goes to the frame: a
 *  wrong model pulls its temperatures back. */
#define HT_HEAT_SENSOR_HEED 16.0f

/** What the adapted R_s tells (parameter `rs_tells`): nothing; the temperature, because rs_ohm is exact;
 *  or R_s itself, once, while the model has the winding cold, and from then on the temperature. */
enum { HT_RS_TELLS_NOTHING = 0, HT_RS_TELLS_TEMPERATURE = 1, HT_RS_TELLS_RESISTANCE = 2 };

typedef struct {
    float sample_gain;    /**< low pass of the squared samples, per handing over */
    float more_gain;      /**< low pass of the part that they miss, per look; 0: none is needed */
    float look_turns;     /**< looks begin up to so many turns of the samples apart, at random */
    float steps;          /**< slow interrupts for a step; 0: heat is not watched */
    float per_W_K;        /**< what a watt in a part heats it by in a step */
    float to_frame;       /**< share of its rise above the frame that a part loses in a step */
    float frame_per_W_K;  /**< what a watt heats the frame by in a step */
    float frame_per_rise; /**< what the parts' rises above it heat it by, each */
    float to_ambient;     /**< share of its rise that the frame loses in a step */
    float ohm_per_K;      /**< R_s, as it is told, over its temperature above HT_COPPER_ZERO_DEGC */
    float ambient_K;      /**< the ambient temperature above that */
    float settled;        /**< slow interrupts until the adaptation has followed */
    uint16_t rs_tells;    /**< HT_RS_TELLS_... */
    float heed;           /**< share of its difference that a reading of a sensor moves them by */
    bool sensed;          /**< there is a sensor */
    float ambient_degC;
    float limit_degC; /**< from here on the torque is limited */
    float trip_degC;  /**< and from here on there is none */
} ht_heat_config;

/** Squared samples of some turns. */
typedef struct {
    float sum_A2[HT_LEGS];
    float turns; /**< times that all legs have had theirs */
} ht_heat_samples;

typedef struct {
    ht_heat_samples gathered; /**< the fast interrupt's */
    ht_heat_samples handed;   /**< for the slow one */
    volatile uint16_t full;   /**< 1: `handed` is there, 0: it may be filled */
    float turns;              /**< low pass of the turns that were handed over */
    float square_A2[HT_LEGS]; /**< mean squared samples */
    float more_A2[HT_LEGS];   /**< low pass of the part that they miss (ht_look.h) */
    float sum_A2[HT_LEGS];    /**< since the latest step */
    float frame_sum_W;
    float summed; /**< slow interrupts since then */
    float rise_K[HT_LEGS];
    float frame_rise_K;
    float ohm_per_K; /**< R_s as it was learnt; 0: it has told nothing yet */
    float told_ohm;  /**< sum of R_s where it tells the temperature, since the latest step */
    float told;      /**< and how many there are in it */
    float telling;   /**< slow interrupts without a break for which it could */
    bool measured;   /**< a sensor has told its temperature */
} ht_heat_state;

/** Mean square of a leg's current. */
float ht_heat_square_A2(const ht_heat_state *st, int leg);

/** Fast interrupt, at the end of a turn while `full` is 0: what was gathered is the slow one's. */
void ht_heat_hand_over(ht_heat_state *st);

/** Slow interrupt: takes them. Each sample counts alike: a low pass that the slow interrupt looked into
 *  showed a current of half its frequency always at the same phase. */
void ht_heat_take(const ht_heat_config *cfg, ht_heat_state *st);

/** A cold machine. */
void ht_heat_reset(ht_heat_state *st);

/** Slow interrupt. powered: currents may flow; frame_W: losses of rotor and iron; rs_ohm: adapted R_s,
 *  0 where it is not exact. */
void ht_heat_step(const ht_heat_config *cfg, ht_heat_state *st, bool powered, float frame_W,
                  float rs_ohm);

/** A build-up by direct current has ended with this R_s. The first one since a reset is believed as it
 *  is. */
void ht_heat_built(const ht_heat_config *cfg, ht_heat_state *st, float rs_ohm);

/** A sensor in the winding of the first leg has this temperature. */
void ht_heat_measured(const ht_heat_config *cfg, ht_heat_state *st, float winding_degC);

/** R_s at the model's temperatures, mean of the parts. */
float ht_heat_rs_ohm(const ht_heat_config *cfg, const ht_heat_state *st);

/** Temperature of the hottest part of the winding. */
float ht_heat_winding_degC(const ht_heat_config *cfg, const ht_heat_state *st);

/** Share of the torque that a temperature leaves: 1 up to the limit, 0 at the trip. */
float ht_heat_left(float degC, float limit_degC, float trip_degC);

/** The same of a winding. */
float ht_heat_share(const ht_heat_config *cfg, float winding_degC);

#endif
