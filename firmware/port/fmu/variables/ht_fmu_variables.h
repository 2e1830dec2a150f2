/** @file ht_fmu_variables.h
 *  The variables of the FMUs by their value references: inputs and outputs (ht_fmu.def),
 *  channels (ht_channels.def) and parameters (ht_params.def).
 */
#ifndef HT_FMU_VARIABLES_H
#define HT_FMU_VARIABLES_H

#include <stdint.h>

/** Value references of inputs and outputs: HT_FMU_<id>, for legs that of the first one. */
enum {
#define HT_FMU_ONE(id, name, of, direction, kind, unit, help) HT_FMU_##id,
#define HT_FMU_LEGS(id, before, after, of, direction, kind, unit, help) \
    HT_FMU_##id, HT_FMU_##id##_LAST = HT_FMU_##id + 5,
#include "ht_fmu.def"
#undef HT_FMU_ONE
#undef HT_FMU_LEGS
    HT_FMU_ROWS,
    HT_FMU_CHANNEL = 0x1000,   /**< value reference of channel 0 */
    HT_FMU_PARAMETER = 0x2000, /**< of parameter 0 */
    HT_FMU_TIME = 0x3000       /**< of the time, the independent variable */
};

/** Kinds of variables. A choice is a whole number with names. */
enum { HT_FMU_REAL, HT_FMU_FLAG, HT_FMU_WHOLE, HT_FMU_CHOICE, HT_FMU_UNKNOWN };

enum { HT_FMU_INPUT, HT_FMU_OUTPUT };

/** Kinds of FMUs, bits: the controller alone, and the drive with its plant. */
enum { HT_FMU_CONTROLLER = 1, HT_FMU_DRIVE = 2, HT_FMU_BOTH = 3 };

typedef struct {
    const char *name;
    uint16_t of;
    uint16_t direction;
    uint16_t kind;
    const char *unit;
    const char *help;
} ht_fmu_info;

/** Row of ht_fmu.def, legs one by one; NULL if there is none. */
const ht_fmu_info *ht_fmu_describe(uint16_t row);

/** Kind of a channel, a parameter or a row in an FMU `of` this kind; HT_FMU_UNKNOWN if it has no such
 *  variable. Parameters that are inputs are none of the variables, nor are those with which the
 *  drive's plant is timed. */
uint16_t ht_fmu_kind(uint16_t of, uint32_t reference);

#endif
