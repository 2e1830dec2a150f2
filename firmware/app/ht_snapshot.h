/** @file ht_snapshot.h
 *  The fault snapshot as bytes of a reply, and back: SNAPSHOT of the link (docs/protocol.md)
 *  and of processor in the loop (docs/pil.md).
 */
#ifndef HT_SNAPSHOT_H
#define HT_SNAPSHOT_H

#include "ht_drive.h"
#include "ht_packet.h"

/** Bytes of a snapshot. */
enum {
    HT_SNAPSHOT_BYTES = 0
#define HT_SNAPSHOT_16(member) +2
#define HT_SNAPSHOT_32(member) +4
#define HT_SNAPSHOT_FLOAT(member) +4
#define HT_SNAPSHOT_FAULTS(member) +2
#include "ht_snapshot.def"
#undef HT_SNAPSHOT_16
#undef HT_SNAPSHOT_32
#undef HT_SNAPSHOT_FLOAT
#undef HT_SNAPSHOT_FAULTS
};

/** Append a snapshot to a body. */
void ht_snapshot_add(ht_packet *p, const volatile ht_snapshot *s);

/** Read HT_SNAPSHOT_BYTES bytes; members that are not transmitted become 0. On the host only. */
void ht_snapshot_take(const uint16_t *octets, ht_snapshot *s);

#endif
