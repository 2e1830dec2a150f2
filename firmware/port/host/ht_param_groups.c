#include "ht_param_groups.h"

#include "ht_params.h"

#include <stddef.h>

enum {
#define HT_GROUP(name, title) GROUP_##name,
#define HT_PARAM(name, group, unit, min, max, def, when, choices, help)
#define HT_WHOLE(name, group, unit, min, max, def, when, help)
#include "ht_params.def"
#undef HT_GROUP
#undef HT_PARAM
#undef HT_WHOLE
    GROUPS
};

static const char *const titles[GROUPS] = {
#define HT_GROUP(name, title) title,
#define HT_PARAM(name, group, unit, min, max, def, when, choices, help)
#define HT_WHOLE(name, group, unit, min, max, def, when, help)
#include "ht_params.def"
#undef HT_GROUP
#undef HT_PARAM
#undef HT_WHOLE
};

static const uint16_t group_of[HT_PARAMS] = {
#define HT_GROUP(name, title)
#define HT_PARAM(name, group, unit, min, max, def, when, choices, help) (uint16_t)GROUP_##group,
#define HT_WHOLE(name, group, unit, min, max, def, when, help) (uint16_t)GROUP_##group,
#include "ht_params.def"
#undef HT_GROUP
#undef HT_PARAM
#undef HT_WHOLE
};

uint16_t ht_group_count(void)
{
    return GROUPS;
}

const char *ht_group_title(uint16_t group)
{
    return (group < GROUPS) ? titles[group] : NULL;
}

uint16_t ht_param_group(uint16_t id)
{
    return (id < HT_PARAMS) ? group_of[id] : (uint16_t)GROUPS;
}
