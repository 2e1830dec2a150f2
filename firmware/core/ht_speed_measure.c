#include "ht_speed_measure.h"

/* Largest difference between the two measurements, counts. Edges per time gives the mean speed
 * of the slow period within one count. Time per edge may have been measured long ago: a speed
 * loop that relied on such an old value would oscillate. */
#define SLACK_COUNTS 1.0f
/* So many counts between two looks contain two unit events, wherever the looks fall. */
#define TWO_EVENTS_COUNTS (3 * HT_CAPTURE_COUNTS)

void ht_speed_measure_reset(ht_speed_measure_state *st)
{
    st->unusable_events = 2u;
}

/* Is the captured period the time of HT_CAPTURE_COUNTS edges in one direction? After a
 * reversal or an overflow it is not: the interval that is running ends with the first unit event
 * after this look, and only the second event ends an interval that can be used. */
static bool sound(ht_speed_measure_state *st, int32_t moved, const ht_capture *capture)
{
    bool against = capture->forward ? (moved < 0) : (moved > 0);
    if (capture->overflow || capture->reversed || against) {
        st->unusable_events = 2u;
    } else if (capture->event && (st->unusable_events > 0u)) {
        bool two = (moved >= TWO_EVENTS_COUNTS) || (moved <= -TWO_EVENTS_COUNTS);
        st->unusable_events = two ? 0u : (uint16_t)(st->unusable_events - 1u);
    } else {
        /* as it was */
    }
    return st->unusable_events == 0u;
}

float ht_speed_measure_step(const ht_speed_measure_config *cfg, ht_speed_measure_state *st,
                            int32_t moved, const ht_capture *capture)
{
    bool usable = sound(st, moved, capture);
    float counted = (float)moved * cfg->rpm_per_count;
    float size = (counted < 0.0f) ? -counted : counted;
    float slack = SLACK_COUNTS * cfg->rpm_per_count;
    /* Once the time since the last event is the longer one, it bounds the speed. */
    uint16_t ticks = (capture->age_ticks > capture->period_ticks) ? capture->age_ticks
                                                                  : capture->period_ticks;
    float timed;
    float share;
    if (!usable || (ticks == 0u) || !(size < 1.25f * cfg->period_rpm)) {
        return counted;
    }
    timed = cfg->rpm_ticks / (float)ticks;
    timed = capture->forward ? timed : -timed;
    timed = (timed > counted + slack) ? (counted + slack) : timed;
    timed = (timed < counted - slack) ? (counted - slack) : timed;
    share = 4.0f * (size / cfg->period_rpm - 1.0f); /* of edges per time */
    return (share > 0.0f) ? (timed + share * (counted - timed)) : timed;
}
