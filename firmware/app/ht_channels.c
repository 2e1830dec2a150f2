#include <math.h>
#include <stddef.h>

#include "ht_drive.h"

enum {
#define HT_CHANNEL(name, unit, expression, help) CHANNEL_##name,
#include "ht_channels.def"
#undef HT_CHANNEL
    CHANNELS
};

static const ht_channel_info table[CHANNELS] = {
#define HT_CHANNEL(name, unit, expression, help) {#name, unit, help},
#include "ht_channels.def"
#undef HT_CHANNEL
};

uint16_t ht_channel_count(void)
{
    return CHANNELS;
}

const ht_channel_info *ht_channel_describe(uint16_t id)
{
    return (id < CHANNELS) ? &table[id] : NULL;
}

static bool controls(const ht_drive *d)
{
    return (ht_state_flags(d->state) & (uint16_t)HT_CONTROLS) != 0u;
}

void ht_channels_read(const ht_drive *d, float *out)
{
    bool control = controls(d);
#define HT_CHANNEL(name, unit, expression, help) out[CHANNEL_##name] = (expression);
#define HT_CONTROL_CHANNEL(name, unit, expression, help) \
    out[CHANNEL_##name] = control ? (expression) : NAN;
#include "ht_channels.def"
#undef HT_CHANNEL
}

float ht_channel_read(const ht_drive *d, uint16_t id)
{
    switch (id) {
#define HT_CHANNEL(name, unit, expression, help) \
    case CHANNEL_##name:                         \
        return (expression);
#define HT_CONTROL_CHANNEL(name, unit, expression, help) \
    case CHANNEL_##name:                                 \
        return controls(d) ? (expression) : NAN;
#include "ht_channels.def"
#undef HT_CHANNEL
    default:
        return 0.0f;
    }
}
