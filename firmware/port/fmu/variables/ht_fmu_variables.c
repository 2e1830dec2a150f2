#include "ht_fmu_variables.h"

#include <stddef.h>

#include "ht_drive.h"

static const ht_fmu_info rows[HT_FMU_ROWS] = {
#define HT_FMU_ONE(id, name, of, direction, kind, unit, help) \
    {name, HT_FMU_##of, HT_FMU_##direction, HT_FMU_##kind, unit, help},
#define HT_FMU_LEGS(id, before, after, of, direction, kind, unit, help)                  \
    {before "u1" after, HT_FMU_##of, HT_FMU_##direction, HT_FMU_##kind, unit, help},     \
        {before "u2" after, HT_FMU_##of, HT_FMU_##direction, HT_FMU_##kind, unit, help}, \
        {before "w1" after, HT_FMU_##of, HT_FMU_##direction, HT_FMU_##kind, unit, help}, \
        {before "w2" after, HT_FMU_##of, HT_FMU_##direction, HT_FMU_##kind, unit, help}, \
        {before "v1" after, HT_FMU_##of, HT_FMU_##direction, HT_FMU_##kind, unit, help}, \
        {before "v2" after, HT_FMU_##of, HT_FMU_##direction, HT_FMU_##kind, unit, help},
#include "ht_fmu.def"
#undef HT_FMU_ONE
#undef HT_FMU_LEGS
};

const ht_fmu_info *ht_fmu_describe(uint16_t row)
{
    return (row < HT_FMU_ROWS) ? &rows[row] : NULL;
}

static bool times_the_plant(uint16_t id)
{
    return (id == HT_P_f_isr_Hz) || (id == HT_P_f_slow_Hz) || (id == HT_P_load_mode)
           || (id == HT_P_write_delay_us);
}

static uint16_t kind_of_parameter(uint16_t of, uint16_t id)
{
    const ht_param_info *row = ht_param_describe(id);
    if ((row == NULL) || (id == HT_P_speed_ref_rpm) || (id == HT_P_torque_ref_Nm)
        || ((of == (uint16_t)HT_FMU_DRIVE) && times_the_plant(id))) {
        return HT_FMU_UNKNOWN;
    }
    if (row->choices[0] != '\0') {
        return HT_FMU_CHOICE;
    }
    return row->whole ? HT_FMU_WHOLE : HT_FMU_REAL;
}

uint16_t ht_fmu_kind(uint16_t of, uint32_t reference)
{
    if (reference < HT_FMU_ROWS) {
        return ((rows[reference].of & of) != 0u) ? rows[reference].kind : HT_FMU_UNKNOWN;
    }
    if (reference < HT_FMU_CHANNEL) {
        return HT_FMU_UNKNOWN;
    }
    if (reference == HT_FMU_TIME) {
        return HT_FMU_REAL;
    }
    if (reference < HT_FMU_PARAMETER) {
        return ((reference - HT_FMU_CHANNEL) < ht_channel_count()) ? HT_FMU_REAL : HT_FMU_UNKNOWN;
    }
    if (reference - HT_FMU_PARAMETER >= ht_param_count()) {
        return HT_FMU_UNKNOWN;
    }
    return kind_of_parameter(of, (uint16_t)(reference - HT_FMU_PARAMETER));
}
