#include "ht_snapshot.h"

#include <string.h>

#include "ht_octets.h"

void ht_snapshot_add(ht_packet *p, const volatile ht_snapshot *s)
{
#define HT_SNAPSHOT_16(member) ht_packet_add16(p, s->member);
#define HT_SNAPSHOT_32(member) ht_packet_add32(p, s->member);
#define HT_SNAPSHOT_FLOAT(member) ht_packet_add_float(p, s->member);
#include "ht_snapshot.def"
#undef HT_SNAPSHOT_16
#undef HT_SNAPSHOT_32
#undef HT_SNAPSHOT_FLOAT
}

void ht_snapshot_take(const uint16_t *octets, ht_snapshot *s)
{
    uint16_t at = 0u;
    (void)memset(s, 0, sizeof *s);
#define HT_SNAPSHOT_16(member)          \
    s->member = ht_get16(&octets[at]);  \
    at += 2u;
#define HT_SNAPSHOT_32(member)          \
    s->member = ht_get32(&octets[at]);  \
    at += 4u;
#define HT_SNAPSHOT_FLOAT(member)                    \
    s->member = ht_float_of(ht_get32(&octets[at]));  \
    at += 4u;
#include "ht_snapshot.def"
#undef HT_SNAPSHOT_16
#undef HT_SNAPSHOT_32
#undef HT_SNAPSHOT_FLOAT
}
