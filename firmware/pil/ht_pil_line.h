/** @file ht_pil_line.h
 *  The target's end of processor in the loop on a line of bytes: frames of the link
 *  (ht_packet.h) in, frames out, one request at a time.
 */
#ifndef HT_PIL_LINE_H
#define HT_PIL_LINE_H

#include "ht_pil.h"

typedef struct {
    ht_pil pil;
    ht_incoming in;
    ht_packet reply;
    ht_outgoing out; /**< the reply's frame */
} ht_pil_line;

/** Before the first byte. */
void ht_pil_line_reset(ht_pil_line *l);

/** A byte has come from the host. True if it ended a frame: the request has been carried out,
 *  and `out` is to be sent before the next byte is taken. */
bool ht_pil_line_take(ht_pil_line *l, uint16_t octet);

#endif
