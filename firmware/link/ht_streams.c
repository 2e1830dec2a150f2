#include "ht_streams.h"

#include "ht_octets.h"

#define MASK (HT_STREAM_RING - 1u)
#define HEAD_VALUES 2u /* of a sample: stream, number and channels; tick */
#define NOBODY 0xFFu   /* stream of a sample that nobody waits for any more */

void ht_streams_reset(ht_streams *s)
{
    uint16_t k;
    for (k = 0u; k < HT_STREAMS; k++) {
        s->stream[k].active = 0u;
        s->stream[k].n = 0u;
        s->stream[k].decimation = 1u;
    }
    s->tail = s->head; /* the reader's own end */
}

/* Samples of stream `k` that are still in the ring: as it was, so they would be taken for
 * what it will be. The interrupt only adds behind them. */
static void forget(ht_streams *s, uint16_t k)
{
    uint16_t at = s->tail;
    while (at != s->head) {
        uint32_t head = s->ring[at];
        uint16_t n = (uint16_t)((head >> 8) & HT_OCTET);
        if ((head & HT_OCTET) == k) {
            s->ring[at] = head | NOBODY;
        }
        at = (uint16_t)((at + HEAD_VALUES + n) & MASK);
    }
}

void ht_streams_set(ht_streams *s, uint16_t k, const uint16_t *id, uint16_t n, uint16_t decimation)
{
    ht_stream *stream = &s->stream[k];
    uint16_t i;
    stream->active = 0u; /* first: the interrupt must not see a mixture */
    forget(s, k);
    for (i = 0u; i < n; i++) {
        stream->id[i] = id[i];
    }
    stream->n = n;
    stream->decimation = decimation;
    stream->left = 1u;
    stream->number = 0u;
}

void ht_streams_begin(ht_streams *s, uint16_t k)
{
    if (s->stream[k].n != 0u) {
        s->stream[k].active = 1u; /* last: the rest is ready */
    }
}

bool ht_streams_any(const ht_streams *s)
{
    uint16_t k;
    for (k = 0u; k < HT_STREAMS; k++) {
        if (s->stream[k].active != 0u) {
            return true;
        }
    }
    return false;
}

static void put(ht_streams *s, const ht_stream *stream, uint16_t k, const ht_source *source,
                uint32_t tick)
{
    uint16_t at = s->head;
    uint16_t room = (uint16_t)((s->tail - at - 1u) & MASK);
    uint16_t i;
    if (room < (uint16_t)(stream->n + HEAD_VALUES)) {
        s->dropped++;
        return;
    }
    s->ring[at] = k | ((uint32_t)stream->n << 8) | ((uint32_t)stream->number << 16);
    at = (uint16_t)((at + 1u) & MASK);
    s->ring[at] = tick;
    at = (uint16_t)((at + 1u) & MASK);
    for (i = 0u; i < stream->n; i++) {
        s->ring[at] = ht_float_bits(source->read(source->object, stream->id[i]));
        at = (uint16_t)((at + 1u) & MASK);
    }
    s->head = at; /* last: now it is there */
}

void ht_streams_sample(ht_streams *s, const ht_source *source, uint32_t tick)
{
    uint16_t k;
    for (k = 0u; k < HT_STREAMS; k++) {
        ht_stream *stream = &s->stream[k];
        if (stream->active != 0u) {
            stream->left--;
            if (stream->left == 0u) {
                stream->left = stream->decimation;
                put(s, stream, k, source, tick);
                stream->number = (uint16_t)((stream->number + 1u) & HT_OCTET);
            }
        }
    }
}

bool ht_streams_next(ht_streams *s, ht_stream_sample *out)
{
    while (s->tail != s->head) {
        uint16_t at = s->tail;
        uint32_t head = s->ring[at];
        uint16_t i;
        at = (uint16_t)((at + 1u) & MASK);
        out->stream = (uint16_t)(head & HT_OCTET);
        out->n = (uint16_t)((head >> 8) & HT_OCTET);
        out->number = (uint16_t)(head >> 16);
        out->tick = s->ring[at];
        at = (uint16_t)((at + 1u) & MASK);
        for (i = 0u; i < out->n; i++) {
            out->value[i] = s->ring[at];
            at = (uint16_t)((at + 1u) & MASK);
        }
        s->tail = at;
        if (out->stream != NOBODY) {
            return true;
        }
    }
    return false;
}
