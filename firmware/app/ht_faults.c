#include "ht_faults.h"

#include <stddef.h>

static const ht_fault_info table[] = {
#define HT_FAULT(name, bit, text, help) {(bit), text, help},
#include "ht_faults.def"
#undef HT_FAULT
};

#define FAULTS ((uint16_t)(sizeof table / sizeof table[0]))

uint16_t ht_fault_count(void)
{
    return FAULTS;
}

const ht_fault_info *ht_fault_describe(uint16_t row)
{
    return (row < FAULTS) ? &table[row] : NULL;
}
