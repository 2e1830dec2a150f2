#include "ht_burst_rows.h"

static float channel_of_row(const void *object, uint16_t id)
{
    return ((const float *)object)[id];
}

void ht_burst_rows(ht_burst *b, const float *rows, uint32_t n, uint16_t width, uint32_t tick,
                   uint16_t fault)
{
    ht_source source = {channel_of_row, rows};
    uint32_t k;
    for (k = 0u; k < n; k++) {
        const float *row = &rows[k * width];
        source.object = row;
        ht_burst_sample(b, &source, tick + k, row[fault] != 0.0f);
    }
}
