#include "ht_index.h"

/* Counts of a line: an index this wide rises at its other end when the shaft turns back. */
#define LINE_COUNTS 4u
/* 5 degrees */
#define NEAR_PARTS 72u

uint32_t ht_index_near_counts(uint32_t counts_rev, uint16_t pole_pairs)
{
    return LINE_COUNTS + counts_rev / (NEAR_PARTS * (uint32_t)pole_pairs);
}

int32_t ht_index_off_counts(uint32_t counts_rev, uint32_t moved)
{
    int32_t whole = (int32_t)counts_rev;
    int32_t off = (int32_t)moved % whole;
    if (off > (whole / 2)) {
        off -= whole;
    } else if (off < (-whole / 2)) {
        off += whole;
    } else {
        /* the nearest already */
    }
    return off;
}

static void take(const ht_index_config *cfg, ht_index_state *st, uint32_t position)
{
    int32_t most = (int32_t)cfg->near_counts;
    int32_t off = st->seen ? ht_index_off_counts(cfg->counts_rev, position - st->reference) : 0;
    bool agrees = (off <= most) && (off >= -most);
    if (!agrees) {
        off = 0;
    }
    st->newest = position;
    /* It moves on by revolutions only: a small slip in each of them must add up. */
    st->reference = position - (uint32_t)off;
    st->seen = true;
    st->known = agrees;
}

void ht_index_step(const ht_index_config *cfg, ht_index_state *st, uint32_t position,
                   const ht_capture *capture)
{
    uint32_t moved = position - st->newest;
    uint32_t most = cfg->counts_rev + cfg->counts_rev / 8u + cfg->near_counts;
    uint32_t way = ((int32_t)moved < 0) ? (0u - moved) : moved;
    if (!cfg->used) {
        return;
    }
    if (capture->index) {
        take(cfg, st, capture->index_position);
    } else if (way > most) {
        st->known = false;
    } else {
        /* between two */
    }
}
