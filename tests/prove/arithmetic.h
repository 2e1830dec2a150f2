/* Operations of floats that are free: they give any result, but for some facts that hold for the
 * right one. tools/prove.py puts them where a proof asks for it. facts.c proves the facts, all but
 * those called *rounded*. These follow from the rule of IEEE 754 that a result is the exact one,
 * rounded, and that of two numbers the smaller one is not rounded to the larger value; a solver
 * takes too long for them. */
#ifndef HT_PROVE_ARITHMETIC_H
#define HT_PROVE_ARITHMETIC_H

void __ESBMC_assume(_Bool condition);
float nondet_float(void);

#ifdef HT_NO_FACTS /* an option of proofs that need none */
#define HT_FACT(condition, fact)
#else
#define HT_FACT(condition, fact) __ESBMC_assume(!(condition) || (fact))
#endif
#define HT_ABS(a) (((a) < 0.0f) ? -(a) : (a))
#define HT_LARGEST 3.4e38f

/* NaN stays NaN. Two numbers of one sign give one of this sign that is no smaller than either, two of
 * different signs one between them. */
#define HT_FACTS_OF_ADD(a, b, sum)                                                         \
    HT_FACT(((a) != (a)) || ((b) != (b)), (sum) != (sum));                                 \
    HT_FACT(((a) >= 0.0f) && ((b) >= 0.0f), ((sum) >= (a)) && ((sum) >= (b)));             \
    HT_FACT(((a) <= 0.0f) && ((b) <= 0.0f), ((sum) <= (a)) && ((sum) <= (b)));             \
    HT_FACT(((a) <= HT_LARGEST) && ((a) >= 0.0f) && ((b) <= 0.0f) && ((b) >= -HT_LARGEST), \
            ((sum) <= (a)) && ((sum) >= (b)))

/* NaN stays NaN. No square is negative, nor a product of two numbers that are not; 0 times infinity
 * is NaN. */
#define HT_FACTS_OF_MULTIPLY(a, b, product)                        \
    HT_FACT(((a) != (a)) || ((b) != (b)), (product) != (product)); \
    HT_FACT((a) == (b), (product) >= 0.0f);                        \
    HT_FACT(((a) >= 0.0f) && ((b) >= 0.0f), !((product) < 0.0f));  \
    HT_FACT((HT_ABS(a) <= HT_LARGEST) && (HT_ABS(b) <= HT_LARGEST), (product) == (product))

/* NaN stays NaN. Of two numbers that are not negative the ratio is not; 0 by 0 and infinity by
 * infinity are NaN. */
#define HT_FACTS_OF_DIVIDE(a, b, ratio)                        \
    HT_FACT(((a) != (a)) || ((b) != (b)), (ratio) != (ratio)); \
    HT_FACT(((a) >= 0.0f) && ((b) > 0.0f), !((ratio) < 0.0f)); \
    HT_FACT((HT_ABS(a) <= HT_LARGEST) && (HT_ABS(b) > 0.0f), (ratio) == (ratio))

/* Rounded: factors up to these magnitudes give a product up to their product. Set by a harness. */
static float ht_most[3][2] = {{-1.0f, -1.0f}, {-1.0f, -1.0f}, {-1.0f, -1.0f}};

/* Rounded: a magnitude from `above` on has a square from `above_square` on, one up to `below` has
 * one up to `below_square`. Set by a harness. As they are they say that no square is negative. */
static float ht_above = -1.0f;
static float ht_above_square = 0.0f;
static float ht_below = -1.0f;
static float ht_below_square = 0.0f;

/* Rounded: what lies between two numbers gives with a third one a sum between theirs. Set by a
 * harness. */
static float ht_summand = -1.0f;
static float ht_from[2];
static float ht_sum[2];

/* For a harness that says something about a sum. */
static float ht_last_sum;

static inline float ht_free_add(float a, float b)
{
    float sum = nondet_float();
    HT_FACTS_OF_ADD(a, b, sum);
    HT_FACT((b == ht_summand) && (a >= ht_from[0]), sum >= ht_sum[0]);
    HT_FACT((b == ht_summand) && (a <= ht_from[1]), sum <= ht_sum[1]);
    ht_last_sum = sum;
    return sum;
}

static inline float ht_free_subtract(float a, float b)
{
    return ht_free_add(a, -b);
}

static inline float ht_free_multiply(float a, float b)
{
    float product = nondet_float();
    HT_FACTS_OF_MULTIPLY(a, b, product);
    /* Rounded: what is multiplied by 0 ... 1 gets no larger. */
    HT_FACT((HT_ABS(a) <= 1.0f) && (HT_ABS(b) <= HT_LARGEST), HT_ABS(product) <= HT_ABS(b));
    HT_FACT((HT_ABS(b) <= 1.0f) && (HT_ABS(a) <= HT_LARGEST), HT_ABS(product) <= HT_ABS(a));
    HT_FACT((HT_ABS(a) <= ht_most[0][0]) && (HT_ABS(b) <= ht_most[0][1]),
            HT_ABS(product) <= (ht_most[0][0] * ht_most[0][1]));
    HT_FACT((HT_ABS(a) <= ht_most[1][0]) && (HT_ABS(b) <= ht_most[1][1]),
            HT_ABS(product) <= (ht_most[1][0] * ht_most[1][1]));
    HT_FACT((HT_ABS(a) <= ht_most[2][0]) && (HT_ABS(b) <= ht_most[2][1]),
            HT_ABS(product) <= (ht_most[2][0] * ht_most[2][1]));
    if (a == b) {
        HT_FACT(HT_ABS(a) >= ht_above, product >= ht_above_square);
        HT_FACT(HT_ABS(a) <= ht_below, product <= ht_below_square);
    }
    return product;
}

static inline float ht_free_divide(float a, float b)
{
    float ratio = nondet_float();
    HT_FACTS_OF_DIVIDE(a, b, ratio);
    /* Rounded: what is divided by 1 or more gets no larger. */
    HT_FACT((HT_ABS(b) >= 1.0f) && (HT_ABS(a) <= HT_LARGEST), HT_ABS(ratio) <= HT_ABS(a));
    return ratio;
}

#endif
