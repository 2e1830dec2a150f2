#include "ht_packet.h"

#include "ht_octets.h"

#define COBS_FULL 0xFFu /* a block of 254 octets that no zero follows */

void ht_packet_begin(ht_packet *p)
{
    p->n = 0u;
    p->full = false;
}

static uint16_t *room(ht_packet *p, uint16_t octets)
{
    uint16_t *at = &p->octet[p->n];
    if (octets > (HT_PACKET_BODY - p->n)) {
        p->full = true;
        return &p->octet[HT_PACKET_BODY]; /* where only the CRC will be */
    }
    p->n = (uint16_t)(p->n + octets);
    return at;
}

void ht_packet_add8(ht_packet *p, uint16_t value)
{
    *room(p, 1u) = (uint16_t)(value & HT_OCTET);
}

void ht_packet_add16(ht_packet *p, uint16_t value)
{
    ht_put16(room(p, 2u), value);
}

void ht_packet_add32(ht_packet *p, uint32_t value)
{
    ht_put32(room(p, 4u), value);
}

void ht_packet_add_float(ht_packet *p, float value)
{
    ht_packet_add32(p, ht_float_bits(value));
}

void ht_packet_add_text(ht_packet *p, const char *text)
{
    uint16_t i;
    for (i = 0u; text[i] != '\0'; i++) {
        ht_packet_add8(p, (uint16_t)text[i]);
    }
    ht_packet_add8(p, 0u);
}

void ht_outgoing_set(ht_outgoing *out, ht_packet *p)
{
    uint16_t code_at = 0u; /* where the present block's length goes */
    uint16_t code = 1u;
    uint16_t end = 1u;
    uint16_t total = (uint16_t)(p->n + HT_PACKET_CRC);
    uint16_t i;
    ht_put32(&p->octet[p->n], ht_crc32(0u, p->octet, p->n));
    for (i = 0u; i < total; i++) {
        if (code == COBS_FULL) { /* opened only when an octet follows */
            out->octet[code_at] = code;
            code_at = end;
            end++;
            code = 1u;
        }
        if (p->octet[i] != 0u) {
            out->octet[end] = p->octet[i];
            end++;
            code++;
        } else {
            out->octet[code_at] = code;
            code_at = end;
            end++;
            code = 1u;
        }
    }
    out->octet[code_at] = code;
    out->octet[end] = 0u;
    out->n = (uint16_t)(end + 1u);
    out->sent = 0u;
}

void ht_incoming_reset(ht_incoming *in)
{
    in->n = 0u;
    in->left = 0u;
    in->zero = false;
    in->begun = false;
    in->bad = false;
}

void ht_incoming_discard(ht_incoming *in)
{
    in->begun = true;
    in->bad = true;
}

static void append(ht_incoming *in, uint16_t octet)
{
    if (in->n < (uint16_t)(HT_PACKET_BODY + HT_PACKET_CRC)) {
        in->octet[in->n] = octet;
        in->n++;
    } else {
        in->bad = true;
    }
}

/* At a zero. */
static ht_incoming_status close(ht_incoming *in)
{
    bool whole = !in->bad && (in->left == 0u)
                 && (in->n >= (uint16_t)(HT_PACKET_SHORTEST + HT_PACKET_CRC));
    uint16_t n = in->n;
    bool begun = in->begun;
    ht_incoming_reset(in);
    if (!begun) {
        return HT_INCOMING_PART;
    }
    if (whole) {
        n = (uint16_t)(n - HT_PACKET_CRC);
        if (ht_crc32(0u, in->octet, n) == ht_get32(&in->octet[n])) {
            in->n = n;
            return HT_INCOMING_WHOLE;
        }
    }
    return HT_INCOMING_DAMAGED;
}

ht_incoming_status ht_incoming_take(ht_incoming *in, uint16_t cell)
{
    uint16_t octet = (uint16_t)(cell & HT_OCTET);
    if (octet == 0u) {
        return close(in);
    }
    if (!in->begun) { /* `n` may still be that of the body before */
        in->begun = true;
        in->n = 0u;
    }
    if (in->left != 0u) {
        append(in, octet);
        in->left--;
    } else {
        if (in->zero) {
            append(in, 0u);
        }
        in->left = (uint16_t)(octet - 1u);
        in->zero = octet != COBS_FULL;
    }
    return HT_INCOMING_PART;
}
