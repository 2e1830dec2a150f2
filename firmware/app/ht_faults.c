#include "ht_faults.h"

#include <stddef.h>

static const ht_fault_info table[] = {
#define HT_FAULT(name, bit, text, help) {(bit), text, help},
#include "ht_faults.def"
#undef HT_FAULT
};

static const ht_fault_info warnings[] = {
#define HT_WARNING(name, bit, text, help) {(bit), text, help},
#include "ht_warnings.def"
#undef HT_WARNING
};

#define FAULTS ((uint16_t)(sizeof table / sizeof table[0]))
#define WARNINGS ((uint16_t)(sizeof warnings / sizeof warnings[0]))

uint16_t ht_fault_count(void)
{
    return FAULTS;
}

const ht_fault_info *ht_fault_describe(uint16_t row)
{
    return (row < FAULTS) ? &table[row] : NULL;
}

uint16_t ht_warning_count(void)
{
    return WARNINGS;
}

const ht_fault_info *ht_warning_describe(uint16_t row)
{
    return (row < WARNINGS) ? &warnings[row] : NULL;
}
