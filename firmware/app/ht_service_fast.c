/* The part of the link that runs in the fast interrupt: watchdog, samples. */
#include "ht_service.h"

static float read_channel(const void *object, uint16_t id)
{
    return ht_channel_read((const ht_drive *)object, id);
}

static void watch(ht_service *l)
{
    uint16_t state = l->drive->state;
    if ((state == (uint16_t)HT_STATE_IDLE) || (state == (uint16_t)HT_STATE_FAULT)) {
        l->armed = 0u;
    } else if (l->fed != 0u) {
        l->fed = 0u;
        l->watchdog_left = l->watchdog_ticks;
    } else {
        l->watchdog_left--;
        if (l->watchdog_left == 0u) {
            l->armed = 0u;
            ht_drive_trip(l->drive, HT_FAULT_LINK);
        }
    }
}

void ht_service_fast(ht_service *l)
{
    ht_source source;
    if (l->armed != 0u) {
        watch(l);
    }
    source.read = read_channel;
    source.object = l->drive;
    ht_streams_sample(&l->streams, &source, l->drive->tick);
    ht_burst_sample(&l->burst, &source, l->drive->tick, l->drive->faults != 0u);
}
