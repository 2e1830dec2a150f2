#include "ht_initial.h"
#include "ht_params.h"

#include "ht_schemes.h"

#include <stddef.h>

/* Names of all schemes, each behind a bar: the choices begin after the first one. */
static const char scheme_names[] =
#define HT_SCHEME(id, name, law, vectors, group, regulated, levels, reach) "|" name
#include "ht_schemes.def"
#undef HT_SCHEME
    ;
#define SCHEME_CHOICES (&scheme_names[1])
enum { LAST_SCHEME = (int)HT_SCHEMES - 1 };

static const ht_param_info table[HT_PARAMS] = {
#define HT_GROUP(name, title)
#define HT_PARAM(name, group, unit, min, max, def, when, choices, help) \
    {#name, unit, min, max, HT_DEF(name, def), HT_WHEN_##when, choices, help, sizeof(choices) > 1u},
#define HT_WHOLE(name, group, unit, min, max, def, when, help) \
    {#name, unit, min, max, HT_DEF(name, def), HT_WHEN_##when, "", help, true},
#include "ht_params.def"
#undef HT_GROUP
#undef HT_PARAM
#undef HT_WHOLE
};

uint16_t ht_param_count(void)
{
    return HT_PARAMS;
}

const ht_param_info *ht_param_describe(uint16_t id)
{
    return (id < HT_PARAMS) ? &table[id] : NULL;
}

void ht_params_default(ht_params *p)
{
    uint16_t id;
    for (id = 0u; id < HT_PARAMS; id++) {
        p->v[id] = table[id].initial;
    }
}

ht_winding ht_winding_of(const float *v)
{
    return (ht_winding)(uint16_t)v[HT_P_displacement_deg];
}

ht_rotor ht_rotor_of(const float *v)
{
    return (ht_rotor)(uint16_t)v[HT_P_machine];
}

bool ht_param_valid(uint16_t id, float value)
{
    if (id >= HT_PARAMS) {
        return false;
    }
    if (!((value >= table[id].min) && (value <= table[id].max))) {
        return false; /* NaN fails both comparisons */
    }
    /* No such parameter has a limit beyond int32_t. */
    return !table[id].whole || ((float)(int32_t)value == value);
}
