/** @file ht_packet.h
 *  Bodies on the line (docs/protocol.md, "Frames"): COBS with CRC-32 both ways. An octet
 *  lies in a 16-bit cell. Nothing here blocks or grows.
 */
#ifndef HT_PACKET_H
#define HT_PACKET_H

#include <stdbool.h>
#include <stdint.h>

#define HT_PACKET_BODY 508u /**< octets of a body at most */
#define HT_PACKET_SHORTEST 2u
#define HT_PACKET_CRC 4u
/** On the line at most: body, CRC, an octet of COBS for every 254, the closing zero. */
#define HT_PACKET_LINE (HT_PACKET_BODY + HT_PACKET_CRC + 3u + 1u)

/** A body that is being made. What does not fit any more sets `full`. */
typedef struct {
    uint16_t n;
    bool full;
    uint16_t octet[HT_PACKET_BODY + HT_PACKET_CRC];
} ht_packet;

void ht_packet_begin(ht_packet *p);
void ht_packet_add8(ht_packet *p, uint16_t value);
void ht_packet_add16(ht_packet *p, uint16_t value);
void ht_packet_add32(ht_packet *p, uint32_t value);
void ht_packet_add_float(ht_packet *p, float value);
/** With its closing zero. */
void ht_packet_add_text(ht_packet *p, const char *text);

/** A frame on its way out. */
typedef struct {
    uint16_t n;
    uint16_t sent;
    uint16_t octet[HT_PACKET_LINE];
} ht_outgoing;

/** Close the body with its CRC and make the frame; the body's `n` stays. */
void ht_outgoing_set(ht_outgoing *out, ht_packet *p);

/** A frame on its way in. */
typedef struct {
    uint16_t n;     /**< octets decoded */
    uint16_t left;  /**< of the present COBS block */
    bool zero;      /**< the next block is preceded by a zero */
    bool begun;     /**< not between two frames */
    bool bad;       /**< to be dropped */
    uint16_t octet[HT_PACKET_BODY + HT_PACKET_CRC];
} ht_incoming;

typedef enum {
    HT_INCOMING_PART = 0,  /**< more to come */
    HT_INCOMING_WHOLE = 1, /**< a body: `octet[0 .. n - 1]`, until the next octet */
    HT_INCOMING_DAMAGED = 2
} ht_incoming_status;

void ht_incoming_reset(ht_incoming *in);
/** The receiver has lost something: what is under way will not do. */
void ht_incoming_discard(ht_incoming *in);
ht_incoming_status ht_incoming_take(ht_incoming *in, uint16_t cell);

#endif
