/* The part of XCP that runs in the fast interrupt: the clock, samples. */
#include "ht_xcp_commands.h"

float ht_xcp_value(const void *object, uint16_t id)
{
    const ht_drive *d = (const ht_drive *)object;
    if ((id & HT_XCP_PARAMETER) != 0u) {
        return ht_drive_get(d, (uint16_t)(id & ~HT_XCP_PARAMETER));
    }
    return ht_channel_read(d, id);
}

void ht_xcp_fast(ht_xcp *x)
{
    const ht_drive *d = x->service->drive;
    bool slow = d->tick_last != x->slow_tick;
    ht_source source;
    uint32_t whole;
    x->slow_tick = d->tick_last;
    x->time_part += (float)d->config->control.period.counts * x->us_per_count;
    whole = (uint32_t)x->time_part;
    x->time += whole;
    x->time_part -= (float)whole;
    source.read = ht_xcp_value;
    source.object = d;
    ht_xcp_daq_sample(&x->daq, &source, x->time, slow);
}
