/** @file ht_law_setting.h
 *  The values from which a law configures itself.
 */
#ifndef HT_LAW_SETTING_H
#define HT_LAW_SETTING_H

#include "ht_observer.h"
#include "ht_schemes.h"

typedef struct {
    const ht_scheme_info *scheme;      /**< row of the scheme in use, one of the law's */
    const ht_observer_config *machine; /**< and the sampling period */
/* Parameters, each in its range; a choice is its number. */
#define HT_LAW_PARAMETER(name) float name;
#include "ht_law_parameters.def"
#undef HT_LAW_PARAMETER
} ht_law_setting;

#endif
