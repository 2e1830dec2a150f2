#include "ht_lost_legs.c"
#include "ht_set_difference.c"
#include "ht_tables.c"
#include "ht_vsd.c"
#include "law_input.h"

static ht_winding any_winding(void)
{
    ht_winding winding = (ht_winding)nondet_uint16();
    GIVEN((unsigned)winding < HT_WINDINGS);
    return winding;
}

static unsigned bits(unsigned word)
{
    unsigned n = 0u;
    int bit;
    for (bit = 0; bit < HT_LEGS; bit++) {
        n += (word >> bit) & 1u;
    }
    return n;
}

/* What must be off, for every word that a parameter or a fault could give. */
void prove_lost_legs(void)
{
    ht_lost_legs lost;
    uint16_t legs = nondet_uint16();
    uint16_t off = ht_lost_legs_of(any_winding(), legs, &lost);
    MUST((lost.axes <= 2u) && ((off == 0u) == (lost.axes == 0u)));
    MUST((off & ~HT_ALL_LEGS) == 0u);
    MUST(IMPLIES(off != 0u, (off & legs) == legs)); /* a lost leg is never left on */
    MUST(IMPLIES((legs == 0u) || (legs > HT_ALL_LEGS), off == 0u));
    MUST(IMPLIES(lost.axes == 1u, bits(off) == 1u));
    MUST(IMPLIES(bits(off) > 3u, false));
    MUST(IMPLIES(lost.axes != 0u, lost.set == (bits(off) == 3u)));
    ht_lost_legs_differ(&lost, nondet_float());
    /* No voltage is read or written beyond the axes. */
    (void)ht_lost_legs_across(&lost, any_xy());
}

void prove_lost_legs_paired(void)
{
    ht_winding winding = any_winding();
    uint16_t legs = nondet_uint16();
    uint16_t off;
    GIVEN(legs <= HT_ALL_LEGS);
    off = ht_lost_legs_paired(winding, legs);
    MUST((off & legs) == legs);
    MUST(bits(off) == (((bits(legs) == 1u) && (winding == HT_WINDING_30)) ? 2u : bits(legs)));
}

/* The voltages, for the axes of every word. */
void prove_lost_legs_voltages(void)
{
    ht_lost_legs lost;
    ht_observer_config machine = any_law_machine();
    ht_voltage_law_input in = any_law_input();
    ht_vsd v;
    v.ab = any_ab();
    v.xy = any_xy();
    (void)ht_lost_legs_of(any_winding(), nondet_uint16(), &lost);
    ht_lost_legs_differ(&lost, nondet_float());
    (void)ht_lost_legs_voltage(&lost, &machine, nondet_float(), v, any_xy(), any_xy());
    (void)ht_lost_legs_expected(&lost, &machine, nondet_float(), v, any_ab(), any_ab(),
                                nondet_float());
    (void)ht_lost_legs_command(&lost, &machine, &in, v);
}

/* What is learnt is a number within its limit, from any sample and mean. */
void prove_set_difference(void)
{
    ht_set_difference_config cfg;
    ht_set_difference st;
    ht_set_difference was;
    float most_ohm = nondet_float();
    ht_xy low_V = any_xy();
    cfg.gain = nondet_float();
    cfg.slow_gain = nondet_float();
    cfg.least_A2 = nondet_float();
    st.power_W = nondet_float();
    st.i2_A2 = nondet_float();
    st.ohm = nondet_float();
    GIVEN((st.ohm > -most_ohm) && (st.ohm < most_ohm));
    was = st;
    ht_set_difference_learn(&cfg, &st, any_ab(), low_V, nondet_float(), most_ohm);
    MUST((st.ohm > -most_ohm) && (st.ohm < most_ohm));
    MUST(IMPLIES(is_nan(low_V.x), st.ohm == was.ohm));
    ht_set_difference_begin(&st);
    MUST((st.power_W == 0.0f) && (st.i2_A2 == 0.0f));
}
