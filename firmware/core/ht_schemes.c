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

bool ht_law_needs_prediction(ht_law law)
{
    return (law == HT_LAW_DEADBEAT) || (law == HT_LAW_FOC);
}

float ht_scheme_xy_limit_pu(const ht_scheme_info *row)
{
    return row->regulated ? ht_tmvcl_pu[row->group] : 0.0f;
}
