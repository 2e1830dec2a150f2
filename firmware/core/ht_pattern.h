/** @file ht_pattern.h
 *  The pattern of one sampling period: three state words and two action points become compare
 *  registers (paper A, eqs. 16 to 18), and from the pattern and the currents follow the
 *  volt-seconds that the machine really gets, dead time included.
 */
#ifndef HT_PATTERN_H
#define HT_PATTERN_H

#include "ht_duty.h"

/** Compare registers of the six legs for one period. */
typedef struct {
    uint16_t start;       /**< state word at the start; each compare toggles */
    uint16_t ca[HT_LEGS]; /**< counts; `period` = no toggle */
    uint16_t cb[HT_LEGS]; /**< counts; `period` = no toggle */
} ht_compare;

/** Counts of a sampling period. */
typedef struct {
    uint16_t counts; /**< TBPRD + 1, 8..65535 */
    uint16_t first;  /**< where its pattern takes effect: 0 under shadow load, the write instant
                        *   under immediate load; below half of `counts` */
    uint16_t
        shortest; /**< pulse of a leg, high or low: dead time and shortest gate pulse; from 1 to
                        *   half of what is left behind `first` */
} ht_period;

/** A modulated period: every leg has an instant of its own (ht_modulator.h). */
typedef struct {
    float t[HT_LEGS]; /**< instant of the leg's toggle, per unit of the period; 1: none */
} ht_toggles;

/** The legs' commands over one sampling period. */
typedef struct {
    uint16_t before; /**< state word before the first edge */
    uint16_t s[3];   /**< state words from t[0], t[1], t[2] on */
    float t[3];      /**< instants in per unit of the period, ascending, in [0, 1];
                      *   t[1] and t[2] are 1 where no leg switches after t[0] */
    /* Derived from these by ht_applied_finish: */
    unsigned later;   /**< legs with an edge after the period's very start */
    unsigned close;   /**< legs whose edges may be closer to each other or to the period's end
                       *   than the dead time */
    unsigned rising;  /**< other legs with a rising edge */
    unsigned falling; /**< other legs with a falling edge (a leg may have both) */
    ht_vsd mean_pu;   /**< mean voltage as commanded, units of Vdc */
    uint16_t own;     /**< 0, or n: each leg goes from s[0] to s[1] = s[2] at an instant of its
                       *   own, which is in the n-th of the ht_toggles */
} ht_applied;

/** Legs whose current has a sure sign, as state words. Their current is so far from zero that an
 *  edge is late by the whole dead time or not at all. */
typedef struct {
    unsigned out; /**< out of the leg */
    unsigned in;  /**< into the leg */
} ht_flow;

/** Delay of an edge by the dead time that lasts beyond the end of a period (see
 *  ht_volt_seconds). */
typedef struct {
    uint16_t legs;        /**< legs concerned, as a state word */
    float shift[HT_LEGS]; /**< remaining delay, per unit of the period */
} ht_carry;

/** The deviations of the inverter's edges from the commanded ones. */
typedef struct {
    float dead_pu;  /**< dead time in per unit of the period, 0..0.5 */
    float i_zero_A; /**< below this current an edge is shifted in part, > 0 */
} ht_dead_time;

/** Counts for state words `s` and action points `p`, 0 <= t1 <= t2 <= 1.
 *
 *  Equations (17) and (18): CA toggles where S1 != S2, CB where S2 != S3, otherwise the register
 *  holds `period->counts`, which an up-counter never reaches. Each word lasts for the shortest pulse
 *  at least: a shorter one is lengthened or left out, whichever is nearer. So every pulse has its
 *  length, also one that the next period's start ends; and two hazards of toggle actions, which the
 *  paper does not name, are kept out: CA = 0 would swallow the start level, CA = CB would give one
 *  toggle for two. `applied` gets the words and the instants that became of this; the rest of it
 *  needs ht_applied_finish. */
void ht_pattern_counts(const uint16_t s[3], ht_action_points p, const ht_period *period,
                       ht_compare *counts, ht_applied *applied);

/** Complete a pattern: state word `before` it, and what follows from words and instants. */
void ht_applied_finish(ht_applied *a, uint16_t before, const ht_dead_time *dead);

/** Share of the period for which each leg is commanded high. */
void ht_applied_high(const ht_applied *a, const ht_toggles *toggles, ht_six *high);

/** In which legs the phase currents have a sure sign. */
ht_flow ht_flow_of(const ht_six *i_A, const ht_dead_time *dead);

/** Signs of the currents at the edges of a pattern, from their signs at the period's begin and
 *  end. At an edge at the very start the currents of the begin count. */
ht_flow ht_flow_at_edges(const ht_applied *a, ht_flow begin, ht_flow end);

/** Mean voltage of one sampling period in units of Vdc, edge by edge.
 *
 *  While both switches of a leg are off the current's sign decides: a rising
 *  edge is late by the dead time when the current flows out of the leg, a
 *  falling edge when it flows in. `i_begin` and `i_end` are the phase currents
 *  at the period's ends (linear in between), `flow` is where they flow at the edges.
 *  A pulse shorter than the dead time vanishes. A delay that lasts beyond the period's end is
 *  carried over, unless the leg is switched back before: `left` is what remains of the period
 *  before, and what remains of this one goes to `over` (both may be the same object).
 *  x and y are right only with `xy`. `toggles` is used where a->own says so. */
ht_vsd ht_volt_seconds(const ht_applied *a, const ht_toggles *toggles, const ht_dead_time *dead,
                       ht_flow flow, const ht_six *i_begin, const ht_six *i_end,
                       const ht_carry *left, ht_carry *over, bool xy);

#endif
