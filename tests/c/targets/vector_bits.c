/* Checks every bit that the core computes from the test vectors' inputs: one checksum per table,
 * which must be the same on all processors. (tests/c/test_vectors.c checks that the results are
 * right.) */
#include <stdio.h>

#include "ht_duty.h"
#include "ht_pattern.h"
#include "ht_switching.h"
#include "vectors.h"

#define ROWS(table) (sizeof(table) / sizeof((table)[0]))

static uint32_t sum;

static void word(uint16_t value)
{
    sum = (sum ^ value) * 16777619u; /* FNV-1a */
}

static void number(float value)
{
    union {
        float value;
        uint32_t bits;
    } u;
    u.value = value;
    word((uint16_t)(u.bits & 0xFFFFu));
    word((uint16_t)(u.bits >> 16));
}

static void begin(void)
{
    sum = 2166136261u;
}

static void report(const char *table)
{
    printf("%s %04x%04x\n", table, (unsigned)(sum >> 16), (unsigned)(sum & 0xFFFFu));
}

int main(void)
{
    unsigned n;
    begin();
    for (n = 0; n < ROWS(ht_states_rows); n++) {
        number(ht_vector[n].ab.alpha);
        number(ht_vector[n].ab.beta);
        number(ht_vector[n].xy.x);
        number(ht_vector[n].xy.y);
        word(ht_nearest_zero[n]);
    }
    report("states");
    begin();
    for (n = 0; n < ROWS(ht_sectors_rows); n++) {
        ht_sectors_row r;
        ht_ab flux;
        HT_ROM_ROW(&r, &ht_sectors_rows[n]);
        flux.alpha = r.alpha;
        flux.beta = r.beta;
        word((uint16_t)ht_sector(flux));
    }
    report("sectors");
    begin();
    for (n = 0; n < ROWS(ht_duties_rows); n++) {
        ht_duties_row r;
        ht_xy v;
        ht_action_points p;
        HT_ROM_ROW(&r, &ht_duties_rows[n]);
        v.x = r.v_x;
        v.y = r.v_y;
        p = ht_duty(r.group, r.k, v);
        number(p.t1);
        number(p.t2);
    }
    report("duties");
    begin();
    for (n = 0; n < ROWS(ht_compare_rows); n++) {
        ht_compare_row r;
        ht_action_points p;
        ht_compare c;
        ht_applied a;
        ht_period period;
        uint16_t s[3];
        int i;
        HT_ROM_ROW(&r, &ht_compare_rows[n]);
        for (i = 0; i < 3; i++) {
            s[i] = (uint16_t)((((r.sequence >> (2 - i)) & 1u) != 0u) ? 63u : 0u);
        }
        p.t1 = r.t1;
        p.t2 = r.t2;
        period.counts = r.period;
        period.first = r.first;
        period.shortest = r.shortest;
        ht_pattern_counts(s, p, &period, &c, &a);
        word(c.start);
        for (i = 0; i < HT_LEGS; i++) {
            word(c.ca[i]);
            word(c.cb[i]);
        }
        for (i = 0; i < 3; i++) {
            number(a.t[i]);
        }
    }
    report("compare");
    return 0;
}
