#include "ht_snapshot.h"

void ht_snapshot_add(ht_packet *p, const volatile ht_snapshot *s)
{
#define HT_SNAPSHOT_16(member) ht_packet_add16(p, s->member);
#define HT_SNAPSHOT_32(member) ht_packet_add32(p, s->member);
#define HT_SNAPSHOT_FLOAT(member) ht_packet_add_float(p, s->member);
#define HT_SNAPSHOT_FAULTS(member) ht_packet_add16(p, HT_LOW_FAULTS(s->member));
#include "ht_snapshot.def"
#undef HT_SNAPSHOT_16
#undef HT_SNAPSHOT_32
#undef HT_SNAPSHOT_FLOAT
#undef HT_SNAPSHOT_FAULTS
}
