/** @file ht_interleaved.h
 *  Interleaved carriers of both sets: a quarter of a carrier's period apart, and every pulse with a
 *  position of its own.
 *
 *  A carrier's period is four sampling periods, a half of it two. Set 1 begins a half at every second
 *  sample, set 2 at the samples between. In a rising half every leg of the set goes from low to high,
 *  in a falling one from high to low, once, at any instant of the two periods. So one set is decided
 *  in each period, and every leg has one toggle a period at most.
 *
 *  The pulse of leg k has the duty ratio d_k and lies `delta_k` of a carrier's period behind the
 *  carrier's middle. What the edges of all legs leave of flux ripple in closed form (the sum of
 *  G_ij K(t_i - t_j) over all pairs of edges, K = -B_4/24) is
 *
 *    J = |ripple of the current|^2 + 2 (ripple of the torque)^2
 *
 *  and each half moves one pulse of its set down the slope of J. Nothing is integrated or tabled.
 *
 *  For the least distortion both sets begin together, in phase or, in every second 30 degrees of the voltage,
 *  opposite to each other; legs may be clamped by turns. ht_modulator.h has both. Between both ends J has
 *  several minima, so no weight in it gives every result. Both kinds of carriers take turns instead: ripple
 *  squared is then the mean of both ends' squares, weighted with the share of the time. Set 2 joins set 1, or
 *  leaves it, by a half that lasts one period and makes the same mean voltage.
 *
 *  Below a fifth of V_dc a position changes little, because all legs are at half; there the pulses of
 *  a set are moved together, away from the instants at which the converter samples.
 */
#ifndef HT_INTERLEAVED_H
#define HT_INTERLEAVED_H

#include "ht_modulator.h"

/** Sampling periods of a half of the carrier, and of the whole. */
#define HT_HALF_PERIODS 2.0f
#define HT_CARRIER_PERIODS 4.0f
/** Carriers after which both kinds have taken their turns: more of them alternate more slowly, fewer have
 *  more of the halves that last one period. */
#define HT_TURN_CARRIERS 64u

typedef struct {
    float alike;         /**< weight of two legs of different sets 30 degrees apart, -1 .. 1 */
    float cap;           /**< most that a position moves in a half, share of a carrier's period */
    uint16_t together;   /**< in how many of HT_TURN_CARRIERS the sets begin together */
    float kappa;         /**< share of the clamped zero sequence there */
    float kappa_from_pu; /**< and the voltage from which it counts; units of Vdc */
} ht_interleaved_config;

/** One set: legs in the order of the commands p, q - p/2, -q - p/2. */
typedef struct {
    float half_d[3];  /**< half of the duty ratios */
    float delta[3];   /**< positions */
    uint16_t next[3]; /**< counts at which legs toggle in the half's second period */
    unsigned moves;   /**< which do, as a state word */
} ht_interleaved_set;

typedef struct {
    ht_interleaved_set set[2];
    ht_ab steady_pu;  /**< of set 1, at its latest begin */
    uint16_t carrier; /**< which of HT_TURN_CARRIERS is next */
    bool together;    /**< in this one the sets begin together, at 0 and 2 */
    bool joined;      /**< and set 2 has joined */
    bool brief;       /**< the half that set 2 begins lasts one period */
    bool opposite;    /**< one set rises while the other falls */
    uint16_t quarter; /**< 0..3: set 1 begins at 0 and 2, set 2 at 1 and 3 */
    uint16_t turn;    /**< 0..2: whose position of a set is improved */
} ht_interleaved_state;

/** The task of a set in its half. */
typedef struct {
    ht_ab v_pu;      /**< mean voltage of the set, units of Vdc */
    ht_ab quad;      /**< unit vector across the rotor flux in the middle of the half */
    ht_ab steady_pu; /**< voltage without what corrects errors, units of Vdc */
} ht_interleaved_command;

/** `rho` = sigma L_s / L_xy, the sampling frequency, and the share 0 .. 1 of carriers in which the sets begin
 *  together. `kappa`, `kappa_from_pu`: as ht_modulator_config has them, of legs that alternate. */
void ht_interleaved_configure(ht_interleaved_config *cfg, float rho, float f_isr_Hz, float together,
                              float kappa, float kappa_from_pu);

/** True if every value of `cfg` is in its range. */
bool ht_interleaved_check(const ht_interleaved_config *cfg);

/** Before the first half of set 1. */
void ht_interleaved_reset(ht_interleaved_state *st);

/** Which sets begin a half in the next period: 1, 2, both (3) or none. That of set 2 may be brief. */
unsigned ht_interleaved_begins(const ht_interleaved_config *cfg, ht_interleaved_state *st);

/** One period's pattern: a half of set `a` begins as commanded, that of the other one goes on. `bare`: the
 *  other set has not begun any half; its legs are low. Returns by how much the flux of the set that begins
 *  will be off its mean at its next begin, units of Vdc and periods.
 *
 *  Whatever goes in, NaN included: CA and CB are as ht_modulator_step has them. */
ht_ab ht_interleaved_step(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                          const ht_interleaved_command *command, unsigned a, bool bare,
                          const ht_modulator_input *in, ht_compare *out, ht_applied *applied,
                          ht_toggles *toggles);

/** The same as ht_interleaved_step where both sets begin, or none does. */
void ht_interleaved_both(const ht_interleaved_config *cfg, ht_interleaved_state *st,
                         const ht_interleaved_command command[2], bool begins,
                         const ht_modulator_input *in, ht_ab off_pu[2], ht_compare *out,
                         ht_applied *applied, ht_toggles *toggles);

#endif
