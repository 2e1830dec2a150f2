/** @file ht_speed_measure.h
 *  Speed from a quadrature encoder, two ways:
 *
 *  - edges per time: counts over one slow period. One count is always worth the same
 *    speed, 60 f_slow / N, whatever the speed is.
 *  - time per edge: time between the last two unit events, every HT_CAPTURE_COUNTS-th
 *    edge. One tick is worth n^2 N / (60 HT_CAPTURE_COUNTS f_capture): little at low
 *    speed, much at high speed.
 *
 *  Both are equally fine at n = (60 / N) sqrt(HT_CAPTURE_COUNTS f_capture f_slow):
 *  159 r/min for N = 8192 counts a revolution, 100 Hz and 1.17 MHz (F28335), 183 r/min
 *  at 1.56 MHz (F28377S).
 *
 *  Below the capture timer's range (65536 ticks per unit event: 0.52 r/min and
 *  0.70 r/min) edges per time is all there is: quantised, with the right mean, and 0
 *  while no edge comes.
 */
#ifndef HT_SPEED_MEASURE_H
#define HT_SPEED_MEASURE_H

#include <stdbool.h>
#include <stdint.h>

/** Edges from one unit event to the next: a whole quadrature cycle, so that unequal
 *  distances within the cycle cancel. */
enum { HT_CAPTURE_COUNTS = 4 };

/** The capture unit's values. Flags: events since it was read last. */
typedef struct {
    uint16_t period_ticks;   /**< between the last two unit events, capture clock */
    uint16_t age_ticks;      /**< since the last unit event, capture clock */
    bool event;              /**< there was a unit event */
    bool overflow;           /**< the timer went past 65535 ticks */
    bool reversed;           /**< the direction changed */
    bool forward;            /**< direction of the last edge */
    bool index;              /**< there was an index pulse */
    uint32_t index_position; /**< where the latest one rose, counts; only with `index` */
} ht_capture;

typedef struct {
    float rpm_per_count; /**< 60 f_slow / N: one count in a slow period */
    float rpm_ticks;     /**< 60 HT_CAPTURE_COUNTS f_capture / N: speed times period */
    float period_rpm;    /**< time per edge below this; 0 = never */
} ht_speed_measure_config;

typedef struct {
    uint16_t unusable_events; /**< unit events to come before the captured period can be used */
} ht_speed_measure_state;

void ht_speed_measure_reset(ht_speed_measure_state *st);

/** Speed in r/min, positive forward. To be called once in every slow period, with the counts
 *  `moved` since the last call and what the capture unit shows now. The result is time per edge
 *  up to `period_rpm`, edges per time from 1.25 times that on, and a weighted mean of the two in
 *  between. It differs from edges per time by one count at most. */
float ht_speed_measure_step(const ht_speed_measure_config *cfg, ht_speed_measure_state *st,
                            int32_t moved, const ht_capture *capture);

#endif
