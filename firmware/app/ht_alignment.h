/** @file ht_alignment.h
 *  The alignment of a rotor with magnets: the drive learns its angle, and checks it, before it makes torque.
 *
 *  "align": direct current pulls the d axis to 105 degrees, then to 15 degrees; to 90 and to 0 where the
 *  winding's sets are not 30 degrees apart; to others if a leg is lost (ht_lost_legs_aligning). So a rotor
 *  that stood exactly against the current at first is pulled all the same. The encoder must then show a
 *  quarter of an electrical turn backwards, from the middle of the rotor's swing.
 *
 *  "known": the encoder's count tells the angle. Direct current pulls the rotor to the nearest of twelve
 *  directions, where the count must show it within 30 degrees; beyond 60 it ends at once, so a wrong angle
 *  is found before the rotor has made a quarter of an electrical turn.
 *
 *  Either way the rotor swings for a while, and the drive waits until it rests.
 */
#ifndef HT_ALIGNMENT_H
#define HT_ALIGNMENT_H

#include "ht_angle.h"

typedef struct {
    bool known;
    uint32_t ticks;      /**< of the build-up; four times as long at most */
    uint32_t counts_rev; /**< of the encoder */
    uint16_t pole_pairs;
    uint16_t first; /**< angle of direction 0 over 15 degrees: 0 or 1 */
} ht_alignment_config;

typedef struct {
    uint32_t electrical; /**< angle of the d axis, 0..counts_rev - 1; the caller turns it on */
    uint32_t aside;      /**< the same while it was pulled aside: the middle of its swing */
    uint32_t lookout;    /**< the same when the latest look began */
    int32_t least;       /**< furthest way from there since then, 0 or less */
    int32_t most;        /**< and the other way, 0 or more */
    uint32_t before;     /**< angle of the d axis a period ago */
    int32_t travelled;   /**< how far it has come since the first period */
    uint32_t end;        /**< tick at which this look ends */
    uint16_t direction;  /**< of the current, as ht_control_align has it */
    uint16_t along;      /**< the last one if the angle is not known */
} ht_alignment_state;

typedef enum { HT_ALIGNING = 0, HT_ALIGNED = 1, HT_NOT_ALIGNED = 2 } ht_alignment;

/** `electrical` after the shaft has moved by this many counts. Exact: an angle that is added up in
 *  floating point drifts. */
uint32_t ht_electrical(uint32_t electrical, int32_t moved, uint16_t pole_pairs,
                       uint32_t counts_rev);

/** The first period. With `known`, `electrical` must be right; else the direction `along` is the last one. */
void ht_alignment_begin(const ht_alignment_config *cfg, ht_alignment_state *st, uint16_t along);

/** A period, `tick` from 1 on. When it has ended as it should, `electrical` is right. */
ht_alignment ht_alignment_step(const ht_alignment_config *cfg, ht_alignment_state *st,
                               uint32_t tick);

#endif
