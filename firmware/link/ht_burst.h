/** @file ht_burst.h
 *  Captures channels into memory at the rate of the fast interrupt, with samples from before the
 *  trigger. The fast interrupt writes the samples. The background arms, computes the CRC and
 *  reads.
 */
#ifndef HT_BURST_H
#define HT_BURST_H

#include "ht_streams.h"

#define HT_BURST_CHANNELS 16u

/** ht_burst.state */
enum {
    HT_BURST_NONE = 0,
    HT_BURST_FILLING = 1, /**< the samples before the trigger */
    HT_BURST_WAITING = 2,
    HT_BURST_TRIGGERED = 3, /**< the samples after it */
    HT_BURST_SUMMING = 4,   /**< complete but for the CRC */
    HT_BURST_COMPLETE = 5
};

/** ht_burst_setup.trigger */
enum {
    HT_TRIGGER_MANUAL = 0,
    HT_TRIGGER_RISING = 1, /**< was not above the level, is above */
    HT_TRIGGER_FALLING = 2,
    HT_TRIGGER_ABOVE = 3,
    HT_TRIGGER_BELOW = 4,
    HT_TRIGGER_FAULT = 5,
    HT_TRIGGER_COMMAND = 6,
    HT_TRIGGERS = 7
};

/** The first member of a set-up that is out of bounds. */
typedef enum {
    HT_BURST_ARMED = 0, /**< none is */
    HT_BURST_BAD_N = 1,
    HT_BURST_BAD_TRIGGER = 2,
    HT_BURST_BAD_PRESCALER = 3,
    HT_BURST_BAD_SAMPLES = 4, /**< there are none */
    HT_BURST_BAD_BEFORE = 5,
    HT_BURST_BAD_LEVEL = 6, /**< NaN */
    HT_BURST_TOO_LARGE = 7  /**< more samples than the memory holds */
} ht_burst_answer;

/** The settings of a capture. */
typedef struct {
    uint16_t n;         /**< channels, 1 .. HT_BURST_CHANNELS */
    uint16_t trigger;   /**< HT_TRIGGER_... */
    uint16_t prescaler; /**< fast interrupts per sample, from 1 */
    uint32_t samples;   /**< samples * n values must fit the memory */
    uint32_t before;    /**< of these before the trigger, < samples */
    uint16_t channel;   /**< of the trigger */
    float level;
    uint16_t id[HT_BURST_CHANNELS];
} ht_burst_setup;

/** State of a capture. What the interrupt works with is volatile: it must be written before
 *  `state` is. */
typedef struct {
    volatile uint16_t state;   /**< HT_BURST_... */
    volatile uint16_t manual;  /**< the background's trigger */
    volatile uint16_t command; /**< a command was carried out */
    uint16_t number;           /**< of the capture, modulo 256 */
    volatile ht_burst_setup setup;
    volatile uint16_t left; /**< fast interrupts until the next sample */
    volatile bool below;    /**< the trigger's channel was not above the level ... */
    volatile bool above;    /**< ... not below it */
    volatile uint32_t at;   /**< next value to write: the oldest, once complete */
    volatile uint32_t rows; /**< still to come, in FILLING and TRIGGERED */
    volatile uint32_t tick; /**< of the trigger */
    uint32_t crc;
    uint32_t summed; /**< values that the CRC covers so far */
    uint32_t *memory;
    uint32_t size; /**< values */
} ht_burst;

void ht_burst_init(ht_burst *b, uint32_t *memory, uint32_t size);

/** Background: begin a capture. With any answer but HT_BURST_ARMED nothing has changed. */
ht_burst_answer ht_burst_arm(ht_burst *b, const ht_burst_setup *setup);
void ht_burst_cancel(ht_burst *b);
/** Background: add some more values to the CRC. */
void ht_burst_sum(ht_burst *b);
/** Values of a capture. */
uint32_t ht_burst_values(const ht_burst *b);
/** Value `index`, the oldest first, of a complete capture. */
uint32_t ht_burst_value(const ht_burst *b, uint32_t index);

/** Fast interrupt: take a sample if one is due. `fault`: a fault is latched. */
void ht_burst_sample(ht_burst *b, const ht_source *source, uint32_t tick, bool fault);

#endif
