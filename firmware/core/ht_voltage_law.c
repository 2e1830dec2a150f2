#include "ht_rotors.h"

/* Gain of the x-y integrators, per period, of the voltage that would take the x-y current away at
 * once. */
#define XY_INTEGRAL 0.008f

float ht_voltage_law_least_Hz(float rs_ohm, float sigma_ls_H, float lxy_H)
{
    return HT_LEAST_SAMPLES * rs_ohm / ((lxy_H < sigma_ls_H) ? lxy_H : sigma_ls_H);
}

bool ht_voltage_law_fast_enough(const ht_observer_config *machine)
{
    float l_H = HT_ROTOR_DOES(machine->rotor, d_H, (machine));
    return machine->inv_ts >= ht_voltage_law_least_Hz(machine->rs_ohm, l_H, machine->lxy_H);
}

float ht_voltage_law_xy_ki_per_A(const ht_law_setting *given)
{
    return XY_INTEGRAL * given->machine->lxy_H * given->machine->inv_ts / given->vdc_max_V;
}
