#include "ht_pil.h"

#include <stddef.h>
#include <string.h>

#include "ht_pil_snapshot.h"

static uint32_t sum_text(uint32_t sum, const char *text)
{
    uint32_t total = sum;
    uint16_t i;
    for (i = 0u; text[i] != '\0'; i++) {
        uint16_t word = (uint16_t)text[i];
        total = ht_fletcher(total, &word, 1u);
    }
    return total;
}

void ht_pil_identity(uint16_t *words)
{
    uint32_t sum = 0u;
    uint16_t i;
    for (i = 0u; i < ht_param_count(); i++) {
        sum = sum_text(sum, ht_param_describe(i)->name);
    }
    for (i = 0u; i < ht_channel_count(); i++) {
        sum = sum_text(sum, ht_channel_describe(i)->name);
    }
    words[0] = HT_PIL_VERSION;
    words[1] = ht_param_count();
    words[2] = ht_channel_count();
    words[3] = ht_side_registers();
    words[4] = (uint16_t)(sum & 0xFFFFu);
    words[5] = (uint16_t)(sum >> 16);
}

void ht_pil_reset(ht_pil *p)
{
    p->ready = false;
    p->image.begin = NULL;
    p->image.fast = NULL;
    p->image.at = NULL;
}

/* Words of INIT up to what the port wants to know. */
#define INIT_WORDS (1u + 2u * (uint16_t)HT_PARAMS)

static uint16_t init(ht_pil *p, const uint16_t *payload, uint16_t words)
{
    ht_params params;
    ht_result result;
    uint16_t id;
    p->ready = false;
    (void)memset(&p->drive, 0, sizeof p->drive); /* as after a reset */
    (void)memset(&p->port, 0, sizeof p->port);
    if ((words < INIT_WORDS)
        || !ht_side_init(&p->side, &p->port, payload[0], &payload[INIT_WORDS],
                         (uint16_t)(words - INIT_WORDS))) {
        return HT_PIL_REFUSED;
    }
    for (id = 0u; id < HT_PARAMS; id++) {
        params.v[id] = ht_frame_float(&payload[1u + 2u * id]);
    }
    result = ht_drive_init(&p->drive, &p->port, &params);
    p->ready = result == HT_OK;
    if (p->ready && (p->image.begin != NULL)) {
        p->image.begin(p->image.at, &p->drive);
    }
    return (uint16_t)result;
}

static void fast(ht_pil *p)
{
    if (p->image.fast != NULL) {
        p->image.fast(p->image.at);
    } else {
        ht_drive_fast_isr(&p->drive);
    }
}

static uint16_t carry_out(ht_pil *p, uint16_t type, const uint16_t *payload, uint16_t words)
{
    uint16_t argument;
    if (!p->ready || (words < (uint16_t)HT_PIL_HARDWARE)
        || !ht_side_take(&p->side, &p->port, &payload[HT_PIL_HARDWARE],
                         (uint16_t)(words - HT_PIL_HARDWARE))) {
        return HT_PIL_REFUSED;
    }
    argument = payload[HT_PIL_ARGUMENT];
    switch (type) {
    case HT_PIL_STEP:
        if ((argument & (uint16_t)HT_PIL_FAST) != 0u) {
            fast(p);
        }
        if ((argument & (uint16_t)HT_PIL_SLOW) != 0u) {
            ht_drive_slow_isr(&p->drive);
        }
        return HT_OK;
    case HT_PIL_START:
        return (uint16_t)ht_drive_start(&p->drive);
    case HT_PIL_STOP:
        ht_drive_stop(&p->drive);
        return HT_OK;
    case HT_PIL_CLEAR:
        return (uint16_t)ht_drive_clear(&p->drive);
    case HT_PIL_SET:
        return (uint16_t)ht_drive_set(&p->drive, argument, ht_frame_float(&payload[HT_PIL_VALUE]));
    case HT_PIL_GET:
        return (argument < (uint16_t)HT_PARAMS) ? (uint16_t)HT_OK : (uint16_t)HT_ERROR_ID;
    default:
        return HT_PIL_REFUSED;
    }
}

/* Everything the host may want to know after a request. */
static void report(ht_pil *p, float value, ht_frame *reply)
{
    float channels[HT_PIL_CHANNELS];
    uint16_t i;
    ht_frame_add(reply, p->drive.state);
    ht_frame_add(reply, p->drive.faults);
    ht_frame_add(reply, ht_channel_count());
    ht_frame_add_float(reply, value);
    ht_side_status(&p->side, &p->port, reply);
    ht_channels_read(&p->drive, channels);
    for (i = 0u; i < ht_channel_count(); i++) {
        ht_frame_add_float(reply, channels[i]);
    }
    ht_side_tell(&p->side, &p->port, reply);
}

uint16_t ht_pil_answer(ht_pil *p, const ht_frame *request, ht_frame *reply)
{
    uint16_t type = ht_frame_type(request);
    uint16_t words = ht_frame_length(request);
    const uint16_t *payload = ht_frame_payload(request);
    uint16_t result;
    ht_frame_begin(reply, (uint16_t)(type | (uint16_t)HT_PIL_REPLY), ht_frame_number(request));
    if (type == (uint16_t)HT_PIL_HELLO) {
        uint16_t identity[HT_PIL_IDENTITY];
        uint16_t i;
        ht_pil_identity(identity);
        for (i = 0u; i < HT_PIL_IDENTITY; i++) {
            ht_frame_add(reply, identity[i]);
        }
        return ht_frame_end(reply);
    }
    if (type == (uint16_t)HT_PIL_SNAPSHOT) {
        ht_frame_add(reply, p->ready ? (uint16_t)HT_OK : (uint16_t)HT_PIL_REFUSED);
        if (p->ready) {
            ht_pil_snapshot_add(reply, &p->drive.snapshot);
        }
        return ht_frame_end(reply);
    }
    result = (type == (uint16_t)HT_PIL_INIT) ? init(p, payload, words)
                                             : carry_out(p, type, payload, words);
    ht_frame_add(reply, result);
    if (p->ready) {
        float value = 0.0f;
        if ((type == (uint16_t)HT_PIL_GET) && (result == (uint16_t)HT_OK)) {
            value = ht_drive_get(&p->drive, payload[HT_PIL_ARGUMENT]);
        }
        report(p, value, reply);
    }
    return ht_frame_end(reply);
}

uint16_t ht_pil_complain(ht_frame *reply)
{
    ht_frame_begin(reply, HT_PIL_BROKEN, 0u);
    return ht_frame_end(reply);
}
