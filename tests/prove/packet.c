/* Frames: the check sum apart, by its reach. */
#define ht_crc32 real_crc32
#include "ht_octets.c"
#undef ht_crc32
uint32_t ht_crc32(uint32_t crc, const uint16_t *octets, uint16_t n);
#include "ht_packet.c"
#include "prove.h"

uint32_t ht_crc32(uint32_t crc, const uint16_t *octets, uint16_t n)
{
    MUST(n <= HT_PACKET_BODY);
    return nondet_uint32();
}

#define IS_INCOMING(in) (((in).n <= HT_PACKET_BODY + HT_PACKET_CRC) && ((in).left <= 254u))

/* One step from any state that an earlier step can have left. */
void prove_incoming(void)
{
    ht_incoming in;
    ht_incoming_status got;
    in.n = nondet_uint16();
    in.left = nondet_uint16();
    in.zero = nondet_bool();
    in.begun = nondet_bool();
    in.bad = nondet_bool();
    GIVEN(IS_INCOMING(in));
    got = ht_incoming_take(&in, nondet_uint16());
    MUST(IS_INCOMING(in));
    MUST(IMPLIES(got == HT_INCOMING_WHOLE,
                 (in.n >= HT_PACKET_SHORTEST) && (in.n <= HT_PACKET_BODY)));
    MUST(IMPLIES(got != HT_INCOMING_PART, !in.begun && !in.bad && (in.left == 0u)));
}

void prove_incoming_start(void)
{
    ht_incoming in;
    ht_incoming_reset(&in);
    MUST(IS_INCOMING(in));
    ht_incoming_discard(&in);
    MUST(IS_INCOMING(in) && in.bad);
}

void prove_packet_add(void)
{
    ht_packet p;
    uint16_t before = nondet_uint16();
    bool was_full = nondet_bool();
    uint16_t octets;
    p.n = before;
    p.full = was_full;
    GIVEN(before <= HT_PACKET_BODY);
    if (nondet_bool()) {
        octets = 1u;
        ht_packet_add8(&p, nondet_uint16());
    } else if (nondet_bool()) {
        octets = 2u;
        ht_packet_add16(&p, nondet_uint16());
    } else {
        octets = 4u;
        ht_packet_add32(&p, nondet_uint32());
    }
    MUST(p.n <= HT_PACKET_BODY);
    MUST((p.n == before) || (p.n == (before + octets)));
    MUST(p.full == (was_full || (p.n == before)));
}

/* The check sum of an octet as the remainder of a division, bit by bit. */
void prove_crc(void)
{
    uint32_t sum = nondet_uint32();
    uint32_t octet = nondet_uint16() & HT_OCTET;
    uint32_t bitwise = sum ^ octet;
    int bit;
    for (bit = 0; bit < 8; bit++) {
        bitwise = (bitwise >> 1) ^ (((bitwise & 1u) != 0u) ? 0xEDB88320u : 0u);
    }
    MUST(step(sum, octet) == bitwise);
}
