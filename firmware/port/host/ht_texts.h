/** @file ht_texts.h
 *  What the host says of results, misfits and parameter sets, and constants of the firmware that
 *  are macros there. Boards do not have these texts.
 */
#ifndef HT_TEXTS_H
#define HT_TEXTS_H

#include <stdbool.h>
#include <stdint.h>

#include "ht_drivers.h"
#include "ht_faults.h"
#include "ht_service.h"

/** Macros as enumerators: the host's interface has no macros. */
enum {
    HT_NUMBER_PHASE_LOST = HT_FAULT_PHASE,
    HT_NUMBER_COPPER_PPM_K = HT_COPPER_PPM_K,
    HT_NUMBER_ALL_LEGS = HT_ALL_LEGS,
    HT_NUMBER_OFFSET_MOST_COUNTS = HT_OFFSET_MOST_COUNTS,
    HT_NUMBER_PROTOCOL = HT_SERVICE_VERSION,
    HT_NUMBER_GET = HT_SERVICE_GET,
    HT_NUMBER_WRITE = HT_SERVICE_WRITE,
    HT_NUMBER_LONGEST_BODY = HT_PACKET_BODY,
    HT_NUMBER_STREAMS = HT_STREAMS,
    HT_NUMBER_SLOW_PERIOD = HT_TIMER0 + HT_TIMER_PRD /**< register of CPU timer 0 */
};

/** A row of ht_events.def. */
typedef struct {
    uint16_t number;
    const char *text;
    const char *help;
} ht_event_info;

uint16_t ht_event_count(void);
/** Table entry, or NULL if there is no such row. A row is not its number. */
const ht_event_info *ht_event_describe(uint16_t row);

/** A row of ht_results.def. */
typedef struct {
    uint16_t number;
    bool mistake;     /**< the request is wrong, in whatever state the drive is */
    const char *text; /**< {state} stands for the drive's state */
} ht_result_info;

uint16_t ht_result_count(void);
/** Table entry, or NULL if there is no such row. A row is not its number. */
const ht_result_info *ht_result_describe(uint16_t row);

/** The demand behind a misfit (ht_misfits.def): the text of a rule, "" for an order or an unknown one. */
const char *ht_misfit_demand(uint16_t misfit);

/** Number of parameter sets, and the text of one (ht_sets.def); NULL for an unknown one. */
uint16_t ht_set_count(void);
const char *ht_set_text(uint16_t set);

#endif
