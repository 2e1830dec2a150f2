/* Apart from `ht_snapshot_add`: no target reads a snapshot. */
#include "ht_snapshot.h"

#include <string.h>

#include "ht_octets.h"

void ht_snapshot_take(const uint16_t *octets, ht_snapshot *s)
{
    uint16_t at = 0u;
    (void)memset(s, 0, sizeof *s);
#define HT_SNAPSHOT_16(member)         \
    s->member = ht_get16(&octets[at]); \
    at += 2u;
#define HT_SNAPSHOT_32(member)         \
    s->member = ht_get32(&octets[at]); \
    at += 4u;
#define HT_SNAPSHOT_FLOAT(member)                   \
    s->member = ht_float_of(ht_get32(&octets[at])); \
    at += 4u;
#define HT_SNAPSHOT_FAULTS(member) HT_SNAPSHOT_16(member)
#include "ht_snapshot.def"
#undef HT_SNAPSHOT_16
#undef HT_SNAPSHOT_32
#undef HT_SNAPSHOT_FLOAT
#undef HT_SNAPSHOT_FAULTS
}
