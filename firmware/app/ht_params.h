/** @file ht_params.h
 *  Parameter table access. Values are floats; named choices are whole numbers.
 */
#ifndef HT_PARAMS_H
#define HT_PARAMS_H

#include "ht_rotor.h"
#include "ht_types.h"

#include <stdbool.h>
#include <stdint.h>

/** Parameter ids: HT_P_<name>, in table order; HT_PARAMS is their number. */
enum {
#define HT_GROUP(name, title)
#define HT_PARAM(name, group, unit, min, max, def, when, choices, help) HT_P_##name,
#define HT_WHOLE(name, group, unit, min, max, def, when, help) HT_P_##name,
#include "ht_params.def"
#undef HT_GROUP
#undef HT_PARAM
#undef HT_WHOLE
    HT_PARAMS
};

/** When a parameter may change. */
enum { HT_WHEN_LIVE = 0, HT_WHEN_IDLE = 1 };

typedef struct {
    const char *name;
    const char *unit;
    float min;
    float max;
    float initial;
    uint16_t when;       /**< HT_WHEN_... */
    const char *choices; /**< "" or the names of values 0, 1, ..., joined by '|' */
    const char *help;
    bool whole; /**< takes whole numbers only; so does every choice */
} ht_param_info;

/** All parameter values, by id. */
typedef struct {
    float v[HT_PARAMS];
} ht_params;

uint16_t ht_param_count(void);
/** Table entry, or NULL if there is no such id. */
const ht_param_info *ht_param_describe(uint16_t id);
void ht_params_default(ht_params *p);
/** The winding in the parameter values `v`, by id. */
ht_winding ht_winding_of(const float *v);

/** And the kind of rotor. */
ht_rotor ht_rotor_of(const float *v);

/** True if `value` is finite, in range and, where the table says so, whole. */
bool ht_param_valid(uint16_t id, float value);

#endif
