#include "ht_comparator.h"

int16_t ht_compare_two_level(int16_t last, float error, float band, int16_t low, int16_t high)
{
    if (error > band) {
        return high;
    }
    if (error < -band) {
        return low;
    }
    return last;
}

int16_t ht_compare_three_level(int16_t last, float error, float band, float release)
{
    if (error >= band) {
        return 1;
    }
    if (error <= -band) {
        return -1;
    }
    if (((last > 0) && (error <= release)) || ((last < 0) && (error >= -release))) {
        return 0;
    }
    /* Between the thresholds, or NaN. */
    return (last > 0) ? (int16_t)1 : ((last < 0) ? (int16_t)-1 : (int16_t)0);
}

/* The five-level comparator is an odd function of the error and never keeps a
 * level against its sign, so only the positive half is written out. */

static int16_t five_level_half(int16_t last, float error, float inner, float outer)
{
    if (error >= outer) {
        return 2;
    }
    if (((last == 0) && (error >= inner)) || ((last == 2) && (error <= inner))) {
        return 1;
    }
    return last;
}

int16_t ht_compare_five_level(int16_t last, float error, float inner, float outer)
{
    if (error > 0.0f) {
        return five_level_half((last > 0) ? last : (int16_t)0, error, inner, outer);
    }
    if (error < 0.0f) {
        int16_t mirrored = (last < 0) ? (int16_t)-last : (int16_t)0;
        return (int16_t)-five_level_half(mirrored, -error, inner, outer);
    }
    return (error == 0.0f) ? (int16_t)0 : last;
}
