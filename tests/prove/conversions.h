/* tools/prove.py puts one of these around every operand that the firmware converts from float to
 * an integer. The conversion is undefined if the value, less its fraction, is not in the type's
 * range; NaN is in none. */
#ifndef HT_PROVE_CONVERSIONS_H
#define HT_PROVE_CONVERSIONS_H

void __ESBMC_assert(_Bool condition, const char *text);

static inline float ht_in_uint16(float value)
{
    __ESBMC_assert((value > -1.0f) && (value < 65536.0f), "float to 16 bits, unsigned");
    return value;
}

static inline float ht_in_int16(float value)
{
    __ESBMC_assert((value > -32769.0f) && (value < 32768.0f), "float to 16 bits, signed");
    return value;
}

static inline float ht_in_uint32(float value)
{
    __ESBMC_assert((value > -1.0f) && (value < 4294967296.0f), "float to 32 bits, unsigned");
    return value;
}

static inline float ht_in_int32(float value)
{
    __ESBMC_assert((value >= -2147483648.0f) && (value < 2147483648.0f),
                   "float to 32 bits, signed");
    return value;
}

#endif
