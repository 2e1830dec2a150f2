/** @file ht_flux_step.h
 *  The common part of the deadbeat laws: the flux that a torque wants, and a step that is too long.
 */
#ifndef HT_FLUX_STEP_H
#define HT_FLUX_STEP_H

#include "ht_limited.h"
#include "ht_turned.h"
#include "ht_voltage_law.h"

/** The least share of the largest step that torque gets, squared. */
#define HT_TORQUE_SHARE2 0.25f

/** The flux that has the torque asked for, next to the length asked for. */
static HT_INTO_CALLERS ht_ab ht_flux_wanted(const ht_observer_config *machine,
                                            const ht_voltage_law_input *in, float length_Wb)
{
    ht_ab r = in->rotor_Wb;
    float r2 = r.alpha * r.alpha + r.beta * r.beta;
    float inverse = 1.0f / ((r2 > HT_LAW_LEAST_WB2) ? r2 : HT_LAW_LEAST_WB2);
    float b = in->torque_ref_Nm * machine->sigma_ls_H / machine->torque_gain * inverse;
    float a2 = length_Wb * length_Wb * inverse - b * b;
    float a = sqrtf((a2 > HT_LAW_RADIAL2_LEAST) ? a2 : HT_LAW_RADIAL2_LEAST);
    ht_ab psi;
    psi.alpha = a * r.alpha - b * r.beta;
    psi.beta = a * r.beta + b * r.alpha;
    return psi;
}

/** The same with magnets, whose r changes with the flux. `psi_Wb`: the flux now. */
static HT_INTO_CALLERS ht_ab ht_flux_wanted_magnet(const ht_observer_config *machine,
                                                   const ht_voltage_law_input *in, ht_ab psi_Wb,
                                                   float length_Wb)
{
    ht_ab r = in->rotor_Wb;
    float r2 = r.alpha * r.alpha + r.beta * r.beta;
    float size_Wb = sqrtf((r2 > HT_LAW_LEAST_WB2) ? r2 : HT_LAW_LEAST_WB2);
    ht_ab u = {r.alpha / size_Wb, r.beta / size_Wb};
    ht_dq now = {ht_along(u, psi_Wb), u.alpha * psi_Wb.beta - u.beta * psi_Wb.alpha};
    ht_dq wanted =
        ht_magnet_wanted_Wb(&machine->magnet, size_Wb, now, length_Wb, in->torque_ref_Nm);
    ht_ab along = {wanted.d, wanted.q};
    return ht_product(u, along);
}

/** A step that the voltage cannot make: the length first, as far as torque's share lets it,
 *  then as much torque as is left. */
static HT_INTO_CALLERS ht_ab ht_flux_step_within(ht_ab e, ht_ab along, float inv_size, float radial,
                                                 float most)
{
    float left = most * most - radial * radial;
    float least = HT_TORQUE_SHARE2 * most * most;
    float tangential = ht_limited(along.alpha * e.beta - along.beta * e.alpha,
                                  sqrtf((left > least) ? left : least));
    /* along the circle, not its tangent */
    float outward = radial - 0.5f * tangential * tangential * inv_size;
    ht_ab step;
    step.alpha = outward * along.alpha - tangential * along.beta;
    step.beta = outward * along.beta + tangential * along.alpha;
    return step;
}

#endif
