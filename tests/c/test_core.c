/* Unit tests of the firmware in C, for a build without Python. They check the values that the
 * papers print. The Python tests derive everything else from first principles. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "checks.h"
#include "ht_comparator.h"
#include "ht_drive.h"
#include "ht_limited.h"
#include "ht_port_c2000.h"

static int near(float a, float b)
{
    return fabsf(a - b) < 1.0e-5f;
}

/* Paper A, Fig. 1: group radii and the words at 15, 45, ... degrees. */
static void test_groups(void)
{
    static const uint16_t large[12] = {48, 56, 60, 28, 12, 14, 15, 7, 3, 35, 51, 49};
    static const uint16_t medium[12] = {57, 52, 24, 44, 30, 13, 6, 11, 39, 19, 33, 50};
    static const uint16_t small[12] = {54, 25, 36, 26, 45, 22, 9, 38, 27, 37, 18, 41};
    int k;
    CHECK(memcmp(ht_group[HT_L], large, sizeof large) == 0);
    CHECK(memcmp(ht_group[HT_ML], medium, sizeof medium) == 0);
    CHECK(memcmp(ht_group[HT_S], small, sizeof small) == 0);
    for (k = 0; k < 12; k++) {
        ht_ab v = ht_vector[large[k]].ab;
        CHECK(near(sqrtf(v.alpha * v.alpha + v.beta * v.beta), 0.643951f));
    }
}

/* Paper A, eqs. (14) and (5): fixed duties for a zero command; eq. (20). */
static void test_duties(void)
{
    ht_xy none = {0.0f, 0.0f};
    unsigned k;
    for (k = 0; k < 12; k++) {
        ht_action_points l = ht_duty(HT_L, k, none);
        ht_action_points ml = ht_duty(HT_ML, k, none);
        CHECK(near(l.t1, 0.267949f) && near(l.t2, 0.732051f));
        CHECK(near(ml.t1, 0.267949f) && near(ml.t2, 0.732051f));
    }
    CHECK(near(ht_tmvcl_pu[HT_L], 0.032692f));
    CHECK(near(ht_tmvcl_pu[HT_ML], 0.089316f));
}

/* Paper B, Table I: sector i, vectors 60, 35, 28, 3. */
static void test_switching_table(void)
{
    CHECK(ht_group[HT_L][ht_direction(HT_TABLE_75_105, 0, true, true)] == 60);
    CHECK(ht_group[HT_L][ht_direction(HT_TABLE_75_105, 0, false, true)] == 35);
    CHECK(ht_group[HT_L][ht_direction(HT_TABLE_75_105, 0, true, false)] == 28);
    CHECK(ht_group[HT_L][ht_direction(HT_TABLE_75_105, 0, false, false)] == 3);
}

/* Paper A, eqs. (17), (18) with counts that toggle actions can realise. */
static void test_compare_counts(void)
{
    static const uint16_t words[3] = {49, 48, 56}; /* VV_L1 = 771004 */
    ht_action_points p = {0.25f, 0.75f};
    ht_action_points edge = {0.02f, 0.995f};
    ht_period period = {15000u, 0u, 500u};
    ht_compare c;
    ht_applied a;
    ht_pattern_counts(words, p, &period, &c, &a);
    CHECK((c.start == 49) && (c.ca[0] == 15000) && (c.cb[0] == 15000)); /* 7: high */
    CHECK((c.ca[2] == 15000) && (c.cb[2] == 11250));                    /* 1: rises at T2 */
    CHECK((c.ca[5] == 3750) && (c.cb[5] == 15000));                     /* 4: falls at T1 */
    ht_pattern_counts(words, edge, &period, &c, &a);
    CHECK((c.start == 49) && (c.ca[5] == 500));                        /* lengthened */
    CHECK((a.s[2] == 48) && (c.cb[2] == 15000) && (c.ca[2] == 15000)); /* left out */
}

static void test_comparators(void)
{
    CHECK(ht_compare_three_level(0, 0.6f, 0.5f, 0.0f) == 1);
    CHECK(ht_compare_three_level(1, 0.1f, 0.5f, 0.0f) == 1);
    CHECK(ht_compare_three_level(1, -0.1f, 0.5f, 0.0f) == 0);
    CHECK(ht_compare_five_level(0, 0.2f, 0.173f, 0.3f) == 1);
    CHECK(ht_compare_five_level(1, 0.3f, 0.173f, 0.3f) == 2);
    CHECK(ht_compare_five_level(2, 0.17f, 0.173f, 0.3f) == 1);
    CHECK(ht_compare_five_level(2, -0.2f, 0.173f, 0.3f) == -1);
}

/* A number comes out, whatever goes in; NaN gives the lower limit. */
static void test_limits(void)
{
    float none = nanf("");
    CHECK((ht_limited(3.0f, 2.0f) == 2.0f) && (ht_limited(-3.0f, 2.0f) == -2.0f));
    CHECK((ht_limited(2.0f, 2.0f) == 2.0f) && (ht_limited(-1.5f, 2.0f) == -1.5f));
    CHECK((ht_limited(INFINITY, 2.0f) == 2.0f) && (ht_limited(-INFINITY, 2.0f) == -2.0f));
    CHECK((ht_between(3.0f, 1.0f, 2.0f) == 2.0f) && (ht_between(0.0f, 1.0f, 2.0f) == 1.0f));
    CHECK((ht_between(1.5f, 1.0f, 2.0f) == 1.5f) && (ht_between(INFINITY, 1.0f, 2.0f) == 2.0f));
    CHECK((ht_limited(none, 2.0f) == -2.0f) && (ht_between(none, 1.0f, 2.0f) == 1.0f));
}

static void fill(ht_regfile *rf, const ht_c2000_map *m, unsigned current, unsigned vdc)
{
    unsigned k;
    for (k = 0; k < 6u; k++) {
        rf->word[m->adc_result[k]] = (uint16_t)(current << m->adc_shift);
    }
    rf->word[m->adc_result[6]] = (uint16_t)(vdc << m->adc_shift);
}

/* For all boards: no register access is forbidden, a start ends in RUN, and an over-current turns
 * the gates off in the same interrupt. */
static void test_drive(const ht_board *board)
{
    static ht_regfile rf;
    const ht_c2000_map *m = board->map;
    ht_port port;
    ht_drive d;
    ht_params params;
    int k;
    ht_regfile_reset(&rf, m);
    ht_port_bind(&port, &rf, board);
    CHECK(ht_board_start(&port));
    ht_params_default(&params);
    CHECK(ht_drive_init(&d, &port, &params) == HT_OK);
    CHECK(ht_port_tripped(&port, HT_ALL_LEGS));
    fill(&rf, m, 2048u, 2048u);
    CHECK(ht_drive_start(&d) == HT_OK);
    for (k = 0; k < 3600; k++) {
        ht_drive_fast_isr(&d);
    }
    CHECK(d.state == HT_STATE_RUN);
    CHECK(!ht_port_tripped(&port, HT_ALL_LEGS));
    fill(&rf, m, 4095u, 2048u);
    ht_drive_fast_isr(&d);
    CHECK(ht_port_tripped(&port, HT_ALL_LEGS));
    CHECK((d.faults & HT_FAULT_OVERCURRENT) != 0);
    CHECK(ht_drive_start(&d) == HT_ERROR_STATE);
    CHECK(rf.violations == 0u);
}

int main(void)
{
    test_groups();
    test_duties();
    test_switching_table();
    test_compare_counts();
    test_comparators();
    test_limits();
    test_drive(&ht_board_f28335);
    test_drive(&ht_board_f28377s);
    test_drive(&ht_board_launchxl_f28377s);
    printf("%s\n", (failures == 0) ? "all passed" : "failures");
    return (failures == 0) ? 0 : 1;
}
