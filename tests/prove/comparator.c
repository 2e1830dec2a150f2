#include "ht_comparator.c"
#include "ht_contracts.h"
#include "prove.h"

void prove_two_level(void)
{
    int16_t last = nondet_int16();
    int16_t low = nondet_int16();
    int16_t high = nondet_int16();
    float error = nondet_float();
    float band = nondet_float();
    int16_t got;
    GIVEN(band >= 0.0f);
    got = ht_compare_two_level(last, error, band, low, high);
    MUST(IMPLIES(error > band, got == high));
    MUST(IMPLIES(error < -band, got == low));
    MUST(IMPLIES(is_nan(error) || ((error <= band) && (error >= -band)), got == last));
}

void prove_three_level(void)
{
    int16_t last = nondet_int16();
    float error = nondet_float();
    float band = nondet_float();
    float release = nondet_float();
    int16_t as_one;
    int16_t got;
    GIVEN(HT_IS_LEVEL(last, 2) && (band > 0.0f) && (release < band) && (release > -band));
    as_one = (last > 0) ? 1 : ((last < 0) ? -1 : 0);
    got = ht_compare_three_level(last, error, band, release);
    MUST(HT_IS_LEVEL(got, 1));
    MUST(IMPLIES(error >= band, got == 1));
    MUST(IMPLIES(error <= -band, got == -1));
    MUST(IMPLIES(is_nan(error), got == as_one));
    MUST(IMPLIES((error < band) && (error > -band), (got == as_one) || (got == 0)));
    MUST(IMPLIES((error < band) && (error > -band) && (as_one == 1),
                 (got == 0) == (error <= release)));
    MUST(IMPLIES((error < band) && (error > -band) && (as_one == -1),
                 (got == 0) == (error >= -release)));
}

void prove_five_level(void)
{
    int16_t last = nondet_int16();
    float error = nondet_float();
    float inner = nondet_float();
    float outer = nondet_float();
    int16_t got;
    GIVEN(HT_IS_LEVEL(last, 2) && (inner >= 0.0f) && (inner <= outer));
    got = ht_compare_five_level(last, error, inner, outer);
    MUST(HT_IS_LEVEL(got, 2));
    MUST(IMPLIES(is_nan(error), got == last));
    MUST(IMPLIES(error > 0.0f, got >= 0)); /* never against the error */
    MUST(IMPLIES(error < 0.0f, got <= 0));
    MUST(IMPLIES(error == 0.0f, got == 0));
    MUST(IMPLIES((error > 0.0f) && (error >= outer), got == 2));
    MUST(IMPLIES((error < 0.0f) && (error <= -outer), got == -2));
    /* level 2 needs `inner` to be held and `outer` to be reached */
    MUST(IMPLIES((got == 2) && (error < outer), (last == 2) && (error > inner)));
    MUST(IMPLIES((got == -2) && (error > -outer), (last == -2) && (error < -inner)));
}
