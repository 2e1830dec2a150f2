/** @file ht_xcp_frames.h
 *  XCP packets on a line: length and counter of the packet, two octets each, low octet first, then
 *  the packet. On TCP and UDP that is all. On a serial line (SxI: HEADER_LEN_CTR_WORD,
 *  CHECKSUM_WORD) the frame is filled up with a zero to an even length, and the sum of its words
 *  modulo 2^16 follows. A cell of 16 bits holds one octet (ht_octets.h).
 */
#ifndef HT_XCP_FRAMES_H
#define HT_XCP_FRAMES_H

#include <stdbool.h>
#include <stdint.h>

#define HT_XCP_CTO 64u  /**< octets of a command or an answer at most */
#define HT_XCP_DTO 133u /**< octets of a packet with measured values at most */
#define HT_XCP_HEAD 4u
#define HT_XCP_TAIL 3u /**< a zero that fills up, the sum */

/** A packet that is being made. What does not fit is left out. */
typedef struct {
    uint16_t n;
    uint16_t octet[HT_XCP_DTO];
} ht_xcp_packet;

void ht_xcp_add8(ht_xcp_packet *p, uint16_t value);
void ht_xcp_add16(ht_xcp_packet *p, uint16_t value);
void ht_xcp_add32(ht_xcp_packet *p, uint32_t value);

/** A frame on its way out. */
typedef struct {
    uint16_t n;
    uint16_t sent;
    uint16_t octet[HT_XCP_HEAD + HT_XCP_DTO + HT_XCP_TAIL];
} ht_xcp_outgoing;

/** Octets on the line of a packet of `n`. */
uint16_t ht_xcp_frame_octets(uint16_t n, bool sum);
void ht_xcp_outgoing_set(ht_xcp_outgoing *out, const ht_xcp_packet *p, uint16_t counter, bool sum);

/** A frame on its way in. Octets that begin no frame, or one whose sum is wrong, are dropped one by
 *  one, until those behind them begin one. */
typedef struct {
    uint16_t n;
    uint16_t octet[HT_XCP_HEAD + HT_XCP_CTO + HT_XCP_TAIL];
} ht_xcp_incoming;

void ht_xcp_incoming_reset(ht_xcp_incoming *in);
/** Add an octet. There is room for one, if `ht_xcp_incoming_next` has said that there is no frame. */
void ht_xcp_incoming_add(ht_xcp_incoming *in, uint16_t octet);
/** Length of the packet if a whole frame of up to `most` octets is there, with the packet at
 *  `in->octet[HT_XCP_HEAD]`; else 0. */
uint16_t ht_xcp_incoming_next(ht_xcp_incoming *in, uint16_t most, bool sum);
/** Drop the octets of the frame that was there, its packet `n` long, or, with 0, the first octet. */
void ht_xcp_incoming_drop(ht_xcp_incoming *in, uint16_t n, bool sum);

#endif
