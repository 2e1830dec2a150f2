#include "ht_schemes.h"

#include "ht_tables.h"

#include <stddef.h>

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
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
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
