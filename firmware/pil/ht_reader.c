#include "ht_reader.h"

#include "ht_octets.h"

void ht_reader_begin(ht_reader *r, const uint16_t *octets, uint16_t n)
{
    r->octet = octets;
    r->left = n;
    r->exceeded = false;
}

/* The next `n` bytes, at most four. */
static const uint16_t *next(ht_reader *r, uint16_t n)
{
    static const uint16_t nothing[4] = {0u, 0u, 0u, 0u};
    const uint16_t *at = r->octet;
    if (r->left < n) {
        r->exceeded = true;
        return nothing;
    }
    r->octet = &at[n];
    r->left = (uint16_t)(r->left - n);
    return at;
}

uint16_t ht_read8(ht_reader *r)
{
    return (uint16_t)(next(r, 1u)[0] & HT_OCTET);
}

uint16_t ht_read16(ht_reader *r)
{
    return ht_get16(next(r, 2u));
}

uint32_t ht_read32(ht_reader *r)
{
    return ht_get32(next(r, 4u));
}

float ht_read_float(ht_reader *r)
{
    return ht_float_of(ht_read32(r));
}

bool ht_reader_done(const ht_reader *r)
{
    return (r->left == 0u) && !r->exceeded;
}
