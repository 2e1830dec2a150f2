#include "ht_octets.h"

typedef union {
    float value;
    uint32_t bits;
} float_bits;

uint32_t ht_float_bits(float value)
{
    float_bits u;
    u.value = value;
    return u.bits;
}

float ht_float_of(uint32_t bits)
{
    float_bits u;
    u.bits = bits;
    return u.value;
}

void ht_put16(uint16_t *octets, uint16_t value)
{
    octets[0] = (uint16_t)(value & HT_OCTET);
    octets[1] = (uint16_t)((value >> 8) & HT_OCTET);
}

void ht_put32(uint16_t *octets, uint32_t value)
{
    ht_put16(octets, (uint16_t)(value & 0xFFFFu));
    ht_put16(&octets[2], (uint16_t)(value >> 16));
}

uint16_t ht_get16(const uint16_t *octets)
{
    return (uint16_t)((octets[0] & HT_OCTET) | (uint16_t)((octets[1] & HT_OCTET) << 8));
}

uint32_t ht_get32(const uint16_t *octets)
{
    return ht_get16(octets) | ((uint32_t)ht_get16(&octets[2]) << 16);
}

/* The remainders of all half octets: two steps an octet, 16 values instead of 256. */
static const uint32_t remainder_of[16] = {0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu,
                                          0x76DC4190u, 0x6B6B51F4u, 0x4DB26158u, 0x5005713Cu,
                                          0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
                                          0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};

static uint32_t step(uint32_t sum, uint32_t octet)
{
    uint32_t first = sum ^ octet;
    uint32_t second = (first >> 4) ^ remainder_of[first & 0xFu];
    return (second >> 4) ^ remainder_of[second & 0xFu];
}

uint32_t ht_crc32(uint32_t crc, const uint16_t *octets, uint16_t n)
{
    uint32_t sum = ~crc;
    uint16_t i;
    for (i = 0u; i < n; i++) {
        sum = step(sum, (uint32_t)octets[i] & HT_OCTET);
    }
    return ~sum;
}

uint32_t ht_crc32_values(uint32_t crc, const uint32_t *values, uint16_t n)
{
    uint32_t sum = ~crc;
    uint16_t i;
    for (i = 0u; i < n; i++) {
        uint32_t value = values[i];
        sum = step(sum, value & HT_OCTET);
        sum = step(sum, (value >> 8) & HT_OCTET);
        sum = step(sum, (value >> 16) & HT_OCTET);
        sum = step(sum, value >> 24);
    }
    return ~sum;
}
