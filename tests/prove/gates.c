/* The dead band of a PWM module with one input: a gate follows its level of the input when this has
 * lasted for the register's counts. One count from any state that earlier ones can have left, with
 * any input: every pattern is a sequence of these. */
#include "prove.h"

void prove_gates(void)
{
    uint16_t dead = nondet_uint16();
    uint32_t high_for = nondet_uint32(); /* counts since the input is high; 0: low */
    uint32_t low_for = nondet_uint32();
    uint32_t upper_off_for = nondet_uint32(); /* counts */
    uint32_t lower_off_for = nondet_uint32();
    bool upper;
    bool lower;
    GIVEN((high_for == 0u) != (low_for == 0u));
    GIVEN((high_for < 0x80000000u) && (low_for < 0x80000000u));
    GIVEN((upper_off_for < 0x80000000u) && (lower_off_for < 0x80000000u));
    GIVEN((upper_off_for >= low_for) && (lower_off_for >= high_for));
    if (nondet_bool()) {
        high_for++;
        low_for = 0u;
    } else {
        low_for++;
        high_for = 0u;
    }
    upper = high_for > dead;
    lower = low_for > dead;
    upper_off_for = upper ? 0u : (upper_off_for + 1u);
    lower_off_for = lower ? 0u : (lower_off_for + 1u);
    MUST((upper_off_for >= low_for) && (lower_off_for >= high_for));
    MUST(!(upper && lower));
    /* Both are off for at least as many counts before one comes on. */
    MUST(IMPLIES(lower, upper_off_for > dead));
    MUST(IMPLIES(upper, lower_off_for > dead));
}
