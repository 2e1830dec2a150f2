/** @file ht_log.h
 *  The drive's memory over power cycles: a log of events (ht_events.def), and counters.
 *  ht_log_ring.h says how they lie in the memory.
 *
 *  Words of an event, numbers of 32 bits with the low word first:
 *
 *      0   event, in the high octet the state             12  dc-link voltage, V
 *      1   scheme, in the high octet the cause of the     14  currents of the phases, A, as in the channels
 *          latest reset                                   26  speed, r/min
 *      2   sequence number                                28  temperature of the winding, degC
 *      4   seconds powered
 *      6   seconds with the gates on
 *      8   fault bits that took the gates off          30  of the power stage's hottest leg, by its model
 *      10  warning bits                                32  of the heat sink, by its thermistor
 *      11  limits that acted (channel `limits`)
 *
 *  A reply to LIST has them. A temperature is NaN if nothing tells it. In RAM and in the memory all three lie in
 *  words 28 and 29, in ten bits each from the lowest on: half kelvins above -100 degC, all bits set for NaN. The
 *  highest bit of word 1 says so: events of an earlier firmware, without it, have the winding's as a float.
 *
 *  Words of the counters: 1 events that were missed, 2 seconds powered, 4 seconds with the gates on, 6 starts;
 *  the largest 8 dc-link voltage, 10 phase current, 12 speed, 14 temperature of the winding (0: nothing told
 *  it). Of the trips: word 1 + k counts those of row k of ht_faults.def.
 *
 *  Writing. In idle, and in fault but with a wrong clock, a block in a turn of the background. Until then events
 *  wait in RAM. An erase waits until no client is there: it would miss its answers.
 *
 *  Wear. An event takes a slot, a trip, a run and an hour one more. Each event, each run, and trips without an
 *  event, take a token.
 *  There are HT_LOG_TOKENS, and one more comes every minute. Without one, an event is counted as missed, and
 *  counters wait.
 */
#ifndef HT_LOG_H
#define HT_LOG_H

#include "ht_drive.h"
#include "ht_log_ring.h"
#include "ht_reset.h"

#define HT_LOG_QUEUE 8u  /**< events that wait to be written */
#define HT_LOG_TRIPS 27u /**< faults whose trips are counted */
#define HT_LOG_TOKENS 64u
#define HT_LOG_ROW (HT_LOG_PAYLOAD + 4u) /**< words of an event in a reply */

/** An event. */
enum {
#define HT_EVENT(name, number, text, help) HT_EVENT_##name = (number),
#include "ht_events.def"
#undef HT_EVENT
};

/** Counters that never go down. */
typedef struct {
    uint32_t powered_s;
    uint32_t gates_s; /**< with the gates on */
    uint32_t starts;
    uint16_t missed; /**< events that found no room or no token; 65535: or more */
    float vdc_V;     /**< the largest that the background saw, or a trip left */
    float current_A; /**< of a phase with the gates on, its size */
    float speed_rpm; /**< its size */
    float winding_degC;
} ht_log_counters;

typedef struct {
    ht_log_ring ring;
    uint16_t queue[HT_LOG_QUEUE][HT_LOG_PAYLOAD]; /**< the oldest first */
    uint16_t waiting;                             /**< events in `queue` */
    uint16_t put;                                 /**< what the ring is writing */
    uint32_t sequence;                            /**< of the next event */
    ht_log_counters counters;
    uint16_t trips[HT_LOG_TRIPS]; /**< 65535: or more */
    /* Counters as the memory has them. */
    uint32_t kept_powered_s;
    uint32_t kept_gates_s;
    uint32_t kept_starts;
    bool trips_kept;
    bool trips_due; /**< they go with an event that is written */
    /* The drive as the latest turn found it. */
    uint32_t tick;
    uint32_t ticks;       /**< that are no whole second yet */
    uint32_t gates_ticks; /**< the same with the gates on */
    uint32_t token_s;     /**< `powered_s` when the latest token came */
    uint16_t tokens;
    uint16_t warned; /**< warnings of this run that have their event */
    bool at_work;
    bool faulty;
    uint32_t fault_tick; /**< of the latest trip that was noted */
    ht_reset reset;
    bool started; /**< the event of the start is made */
} ht_drive_log;

/** Make `l` a log without a memory: it forgets with the power. */
void ht_log_none(ht_drive_log *l);

/** Begin after a reset; NULL: its cause is not known. The turns that follow read the memory. */
void ht_log_start(ht_drive_log *l, const ht_reset *reset);

/** A turn of the background. `alone`: no client has a session, and nothing is captured. */
void ht_log_turn(ht_drive_log *l, const ht_drive *d, bool alone);

/** Is there a memory that works? */
bool ht_log_keeps(const ht_drive_log *l);
/** The number of events. */
uint16_t ht_log_events(const ht_drive_log *l);
/** An event into `words`, HT_LOG_ROW of them; row 0 is the latest. HT_ERROR_ID: there is
 *  none, or it cannot be read. HT_ERROR_STATE: it is in the memory, which is read with the gates off only. */
ht_result ht_log_row(const ht_drive_log *l, const ht_drive *d, uint16_t row, uint16_t *words);

/** Empty the log of its events, but for one that says so. The counters stay. HT_ERROR_STATE: not now. */
ht_result ht_log_forget(ht_drive_log *l, const ht_drive *d);

#endif
