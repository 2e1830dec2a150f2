#include "ht_contracts.h"
#include "ht_switching.c"
#include "ht_tables.c"
#include "ht_vectors.c"
#include "prove.h"

void prove_sector(void)
{
    ht_ab v = any_ab();
    unsigned sector = ht_sector(v);
    MUST(HT_IS_SECTOR(sector));
    /* Sector s has its middle at 30 s degrees: quadrants and axes. */
    MUST(IMPLIES((v.alpha > 0.0f) && (v.beta > 0.0f), sector <= 3u));
    MUST(IMPLIES((v.alpha < 0.0f) && (v.beta > 0.0f), (sector >= 3u) && (sector <= 6u)));
    MUST(IMPLIES((v.alpha < 0.0f) && (v.beta < 0.0f), (sector >= 6u) && (sector <= 9u)));
    MUST(IMPLIES((v.alpha > 0.0f) && (v.beta < 0.0f), (sector == 0u) || (sector >= 9u)));
    MUST(IMPLIES((v.beta == 0.0f) && (v.alpha > 1.0e-30f), sector == 0u));
    MUST(IMPLIES((v.beta == 0.0f) && (v.alpha < -1.0e-30f), sector == 6u));
    MUST(IMPLIES((v.alpha == 0.0f) && (v.beta > 0.0f), sector == 3u));
    MUST(IMPLIES((v.alpha == 0.0f) && (v.beta < 0.0f), sector == 9u));
}

/* Direction k points at 15 + 30 k degrees, sector s at 30 s: what is ahead of the flux by up to
 * 180 degrees raises the torque, what is within 90 degrees of it raises the flux. */
void prove_direction(void)
{
    unsigned sector = nondet_uint16();
    ht_table table = nondet_bool() ? HT_TABLE_45_135 : HT_TABLE_75_105;
    bool torque_up = nondet_bool();
    bool flux_up = nondet_bool();
    unsigned k;
    unsigned ahead; /* steps of 30 degrees, and 15 degrees more */
    GIVEN(HT_IS_SECTOR(sector));
    k = ht_direction(table, sector, torque_up, flux_up);
    MUST(HT_IS_SECTOR(k));
    ahead = (k + 12u - sector) % 12u;
    MUST((ahead < 6u) == torque_up);
    MUST(((ahead < 3u) || (ahead >= 9u)) == flux_up);
    k = ht_direction_along(table, sector, torque_up);
    MUST(HT_IS_SECTOR(k));
    MUST(((k + 12u - sector) % 12u) == (torque_up ? 0u : 11u));
}

/* Six vectors, entries 2 n and 2 n + 1 at 60 n degrees; sector s from 30 s - 30 to 30 s degrees. In units
 * of 30 degrees the vector is ahead of the whole sector by `ahead` to `ahead` + 1. */
void prove_direction_of_six(void)
{
    unsigned sector = nondet_uint16();
    bool torque_up = nondet_bool();
    bool flux_up = nondet_bool();
    unsigned k;
    unsigned ahead;
    GIVEN(HT_IS_SECTOR(sector));
    k = ht_direction(HT_TABLE_60_120, sector, torque_up, flux_up);
    MUST(HT_IS_SECTOR(k));
    ahead = ((k & ~1u) + 12u - sector) % 12u;
    MUST((ahead < 6u) == torque_up);
    MUST(((ahead < 3u) || (ahead >= 9u)) == flux_up);
    k = ht_direction_along(HT_TABLE_60_120, sector, torque_up);
    MUST(HT_IS_SECTOR(k));
    ahead = ((k & ~1u) + 12u - sector) % 12u;
    MUST(torque_up ? (ahead < 2u) : (ahead >= 10u));
}

static unsigned transitions(unsigned from, unsigned to)
{
    unsigned n = 0u;
    unsigned leg;
    for (leg = 0u; leg < 6u; leg++) {
        n += ((from ^ to) >> leg) & 1u;
    }
    return n;
}

/* Each three-phase set is on one rail: no voltage between any two phases. */
static bool is_zero_vector(unsigned word)
{
    return (((word & 0x2Au) == 0u) || ((word & 0x2Au) == 0x2Au))
           && (((word & 0x15u) == 0u) || ((word & 0x15u) == 0x15u));
}

void prove_zero_vector(void)
{
    uint16_t before = nondet_uint16();
    uint16_t other = nondet_uint16();
    bool only_v0 = nondet_bool();
    uint16_t s[3];
    GIVEN(HT_IS_WORD(before) && HT_IS_WORD(other) && is_zero_vector(other));
    ht_vectors_zero(before, only_v0, s);
    MUST((s[0] == s[1]) && (s[1] == s[2]) && HT_IS_WORD(s[0]));
    MUST(is_zero_vector(s[0]));
    MUST(IMPLIES(only_v0, s[0] == 0u));
    MUST(IMPLIES(!only_v0, transitions(before, s[0]) <= transitions(before, other)));
}

void prove_virtual_vector(void)
{
    unsigned group = nondet_uint16();
    unsigned k = nondet_uint16();
    unsigned n;
    uint16_t s[3];
    GIVEN((group < (unsigned)HT_GROUPS) && HT_IS_SECTOR(k));
    ht_vectors_virtual(group, k, s);
    for (n = 0u; n < 3u; n++) {
        MUST(HT_IS_WORD(s[n]));
        MUST(!is_zero_vector(s[n]));
        MUST(s[n] == ht_group[group][(k + 11u + n) % 12u]);
    }
}

/* The tables that the fast interrupt reads: what they say is true of every word. */
void prove_tables(void)
{
    unsigned word = nondet_uint16();
    unsigned leg;
    GIVEN(HT_IS_WORD(word));
    leg = ht_first_leg[word];
    MUST((leg == 6u) == (word == 0u));
    MUST(IMPLIES(leg < 6u, ((0x20u >> leg) & word) != 0u));
    MUST(IMPLIES(leg < 6u, ((0x40u >> leg) > 0x20u) || ((word >> (6u - leg)) == 0u)));
}
