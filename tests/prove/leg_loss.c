#include "ht_contracts.h"
#include "ht_leg_loss.c"
#include "prove.h"

unsigned ht_sector(ht_ab v)
{
    unsigned sector = nondet_uint16();
    GIVEN(HT_IS_SECTOR(sector));
    return sector;
}

/* One period from any state that an earlier one can have left. */
void prove_leg_loss(void)
{
    ht_leg_loss_config cfg;
    ht_leg_loss_state st;
    ht_leg_loss_state was;
    ht_xy v = any_xy();
    ht_xy to = any_xy();
    ht_six i_A = any_six();
    int leg;
    cfg.least_V2 = nondet_float();
    cfg.gain = nondet_float();
    cfg.l_per_ts_ohm = nondet_float();
    cfg.sum_A = nondet_float();
    cfg.hold = nondet_uint16();
    cfg.wait = nondet_uint16();
    st.low_V = any_xy();
    st.low_A2 = nondet_float();
    st.tolerance_ohm2 = nondet_float();
    st.direction = nondet_uint16();
    st.count = nondet_uint16();
    st.wait = nondet_uint16();
    st.found = nondet_uint16();
    st.leg_A = nondet_float();
    for (leg = 0; leg < HT_LEGS; leg++) {
        st.sum_A[leg] = nondet_float();
    }
    st.without = nondet_uint16();
    st.sum_V = any_xy();
    GIVEN((cfg.hold < 0xFFFFu) && (st.count <= (cfg.hold + 1u)) && (st.wait <= cfg.wait)
          && (cfg.wait >= 1u));
    GIVEN(HT_IS_SECTOR(st.direction) && (st.found <= 12u));
    was = st;
    ht_leg_loss_step(&cfg, &st, v, any_xy(), to, &i_A, nondet_float());
    MUST((st.count <= (cfg.hold + 1u)) && (st.wait <= cfg.wait));
    MUST(HT_IS_SECTOR(st.direction) && (st.found <= 12u));
    MUST(IMPLIES(was.found != 0u, st.found == was.found)); /* the first one counts */
    MUST(IMPLIES(st.found != was.found, st.found == (was.direction + 1u)));
    MUST(IMPLIES(st.found != was.found, (was.count == (cfg.hold + 1u)) && (was.wait <= 1u)));
    /* Not a number shows no loss: other checks see it. */
    MUST(IMPLIES(is_nan(v.x) || is_nan(to.y), (st.found == was.found) && (st.count == 0u)));
    MUST(IMPLIES((was.without == 0u) && is_nan(i_A.p[3]), st.found == was.found));
    MUST(st.without == was.without);
}

void prove_leg_loss_begin(void)
{
    ht_leg_loss_state st;
    ht_leg_loss_reset(&st);
    MUST((st.count == 0u) && (st.wait == 0u) && (st.direction == 0u) && (st.found == 0u));
    MUST(st.without == 0u);
    MUST((st.low_V.x == 0.0f) && (st.low_V.y == 0.0f) && (st.low_A2 == 0.0f));
    ht_leg_loss_tolerate(&st, nondet_float(), nondet_float(), nondet_float());
    MUST(!(st.tolerance_ohm2 < 0.0f)); /* it never makes a residual count that is too small */
}

/* Five times a phase's angle is the direction in which its lower switch shows, and the opposite
 * one that of the upper switch. */
void prove_leg_loss_of(void)
{
    static const uint16_t angle[HT_LEGS] = {0u, 1u, 4u, 5u, 8u, 9u}; /* times 30 degrees */
    uint16_t direction = nondet_uint16();
    ht_leg_loss loss;
    GIVEN(HT_IS_SECTOR(direction));
    loss = ht_leg_loss_of(direction);
    MUST(loss.leg < HT_LEGS);
    MUST(direction == ((5u * angle[loss.leg] + (loss.lower ? 0u : 6u)) % 12u));
}
