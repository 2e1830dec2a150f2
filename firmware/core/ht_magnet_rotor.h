/** @file ht_magnet_rotor.h
 *  The control step's functions for a rotor with permanent magnets; ht_induction_rotor.h says what each is for.
 *  The machine's equations are in ht_magnet.h.
 */
#ifndef HT_MAGNET_ROTOR_H
#define HT_MAGNET_ROTOR_H

#include "ht_magnet_observer.h"
#include "ht_turned.h"
#include "ht_voltage_law.h"

#include <math.h>

static inline bool ht_magnet_has_axis(void)
{
    return true;
}

static inline bool ht_magnet_induces(void)
{
    return true;
}

static inline bool ht_magnet_salient(void)
{
    return true;
}

static inline bool ht_magnet_turns_far(void)
{
    return true;
}

static inline float ht_magnet_d_H(const ht_observer_config *machine)
{
    return machine->magnet.ld_H;
}

static inline float ht_magnet_inv_d(const ht_observer_config *machine)
{
    return machine->magnet.inv_ld;
}

static inline float ht_magnet_own_Wb(const ht_observer_config *machine)
{
    return machine->magnet.psi_f_Wb;
}

static inline float ht_magnet_inv_own(const ht_observer_config *machine)
{
    return machine->magnet.inv_psi_f;
}

static inline float ht_magnet_aside_rad(const ht_observer_config *machine, ht_ab axis, ht_vsd i_A)
{
    return ht_magnet_pulled_rad(&machine->magnet, axis, i_A);
}

static inline ht_dq ht_magnet_shorted_A(const ht_observer_config *machine, float omega_rad_s,
                                        ht_dq i_A)
{
    return ht_magnet_shorted(&machine->magnet, machine->rs_ohm, omega_rad_s, machine->ts_s, i_A);
}

static inline ht_xy ht_magnet_emf_V(const ht_observer_config *machine, ht_ab axis,
                                    float omega_rad_s)
{
    return ht_magnet_induced_V(&machine->magnet, axis, omega_rad_s);
}

/** The speed is the rotor's: it does not depend on the flux. */
static HT_INTO_CALLERS void ht_magnet_tell(const ht_observer_config *cfg,
                                           const ht_observer_state *st, const ht_estimate *now,
                                           const ht_ab *rotor_Wb, const ht_xy *emf_V,
                                           ht_voltage_law_input *seen)
{
    (void)cfg;
    (void)st;
    (void)now;
    seen->rotor_Wb = *rotor_Wb;
    seen->emf_V = *emf_V;
}

/** r changes with the flux. */
static HT_INTO_CALLERS ht_ab ht_magnet_flux_for(const ht_observer_config *machine,
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

/** r changes with i_d. */
static inline ht_ab ht_magnet_current_for(const ht_observer_config *machine,
                                          const ht_voltage_law_input *in, float rotor_Wb,
                                          float inv_rotor, ht_ab now_A)
{
    const ht_magnet_config *m = &machine->magnet;
    ht_dq now = {rotor_Wb + m->lq_H * now_A.alpha, m->lq_H * now_A.beta};
    ht_dq wanted = ht_magnet_reference_Wb(m, rotor_Wb, now, in->flux_ref_Wb, in->torque_ref_Nm);
    ht_ab i;
    (void)inv_rotor;
    i.alpha = now_A.alpha + m->inv_ld * (wanted.d - now.d);
    i.beta = wanted.q / m->lq_H;
    return i;
}

#endif
