/* What the harnesses use: every value of a type, what is assumed of it, what must hold. */
#ifndef HT_PROVE_H
#define HT_PROVE_H

#include "ht_types.h"

void __ESBMC_assume(_Bool condition);
void __ESBMC_assert(_Bool condition, const char *text);

#define GIVEN(condition) __ESBMC_assume(condition)
#define MUST(condition) __ESBMC_assert(condition, #condition)
#define IMPLIES(a, b) (!(a) || (b))

/* ESBMC takes the result of a function without a body for any value of its type. Of a float: NaN
 * and infinity too. */
bool nondet_bool(void);
int16_t nondet_int16(void);
uint16_t nondet_uint16(void);
uint32_t nondet_uint32(void);
float nondet_float(void);

static inline ht_ab any_ab(void)
{
    ht_ab v;
    v.alpha = nondet_float();
    v.beta = nondet_float();
    return v;
}

static inline ht_xy any_xy(void)
{
    ht_xy v;
    v.x = nondet_float();
    v.y = nondet_float();
    return v;
}

static inline ht_six any_six(void)
{
    ht_six s;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        s.p[leg] = nondet_float();
    }
    return s;
}

/* 0 for NaN and infinity. */
static inline bool is_finite(float value)
{
    return (value - value) == 0.0f;
}

static inline bool is_nan(float value)
{
    return value != value;
}

#endif
