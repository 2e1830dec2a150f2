/* The facts of arithmetic.h, of the operations as the machine carries them out. */
#include "prove.h"

#undef HT_FACT
#define HT_FACT(condition, fact) MUST(IMPLIES(condition, fact))

static float sum_of(float a, float b)
{
    return a + b;
}

static float product_of(float a, float b)
{
    return a * b;
}

static float ratio_of(float a, float b)
{
    return a / b;
}

void prove_fact_add(void)
{
    float a = nondet_float();
    float b = nondet_float();
    float sum = sum_of(a, b);
    MUST(IMPLIES(!is_nan(a) && !is_nan(b), (a - b == a + -b) || is_nan(a - b)));
    HT_FACTS_OF_ADD(a, b, sum);
}

void prove_fact_multiply(void)
{
    float a = nondet_float();
    float b = nondet_float();
    float product = product_of(a, b);
    HT_FACTS_OF_MULTIPLY(a, b, product);
}

void prove_fact_divide(void)
{
    float a = nondet_float();
    float b = nondet_float();
    float ratio = ratio_of(a, b);
    HT_FACTS_OF_DIVIDE(a, b, ratio);
}
