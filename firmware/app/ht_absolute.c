#include "ht_absolute.h"

#include "ht_index.h"

/* A shaft that moves no further in a slow period stands, whatever its encoder flickers. */
#define STANDS_COUNTS 4
#define DOUBTS 3u
/* Two readings of the same place: each is within a step, and may flicker by one. */
#define STEPS_APART 2.0f
#define LEAST_PER_PAIR 72.0f

float ht_absolute_least(float pole_pairs)
{
    return LEAST_PER_PAIR * pole_pairs;
}

void ht_absolute_configure(ht_absolute_config *cfg, uint32_t counts_rev, float readings,
                           bool reversed, uint16_t pole_pairs)
{
    float step = (float)counts_rev / readings;
    float apart = STEPS_APART * step;
    cfg->counts_rev = counts_rev;
    cfg->readings = (uint32_t)readings;
    cfg->counts_per_reading = reversed ? -step : step;
    cfg->near_counts = ht_index_near_counts(counts_rev, pole_pairs) + (uint32_t)apart;
}

void ht_absolute_step(const ht_absolute_config *cfg, ht_absolute_state *st, uint32_t position,
                      int32_t moved, uint32_t reading)
{
    int32_t way = (moved < 0) ? -moved : moved;
    bool valid = reading < cfg->readings;
    bool stands = way <= STANDS_COUNTS;
    float shown = valid ? (((float)reading + 0.5f) * cfg->counts_per_reading) : 0.0f;
    int32_t from_zero = (int32_t)shown;
    uint32_t zero = position - (uint32_t)from_zero;
    int32_t off = ht_index_off_counts(cfg->counts_rev, zero - st->reference);
    int32_t most = (int32_t)cfg->near_counts + way;
    if (valid && st->seen && (off <= most) && (off >= -most)) {
        st->doubts = 0u;
        st->reference = zero - (uint32_t)off;
        st->known = st->known || stands;
    } else if (st->known && (st->doubts < (DOUBTS - 1u))) {
        st->doubts++;
    } else {
        st->known = false;
        st->doubts = 0u;
        st->seen = valid && stands;
        st->reference = zero;
    }
}
