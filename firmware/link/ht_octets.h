/** @file ht_octets.h
 *  Numbers as octets, low octet first, and the CRC over them. An octet has 8 bits. It lies in a
 *  cell of 16 bits, since the C28x has none smaller: a byte of C has 16 bits there.
 */
#ifndef HT_OCTETS_H
#define HT_OCTETS_H

#include <stdint.h>

#define HT_OCTET 0x00FFu

/** The bits of an IEEE 754 single, and back. */
uint32_t ht_float_bits(float value);
float ht_float_of(uint32_t bits);

void ht_put16(uint16_t *octets, uint16_t value);
void ht_put32(uint16_t *octets, uint32_t value);
uint16_t ht_get16(const uint16_t *octets);
uint32_t ht_get32(const uint16_t *octets);

/** CRC-32 of zlib and Ethernet over `n` octets, continued from `crc`, 0 to begin with. */
uint32_t ht_crc32(uint32_t crc, const uint16_t *octets, uint16_t n);
/** The same over the four octets of each of `n` values. */
uint32_t ht_crc32_values(uint32_t crc, const uint32_t *values, uint16_t n);

#endif
