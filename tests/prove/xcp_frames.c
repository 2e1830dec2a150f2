/* XCP's packets and frames. */
#include "ht_octets.c"
static uint16_t promise_ht_get16(const uint16_t *octets);
#include "ht_xcp_frames.c"
#include "prove.h"

#define CELLS(array) (sizeof(array) / sizeof((array)[0]))

void prove_xcp_add(void)
{
    ht_xcp_packet p;
    uint16_t before = nondet_uint16();
    uint16_t octets;
    p.n = before;
    GIVEN(before <= HT_XCP_DTO);
    if (nondet_bool()) {
        octets = 1u;
        ht_xcp_add8(&p, nondet_uint16());
    } else if (nondet_bool()) {
        octets = 2u;
        ht_xcp_add16(&p, nondet_uint16());
    } else {
        octets = 4u;
        ht_xcp_add32(&p, nondet_uint32());
    }
    MUST(p.n <= HT_XCP_DTO);
    MUST(p.n == ((octets <= (HT_XCP_DTO - before)) ? (before + octets) : before));
}

/* Here and below, a structure that nothing was written to has any values. */
void prove_xcp_drop(void)
{
    ht_xcp_incoming in;
    uint16_t before = in.n;
    uint16_t octets = nondet_uint16();
    GIVEN((before <= CELLS(in.octet)) && (octets >= 1u));
    drop(&in, octets);
    MUST(in.n == ((octets < before) ? (before - octets) : 0u));
}

/* As prove_xcp_drop shows it. What is left may be anything, as promise_ht_get16 reads it. */
static void promise_drop(ht_xcp_incoming *in, uint16_t octets)
{
    MUST((in->n <= CELLS(in->octet)) && (octets >= 1u));
    in->n = (octets < in->n) ? (uint16_t)(in->n - octets) : 0u;
}

static const uint16_t *begins; /* the frame */
static uint16_t there;         /* octets of it that are in memory */

/* Any octets, if they are there. */
static uint16_t promise_ht_get16(const uint16_t *octets)
{
    MUST((octets >= begins) && (octets + 2u <= begins + there));
    return nondet_uint16();
}

/* As prove_xcp_sum shows it. */
static uint16_t promise_sum_of(const uint16_t *octets, uint16_t n)
{
    MUST(((n % 2u) == 0u) && (n <= there));
    return nondet_uint16();
}

void prove_xcp_sum(void)
{
    uint16_t octets[HT_XCP_HEAD + HT_XCP_DTO + 1u];
    uint16_t n = nondet_uint16();
    uint16_t k;
    for (k = 0u; k < CELLS(octets); k++) {
        octets[k] = nondet_uint16() & HT_OCTET;
    }
    GIVEN(((n % 2u) == 0u) && (n <= CELLS(octets)));
    MUST(sum_of(octets, n) <= 0xFFFFu);
}

/* One octet, after any others: there is room for it, and then for the next one. */
void prove_xcp_incoming(void)
{
    ht_xcp_incoming in;
    uint16_t most = nondet_uint16();
    bool sum = nondet_bool();
    uint16_t n;
    begins = in.octet;
    there = (uint16_t)CELLS(in.octet);
    GIVEN((most <= HT_XCP_CTO) && (in.n < CELLS(in.octet)));
    ht_xcp_incoming_add(&in, nondet_uint16());
    n = ht_xcp_incoming_next(&in, most, sum);
    MUST(n <= most);
    MUST(IMPLIES(n == 0u, in.n < CELLS(in.octet)));
    MUST(IMPLIES(n != 0u, in.n >= ht_xcp_frame_octets(n, sum)));
    ht_xcp_incoming_drop(&in, n, sum);
    MUST(in.n < CELLS(in.octet));
}

void prove_xcp_outgoing(void)
{
    ht_xcp_packet p;
    ht_xcp_outgoing out;
    bool sum = nondet_bool();
    GIVEN(p.n <= HT_XCP_DTO);
    there = (uint16_t)CELLS(out.octet);
    ht_xcp_outgoing_set(&out, &p, nondet_uint16(), sum);
    MUST((out.n <= CELLS(out.octet)) && (out.sent == 0u));
    MUST((out.n >= HT_XCP_HEAD + p.n) && (ht_get16(out.octet) == p.n));
    MUST(IMPLIES(sum, (out.n % 2u) == 0u));
}
