#include "ht_schemes.h"

#include "ht_tables.h"

#include <stddef.h>

/* Parts of the vectors in x-y, units of Vdc. What is longest in alpha-beta is shortest here. */
#define XY_LARGE_PU 0.172546f
#define XY_MEDIUM_PU 0.471405f
#define XY_SMALL_PU LONGEST_PU
#define XY_RIPPLE_PU 0.168f
#define LONGEST_PU 0.643951f
#define LONGEST_ALIKE_PU 0.666667f

static const ht_scheme_info table[HT_SCHEMES] = {
#define HT_SCHEME(id, name, law, vectors, group, regulated, levels, reach) \
    {HT_LAW_##law, HT_VECTORS_##vectors, HT_##group, (regulated) != 0, levels, reach},
#include "ht_schemes.def"
#undef HT_SCHEME
};

const ht_scheme_info *ht_scheme_describe(uint16_t scheme)
{
    return (scheme < (uint16_t)HT_SCHEMES) ? &table[scheme] : NULL;
}

bool ht_law_commands_voltage(ht_law law)
{
    static const bool commands[HT_LAWS] = {
#define HT_VECTOR_LAW(id, law) false,
#define HT_VOLTAGE_LAW(id, law) true,
#define HT_PATTERN_LAW HT_VOLTAGE_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    };
    return ((unsigned)law < (unsigned)HT_LAWS) && commands[law];
}

bool ht_scheme_regulates_xy(const ht_scheme_info *row)
{
    return row->regulated || ht_law_commands_voltage(row->law);
}

float ht_scheme_xy_limit_pu(const ht_scheme_info *row)
{
    return row->regulated ? ht_tmvcl_pu[row->group] : 0.0f;
}

bool ht_scheme_drives(const ht_scheme_info *row, ht_winding winding)
{
    return (winding == HT_WINDING_30) || (row->vectors == HT_VECTORS_SINGLE)
           || (row->vectors == HT_VECTORS_MODULATED) || (row->vectors == HT_VECTORS_CENTRED);
}

float ht_longest_pu(ht_winding winding)
{
    return (winding == HT_WINDING_30) ? LONGEST_PU : LONGEST_ALIKE_PU;
}

float ht_scheme_xy_ripple_pu(const ht_scheme_info *row)
{
    return (row->vectors == HT_VECTORS_INTERLEAVED) ? XY_RIPPLE_PU : 0.0f;
}

float ht_scheme_xy_step_pu(const ht_scheme_info *row, ht_winding winding)
{
    if (winding != HT_WINDING_30) {
        return 0.0f;
    }
    switch (row->vectors) {
    case HT_VECTORS_SINGLE:
        return XY_LARGE_PU;
    case HT_VECTORS_PAIR:
    case HT_VECTORS_MODULATED:
    case HT_VECTORS_INTERLEAVED:
        return XY_MEDIUM_PU;
    case HT_VECTORS_PAIR_SMALL:
        return XY_SMALL_PU;
    default:
        return ((row->group == HT_L) ? XY_LARGE_PU : XY_MEDIUM_PU) / 3.0f;
    }
}
