#include "ht_vectors.h"

void ht_vectors_single(uint16_t word, uint16_t s[3])
{
    s[0] = word;
    s[1] = word;
    s[2] = word;
}

static unsigned after(unsigned k)
{
    return (k == HT_DIRECTIONS - 1u) ? 0u : (k + 1u);
}

void ht_vectors_virtual(unsigned group, unsigned k, uint16_t s[3])
{
    s[0] = ht_group[group][(k == 0u) ? (HT_DIRECTIONS - 1u) : (k - 1u)];
    s[1] = ht_group[group][k];
    s[2] = ht_group[group][after(k)];
}

void ht_vectors_alike(unsigned group, unsigned k, uint16_t s[3])
{
    s[0] = ht_group[group][k];
    s[1] = ht_group[group][after(k)];
    s[2] = s[1];
}

void ht_vectors_zero(uint16_t before, bool only_v0, uint16_t s[3])
{
    ht_vectors_single(only_v0 ? (uint16_t)0 : ht_nearest_zero[before], s);
}
