/** @file ht_packet.h
 *  Frames on the line (docs/protocol.md, "Frames"): a body and its CRC-32, encoded by COBS, in
 *  both directions. A cell of 16 bits holds one octet (ht_octets.h). Nothing here waits or
 *  allocates memory.
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

/** A body that is being made. `full` is set when something did not fit. */
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
    uint16_t n;    /**< octets decoded */
    uint16_t left; /**< of the present COBS block */
    bool zero;     /**< the next block is preceded by a zero */
    bool begun;    /**< not between two frames */
    bool bad;      /**< to be dropped */
    uint16_t octet[HT_PACKET_BODY + HT_PACKET_CRC];
} ht_incoming;

typedef enum {
    HT_INCOMING_PART = 0,  /**< more to come */
    HT_INCOMING_WHOLE = 1, /**< a body: `octet[0 .. n - 1]`, until the next octet */
    HT_INCOMING_DAMAGED = 2
} ht_incoming_status;

void ht_incoming_reset(ht_incoming *in);
/** The receiver has lost something: drop the frame that is being received. */
void ht_incoming_discard(ht_incoming *in);
ht_incoming_status ht_incoming_take(ht_incoming *in, uint16_t cell);

#endif
