/** @file ht_streams.h
 *  Sample streams. The fast interrupt puts every n-th sample of chosen channels into a ring, and
 *  the background takes them out. There is one writer and one reader, so no lock is needed.
 */
#ifndef HT_STREAMS_H
#define HT_STREAMS_H

#include <stdbool.h>
#include <stdint.h>

#define HT_STREAMS 4u
#define HT_STREAM_CHANNELS 32u
#define HT_STREAM_RING 1024u /* values; a power of two */

/** The source of samples: channel `id` of `object`, now. */
typedef struct {
    float (*read)(const void *object, uint16_t id);
    const void *object;
} ht_source;

/** One stream. All of it is volatile, like the ring, because the order of writes matters: the rest
 *  before `active` is set, a sample before `head` moves. A compiler keeps the order of volatile
 *  accesses only. */
typedef struct {
    volatile uint16_t active; /**< the interrupt uses the other members only if set */
    volatile uint16_t n;
    volatile uint16_t decimation;
    volatile uint16_t left;   /**< fast interrupts until the next sample */
    volatile uint16_t number; /**< of the next sample, modulo 256 */
    volatile uint16_t id[HT_STREAM_CHANNELS];
} ht_stream;

typedef struct {
    ht_stream stream[HT_STREAMS];
    volatile uint16_t head;    /**< next value to write */
    volatile uint16_t tail;    /**< next value to read */
    volatile uint32_t dropped; /**< samples that found no room */
    volatile uint32_t ring[HT_STREAM_RING];
} ht_streams;

/** A sample as it was taken. */
typedef struct {
    uint16_t stream;
    uint16_t number;
    uint16_t n;
    uint32_t tick;
    uint32_t value[HT_STREAM_CHANNELS]; /**< bits of floats */
} ht_stream_sample;

void ht_streams_reset(ht_streams *s);

/** Background: end stream `k` and set it up anew: `n` channels, up to HT_STREAM_CHANNELS (0: none),
 *  `decimation` from 1. After this call no sample of the former stream comes out any more. */
void ht_streams_set(ht_streams *s, uint16_t k, const uint16_t *id, uint16_t n, uint16_t decimation);
/** Background: begin stream `k` as it was set. The next fast interrupt takes the first sample. */
void ht_streams_begin(ht_streams *s, uint16_t k);
bool ht_streams_any(const ht_streams *s);

/** Fast interrupt: take the samples that are due. */
void ht_streams_sample(ht_streams *s, const ht_source *source, uint32_t tick);

/** Background: the oldest sample. False if there is none. */
bool ht_streams_next(ht_streams *s, ht_stream_sample *out);

#endif
