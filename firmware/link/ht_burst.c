#include "ht_burst.h"

#include "ht_octets.h"

#define SUM_AT_ONCE 16u

void ht_burst_init(ht_burst *b, uint32_t *memory, uint32_t size)
{
    b->state = (uint16_t)HT_BURST_NONE;
    b->manual = 0u;
    b->command = 0u;
    b->number = 0u;
    b->setup.n = 0u;
    b->setup.prescaler = 0u;
    b->setup.samples = 0u;
    b->setup.before = 0u;
    b->tick = 0u;
    b->crc = 0u;
    b->memory = memory;
    b->size = size;
}

static ht_burst_answer judge(const ht_burst *b, const ht_burst_setup *setup)
{
    if ((setup->n == 0u) || (setup->n > HT_BURST_CHANNELS)) {
        return HT_BURST_BAD_N;
    }
    if (setup->trigger >= (uint16_t)HT_TRIGGERS) {
        return HT_BURST_BAD_TRIGGER;
    }
    if (setup->prescaler == 0u) {
        return HT_BURST_BAD_PRESCALER;
    }
    if (setup->samples == 0u) {
        return HT_BURST_BAD_SAMPLES;
    }
    if (setup->before >= setup->samples) {
        return HT_BURST_BAD_BEFORE;
    }
    if (!(setup->level == setup->level)) {
        return HT_BURST_BAD_LEVEL;
    }
    return (setup->samples > (b->size / setup->n)) ? HT_BURST_TOO_LARGE : HT_BURST_ARMED;
}

ht_burst_answer ht_burst_arm(ht_burst *b, const ht_burst_setup *setup)
{
    ht_burst_answer answer = judge(b, setup);
    if (answer != HT_BURST_ARMED) {
        return answer;
    }
    b->state = (uint16_t)HT_BURST_NONE; /* first: the interrupt leaves it alone from here on */
    b->setup = *setup;
    b->number = (uint16_t)((b->number + 1u) & HT_OCTET);
    b->manual = 0u;
    b->command = 0u;
    b->left = 1u;
    b->below = false;
    b->above = false;
    b->at = 0u;
    b->rows = setup->before;
    b->tick = 0u;
    b->crc = 0u;
    b->summed = 0u;
    b->state = (uint16_t)((setup->before == 0u) ? HT_BURST_WAITING : HT_BURST_FILLING);
    return HT_BURST_ARMED;
}

void ht_burst_cancel(ht_burst *b)
{
    b->state = (uint16_t)HT_BURST_NONE;
}

uint32_t ht_burst_values(const ht_burst *b)
{
    return b->setup.samples * b->setup.n;
}

uint32_t ht_burst_value(const ht_burst *b, uint32_t index)
{
    uint32_t to_end = ht_burst_values(b) - b->at;
    return b->memory[(index < to_end) ? (b->at + index) : (index - to_end)];
}

void ht_burst_sum(ht_burst *b)
{
    uint16_t k;
    if (b->state != (uint16_t)HT_BURST_SUMMING) {
        return;
    }
    for (k = 0u; (k < SUM_AT_ONCE) && (b->summed < ht_burst_values(b)); k++) {
        uint32_t value = ht_burst_value(b, b->summed);
        b->crc = ht_crc32_values(b->crc, &value, 1u);
        b->summed++;
    }
    if (b->summed >= ht_burst_values(b)) {
        b->state = (uint16_t)HT_BURST_COMPLETE;
    }
}

static void store(ht_burst *b, const ht_source *source)
{
    uint16_t k;
    for (k = 0u; k < b->setup.n; k++) {
        b->memory[b->at + k] = ht_float_bits(source->read(source->object, b->setup.id[k]));
    }
    b->at += b->setup.n;
    if (b->at >= ht_burst_values(b)) {
        b->at = 0u;
    }
}

/* Looks at every sample, so that an edge is one between two samples. A NaN is neither
 * above nor below: it makes no edge. */
static bool triggered(ht_burst *b, const ht_source *source, bool fault)
{
    uint16_t kind = b->setup.trigger;
    float level = b->setup.level;
    bool was_below = b->below;
    bool was_above = b->above;
    float value;
    if (kind == (uint16_t)HT_TRIGGER_FAULT) {
        b->below = !fault;
        return was_below && fault;
    }
    if (kind == (uint16_t)HT_TRIGGER_COMMAND) {
        return b->command != 0u;
    }
    if (kind == (uint16_t)HT_TRIGGER_MANUAL) {
        return false;
    }
    value = source->read(source->object, b->setup.channel);
    b->below = value <= level;
    b->above = value >= level;
    switch (kind) {
    case HT_TRIGGER_RISING:
        return was_below && (value > level);
    case HT_TRIGGER_FALLING:
        return was_above && (value < level);
    case HT_TRIGGER_ABOVE:
        return value > level;
    case HT_TRIGGER_BELOW:
    default:
        return value < level;
    }
}

void ht_burst_sample(ht_burst *b, const ht_source *source, uint32_t tick, bool fault)
{
    uint16_t state = b->state;
    bool now;
    if ((state < (uint16_t)HT_BURST_FILLING) || (state > (uint16_t)HT_BURST_TRIGGERED)) {
        return;
    }
    b->left--;
    if (b->left != 0u) {
        return;
    }
    b->left = b->setup.prescaler;
    store(b, source);
    now = triggered(b, source, fault) || (b->manual != 0u);
    b->command = 0u;
    if (state != (uint16_t)HT_BURST_WAITING) {
        b->rows--;
        if (b->rows == 0u) {
            state++; /* FILLING to WAITING, TRIGGERED to SUMMING */
        }
    } else if (now) {
        b->tick = tick;
        b->rows = b->setup.samples - b->setup.before - 1u;
        state = (uint16_t)((b->rows != 0u) ? HT_BURST_TRIGGERED : HT_BURST_SUMMING);
    } else {
        /* goes on waiting */
    }
    b->state = state;
}
