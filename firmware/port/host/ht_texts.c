#include "ht_texts.h"

#include <stddef.h>

static const ht_event_info events[] = {
#define HT_EVENT(name, number, text, help) {(number), text, help},
#include "ht_events.def"
#undef HT_EVENT
};

static const ht_result_info results[] = {
#define HT_RESULT(name, number, mistake, text) {(number), (mistake) != 0, text},
#define HT_REFUSAL(name, number, mistake, text) {(number), (mistake) != 0, text},
#include "ht_results.def"
#undef HT_RESULT
#undef HT_REFUSAL
};

static const char *const demands[] = {
#define HT_ORDER(id, less, share, more, touch) "",
#define HT_RULE(id, first, second, text) text,
#include "ht_misfits.def"
#undef HT_ORDER
#undef HT_RULE
};

static const char *const sets[] = {
#define HT_SET(name, number, text) text,
#include "ht_sets.def"
#undef HT_SET
};

#define EVENTS ((uint16_t)(sizeof events / sizeof events[0]))
#define RESULTS ((uint16_t)(sizeof results / sizeof results[0]))
#define DEMANDS ((uint16_t)(sizeof demands / sizeof demands[0]))
#define SETS ((uint16_t)(sizeof sets / sizeof sets[0]))

uint16_t ht_event_count(void)
{
    return EVENTS;
}

const ht_event_info *ht_event_describe(uint16_t row)
{
    return (row < EVENTS) ? &events[row] : NULL;
}

uint16_t ht_result_count(void)
{
    return RESULTS;
}

const ht_result_info *ht_result_describe(uint16_t row)
{
    return (row < RESULTS) ? &results[row] : NULL;
}

const char *ht_misfit_demand(uint16_t misfit)
{
    return ((misfit > 0u) && (misfit <= DEMANDS)) ? demands[misfit - 1u] : "";
}

uint16_t ht_set_count(void)
{
    return SETS;
}

const char *ht_set_text(uint16_t set)
{
    return (set < SETS) ? sets[set] : NULL;
}
