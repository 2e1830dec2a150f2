/** @file ht_reader.h
 *  Read a body number by number, low byte first: the counterpart of `ht_packet_add8` and its
 *  like. One byte lies in a 16-bit cell.
 */
#ifndef HT_READER_H
#define HT_READER_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    const uint16_t *octet; /**< the next byte */
    uint16_t left;         /**< bytes not read so far */
    bool exceeded;         /**< more was asked for than there is; such numbers are 0 */
} ht_reader;

void ht_reader_begin(ht_reader *r, const uint16_t *octets, uint16_t n);
uint16_t ht_read8(ht_reader *r);
uint16_t ht_read16(ht_reader *r);
uint32_t ht_read32(ht_reader *r);
float ht_read_float(ht_reader *r);

/** True if everything was read and nothing was missing. */
bool ht_reader_done(const ht_reader *r);

#endif
