/* The firmware against the test vectors of tests/vectors, a row at a time. */
#include <math.h>
#include <stdio.h>

#include "ht_control.h"
#include "vectors.h"

#define ROWS(table) (sizeof(table) / sizeof((table)[0]))
#define DEGREE 0.0174532925f

static unsigned failures;

static void check(int good, const char *table, unsigned row)
{
    if (!good) {
        printf("vectors: %s, row %u\n", table, row);
        failures++;
    }
}

static int near(float a, float b, float tolerance)
{
    return fabsf(a - b) < tolerance; /* false for NaN */
}

static void test_states(void)
{
    ht_states_row r;
    unsigned n;
    for (n = 0; n < ROWS(ht_states_rows); n++) {
        const ht_vsd *v = &ht_vector[n];
        HT_ROM_ROW(&r, &ht_states_rows[n]);
        check(near(v->ab.alpha, r.alpha, 1.0e-6f) && near(v->ab.beta, r.beta, 1.0e-6f)
                  && near(v->xy.x, r.x, 1.0e-6f) && near(v->xy.y, r.y, 1.0e-6f)
                  && (ht_nearest_zero[n] == r.nearest_zero),
              "states", n);
    }
}

static void test_sectors(void)
{
    ht_sectors_row r;
    unsigned n;
    for (n = 0; n < ROWS(ht_sectors_rows); n++) {
        ht_ab flux;
        HT_ROM_ROW(&r, &ht_sectors_rows[n]);
        flux.alpha = r.alpha;
        flux.beta = r.beta;
        check(ht_sector(flux) == r.sector, "sectors", n);
    }
}

static void test_switching(void)
{
    ht_switching_row r;
    unsigned n;
    for (n = 0; n < ROWS(ht_switching_rows); n++) {
        HT_ROM_ROW(&r, &ht_switching_rows[n]);
        check(ht_direction((ht_table)r.table, r.sector, r.torque > 0, r.flux > 0) == r.k,
              "switching", n);
    }
}

static void test_duties(void)
{
    ht_duties_row r;
    unsigned n;
    for (n = 0; n < ROWS(ht_duties_rows); n++) {
        ht_xy v;
        ht_action_points p;
        HT_ROM_ROW(&r, &ht_duties_rows[n]);
        v.x = r.v_x;
        v.y = r.v_y;
        p = ht_duty(r.group, r.k, v);
        check(near(p.t1, r.t1, 2.0e-6f) && near(p.t2, r.t2, 2.0e-6f), "duties", n);
    }
}

/* All six legs do the same sequence. */
static void test_compare(void)
{
    ht_compare_row r;
    unsigned n;
    for (n = 0; n < ROWS(ht_compare_rows); n++) {
        uint16_t s[3];
        ht_action_points p;
        ht_compare c;
        ht_applied a;
        ht_period period;
        int leg;
        HT_ROM_ROW(&r, &ht_compare_rows[n]);
        for (leg = 0; leg < 3; leg++) {
            s[leg] = (((r.sequence >> (2 - leg)) & 1u) != 0u) ? 63u : 0u;
        }
        p.t1 = r.t1;
        p.t2 = r.t2;
        period.counts = r.period;
        period.first = r.first;
        period.shortest = r.shortest;
        ht_pattern_counts(s, p, &period, &c, &a);
        check(c.start == ((r.start != 0u) ? 63u : 0u), "compare", n);
        for (leg = 0; leg < HT_LEGS; leg++) {
            check((c.ca[leg] == r.ca) && (c.cb[leg] == r.cb), "compare", n);
        }
    }
}

/* A drive without latency, resistance or dead time. */
static void configure(ht_control_config *cfg, ht_scheme scheme, ht_table table)
{
    static const ht_control_config nothing = {0};
    *cfg = nothing;
    ht_control_select(cfg, scheme);
    cfg->table_law.table = table;
    cfg->table_law.flux_band_Wb = 0.003f;
    cfg->table_law.torque_band_Nm = 0.3f;
    cfg->table_law.torque_inner_Nm = 0.173f;
    cfg->period.counts = 10000u;
    cfg->period.shortest = 1u;
    cfg->build_current_A = 1.0f;
    cfg->observer.ts_s = 1.0e-4f;
    cfg->observer.inv_ts = 1.0e4f;
    cfg->observer.sigma_ls_H = 0.028f;
    cfg->observer.inv_sigma_ls = 1.0f / 0.028f;
    cfg->observer.lxy_H = 0.0144f;
    cfg->observer.torque_gain = 3.0f;
    cfg->dead.i_zero_A = 0.05f;
}

/* Words of one control step with the flux in the middle of a sector, the comparators at
 * `level` and `flux_up`, and an x-y flux of 0.02 Wb at an angle. */
static void decide(ht_scheme scheme, ht_table table, unsigned sector, int level, int flux_up,
                   float xy_deg, uint16_t s[3])
{
    const ht_vsd *columns = ht_transform[HT_WINDING_30];
    ht_control_config cfg;
    ht_control_state st;
    ht_control_input in;
    ht_compare out;
    float angle = 30.0f * DEGREE * (float)sector;
    float x = 0.02f * cosf(DEGREE * xy_deg);
    float y = 0.02f * sinf(DEGREE * xy_deg);
    float size = ((level == 1) || (level == -1)) ? 0.25f : 1.0f;
    int leg;
    configure(&cfg, scheme, table);
    if (scheme != HT_DTC3) {
        size = 1.0f;
    }
    for (leg = 0; leg < HT_LEGS; leg++) { /* currents that make up the x-y flux */
        in.i_A.p[leg] = 3.0f * (columns[leg].xy.x * x + columns[leg].xy.y * y) / cfg.observer.lxy_H;
    }
    in.vdc_V = 0.0f;
    in.torque_ref_Nm = (level > 0) ? size : -size;
    in.flux_ref_Wb = (flux_up != 0) ? 0.42f : 0.38f;
    in.turn_rad = 0.0f;
    in.inv_flux_ref2 = 1.0f / (in.flux_ref_Wb * in.flux_ref_Wb);
    ht_control_reset(&cfg, &st, &in.i_A);
    st.observer.psi_Wb.alpha = 0.4f * cosf(angle);
    st.observer.psi_Wb.beta = 0.4f * sinf(angle);
    ht_control_step(&cfg, &st, &in, false, &out);
    s[0] = st.active.s[0];
    s[1] = st.active.s[1];
    s[2] = st.active.s[2];
    check((st.sector == sector) && (st.table_law.torque_level == level)
              && (st.table_law.flux_level == flux_up),
          "demand", sector);
}

/* Angle of the x-y voltage of large vector k: 75 + 150 k degrees (states: words 48, 56, ...). */
static float large_xy_deg(unsigned k)
{
    return (float)((75u + 150u * k) % 360u);
}

static unsigned direction_of(unsigned sector, int level, int flux_up)
{
    return ht_direction(HT_TABLE_75_105, sector, level > 0, flux_up != 0);
}

static void test_decisions(void)
{
    static const ht_scheme scheme[3] = {HT_DTC1, HT_DTC2, HT_DTC3};
    ht_decisions_row r;
    unsigned n;
    for (n = 0; n < ROWS(ht_decisions_rows); n++) {
        uint16_t against[3];
        uint16_t along[3];
        float adds;
        HT_ROM_ROW(&r, &ht_decisions_rows[n]);
        adds = large_xy_deg(direction_of(r.sector, r.d_m, r.d_psi));
        decide(scheme[r.scheme], HT_TABLE_75_105, r.sector, r.d_m, r.d_psi, adds + 180.0f, against);
        decide(scheme[r.scheme], HT_TABLE_75_105, r.sector, r.d_m, r.d_psi, adds, along);
        check((against[0] == r.word_against) && (against[2] == r.word_against)
                  && (along[0] == r.word_along) && (along[2] == r.word_along),
              "decisions", n);
    }
}

/* Torque and flux to rise: the 75/105 table takes direction k in sector k - 2. */
static void test_selection(void)
{
    ht_selection_row r;
    unsigned n;
    for (n = 0; n < ROWS(ht_selection_rows); n++) {
        uint16_t dtc2[3];
        uint16_t dtc3[3];
        unsigned sector;
        float xy_deg;
        HT_ROM_ROW(&r, &ht_selection_rows[n]);
        sector = (r.k + 10u) % 12u;
        xy_deg = 30.0f * (float)r.xy_sector;
        decide(HT_DTC2, HT_TABLE_75_105, sector, 1, 1, xy_deg, dtc2);
        decide(HT_DTC3, HT_TABLE_75_105, sector, 1, 1, xy_deg, dtc3);
        check(dtc2[0] == ht_group[(r.table == 2u) ? HT_ML : HT_L][r.k], "selection", n);
        check(dtc3[0] == ht_group[(r.table == 2u) ? HT_ML : HT_S][r.k], "selection", n);
    }
}

/* Words by the step, digits by the registers. */
static void test_virtual_vectors(void)
{
    ht_virtual_vectors_row r;
    unsigned k;
    for (k = 0; k < ROWS(ht_virtual_vectors_rows); k++) {
        uint16_t s[3];
        uint16_t bit = 0x20u;
        int leg;
        HT_ROM_ROW(&r, &ht_virtual_vectors_rows[k]);
        decide(HT_FDR, HT_TABLE_75_105, (k + 10u) % 12u, 1, 1, 0.0f, s);
        check((s[0] == r.word[0]) && (s[1] == r.word[1]) && (s[2] == r.word[2]), "table_2", k);
        for (leg = 0; leg < HT_LEGS; leg++) {
            unsigned digit = (((s[0] & bit) != 0u) ? 4u : 0u) + (((s[1] & bit) != 0u) ? 2u : 0u)
                             + (((s[2] & bit) != 0u) ? 1u : 0u);
            check(digit == r.sequence[leg], "table_2", k);
            bit = (uint16_t)(bit >> 1);
        }
    }
}

int main(void)
{
    test_states();
    test_sectors();
    test_switching();
    test_duties();
    test_compare();
    test_decisions();
    test_selection();
    test_virtual_vectors();
    printf("%s\n", (failures == 0u) ? "all passed" : "failures");
    return (failures == 0u) ? 0 : 1;
}
