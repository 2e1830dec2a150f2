#include "ht_xcp_frames.h"

#include "ht_octets.h"

static uint16_t room(const ht_xcp_packet *p)
{
    return (uint16_t)(HT_XCP_DTO - p->n);
}

void ht_xcp_add8(ht_xcp_packet *p, uint16_t value)
{
    if (room(p) >= 1u) {
        p->octet[p->n] = (uint16_t)(value & HT_OCTET);
        p->n++;
    }
}

void ht_xcp_add16(ht_xcp_packet *p, uint16_t value)
{
    if (room(p) >= 2u) {
        ht_put16(&p->octet[p->n], value);
        p->n = (uint16_t)(p->n + 2u);
    }
}

void ht_xcp_add32(ht_xcp_packet *p, uint32_t value)
{
    if (room(p) >= 4u) {
        ht_put32(&p->octet[p->n], value);
        p->n = (uint16_t)(p->n + 4u);
    }
}

/* Octets before the sum. */
static uint16_t summed(uint16_t n, bool sum)
{
    uint16_t octets = (uint16_t)(HT_XCP_HEAD + n);
    return sum ? (uint16_t)((octets + 1u) & 0xFFFEu) : octets;
}

uint16_t ht_xcp_frame_octets(uint16_t n, bool sum)
{
    return (uint16_t)(summed(n, sum) + (sum ? 2u : 0u));
}

/* `n` is even. */
static uint16_t sum_of(const uint16_t *octets, uint16_t n)
{
    uint16_t total = 0u;
    uint16_t k;
    for (k = 0u; k < n; k += 2u) {
        total = (uint16_t)((total + ht_get16(&octets[k])) & 0xFFFFu);
    }
    return total;
}

void ht_xcp_outgoing_set(ht_xcp_outgoing *out, const ht_xcp_packet *p, uint16_t counter, bool sum)
{
    uint16_t octets = summed(p->n, sum);
    uint16_t k;
    ht_put16(&out->octet[0], p->n);
    ht_put16(&out->octet[2], counter);
    for (k = 0u; k < p->n; k++) {
        out->octet[HT_XCP_HEAD + k] = p->octet[k];
    }
    if (sum) {
        out->octet[HT_XCP_HEAD + p->n] = 0u; /* where an odd length is filled up */
        ht_put16(&out->octet[octets], sum_of(out->octet, octets));
    }
    out->n = ht_xcp_frame_octets(p->n, sum);
    out->sent = 0u;
}

void ht_xcp_incoming_reset(ht_xcp_incoming *in)
{
    in->n = 0u;
}

void ht_xcp_incoming_add(ht_xcp_incoming *in, uint16_t octet)
{
    in->octet[in->n] = (uint16_t)(octet & HT_OCTET);
    in->n++;
}

static void drop(ht_xcp_incoming *in, uint16_t octets)
{
    uint16_t k;
    for (k = octets; k < in->n; k++) {
        in->octet[k - octets] = in->octet[k];
    }
    in->n = (octets < in->n) ? (uint16_t)(in->n - octets) : 0u;
}

void ht_xcp_incoming_drop(ht_xcp_incoming *in, uint16_t n, bool sum)
{
    drop(in, (n == 0u) ? 1u : ht_xcp_frame_octets(n, sum));
}

uint16_t ht_xcp_incoming_next(ht_xcp_incoming *in, uint16_t most, bool sum)
{
    while (in->n >= 2u) {
        uint16_t n = ht_get16(in->octet);
        if ((n != 0u) && (n <= most)) {
            uint16_t octets = summed(n, sum);
            if (in->n < ht_xcp_frame_octets(n, sum)) {
                return 0u;
            }
            if (!sum || (sum_of(in->octet, octets) == ht_get16(&in->octet[octets]))) {
                return n;
            }
        }
        drop(in, 1u);
    }
    return 0u;
}
