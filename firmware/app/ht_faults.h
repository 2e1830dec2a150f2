/** @file ht_faults.h
 *  Fault bits, latched by the drive until `ht_drive_clear`, and warning bits, and what they mean.
 *  A word of faults has 32 bits. The fast interrupt's own checks find the first sixteen only.
 */
#ifndef HT_FAULTS_H
#define HT_FAULTS_H

#include <stdint.h>

#define HT_FAULT_ENUMERATORS
enum {
#define HT_FAULT(name, bit, text, help) HT_FAULT_##name = (bit),
#include "ht_faults.def"
#undef HT_FAULT
};
#undef HT_FAULT_ENUMERATORS
#define HT_FAULT_PHASE 0x8000u
#define HT_FAULT_WINDING 0x10000u
#define HT_FAULT_WINDING_OPEN 0x20000u
#define HT_FAULT_WINDING_SHORT 0x40000u
#define HT_FAULT_SINK_OPEN 0x80000u
#define HT_FAULT_SINK_SHORT 0x100000u
#define HT_FAULT_DEVICE 0x200000u
#define HT_FAULT_ABSOLUTE 0x400000u

enum {
#define HT_WARNING(name, bit, text, help) HT_WARNING_##name = (bit),
#include "ht_warnings.def"
#undef HT_WARNING
};

/** The part of a word of faults that is in the replies' head and the snapshot. */
#define HT_LOW_FAULTS(bits) ((uint16_t)((bits) & 0xFFFFu))

typedef struct {
    uint32_t bit;
    const char *name;
    const char *help;
} ht_fault_info;

uint16_t ht_fault_count(void);
/** Table entry, or NULL if there is no such row. */
const ht_fault_info *ht_fault_describe(uint16_t row);

/** The same for warnings. */
uint16_t ht_warning_count(void);
const ht_fault_info *ht_warning_describe(uint16_t row);

#endif
