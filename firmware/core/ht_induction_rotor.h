/** @file ht_induction_rotor.h
 *  The control step's functions for a rotor with a winding or a cage. Those of another kind have the same
 *  names after `ht_<kind>_`, and the same arguments (HT_ROTOR_DOES).
 */
#ifndef HT_INDUCTION_ROTOR_H
#define HT_INDUCTION_ROTOR_H

#include "ht_voltage_law.h"

#include <math.h>

/** The rotor has a d axis: it is aligned before it runs, not magnetised. */
static inline bool ht_induction_has_axis(void)
{
    return false;
}

/** The rotor induces a voltage in x-y. */
static inline bool ht_induction_induces(void)
{
    return false;
}

/** The transient inductance along the d axis is another one than across it. */
static inline bool ht_induction_salient(void)
{
    return false;
}

/** The flux may turn so far in a period that the third order of the angle counts. */
static inline bool ht_induction_turns_far(void)
{
    return false;
}

/** Transient inductance along the d axis. */
static inline float ht_induction_d_H(const ht_observer_config *machine)
{
    return machine->sigma_ls_H;
}

/** 1 over it. */
static inline float ht_induction_inv_d(const ht_observer_config *machine)
{
    return machine->inv_sigma_ls;
}

/** Stator flux of the rotor alone, without any current. */
static inline float ht_induction_own_Wb(const ht_observer_config *machine)
{
    (void)machine;
    return 0.0f;
}

/** 1 over it. */
static inline float ht_induction_inv_own(const ht_observer_config *machine)
{
    (void)machine;
    return 0.0f;
}

/** Voltage that the rotor induces in x-y while the d axis `axis` turns with `omega_rad_s`. */
static inline ht_xy ht_induction_emf_V(const ht_observer_config *machine, ht_ab axis,
                                       float omega_rad_s)
{
    const ht_xy none = {0.0f, 0.0f};
    (void)machine;
    (void)axis;
    (void)omega_rad_s;
    return none;
}

/** The observer's step, see ht_observer_update. `axis`: d axis at its end. */
static HT_INTO_CALLERS ht_estimate ht_induction_update(const ht_observer_config *cfg,
                                                       ht_observer_state *st, ht_ab v_V, ht_ab i_A,
                                                       float turn_rad, ht_ab axis,
                                                       float inv_psi_ref2)
{
    (void)axis;
    return ht_observer_update(cfg, st, v_V, i_A, turn_rad, inv_psi_ref2);
}

/** The estimate one period ahead, see ht_observer_predict. `axis`: d axis now. `rotor_Wb`: takes the rotor flux
 *  seen from the stator, where it comes with the estimate. */
static HT_INTO_CALLERS ht_estimate ht_induction_predict(const ht_observer_config *cfg,
                                                        const ht_observer_state *st,
                                                        ht_estimate now, ht_ab v_V, ht_ab i_A,
                                                        ht_ab axis, ht_ab *rotor_Wb)
{
    (void)axis;
    (void)rotor_Wb;
    return ht_observer_predict(cfg, st, now, v_V, i_A);
}

/** Squares of shares of the flux reference: a flux that is shorter than the first is not the
 *  reference's ripple, and one below the second has no speed that could be told. */
#define HT_SHORT_FLUX2 0.9f
#define HT_NO_FLUX2 0.04f

/* The angle that the flux turns in a period, if it is `turn_rad` by the observer's speed. That takes the
 * reference for the flux's length. With a short flux it is too low, a law that believed it would turn the
 * flux too slowly, and the current that this makes would shorten the flux further. */
static inline float ht_turn_of_short(ht_ab psi_Wb, float flux_ref_Wb, float turn_rad)
{
    float ref2 = flux_ref_Wb * flux_ref_Wb;
    float size2 = psi_Wb.alpha * psi_Wb.alpha + psi_Wb.beta * psi_Wb.beta;
    bool is_short = (size2 < (HT_SHORT_FLUX2 * ref2)) && (size2 > (HT_NO_FLUX2 * ref2));
    return is_short ? (turn_rad * HT_SHORT_FLUX2 * ref2 / size2) : turn_rad;
}

/** What the kind tells a law of the machine one period ahead: `rotor_Wb`, and `emf_V` where it induces.
 *  `turn_rad` is what the observer's speed makes of it, and may be corrected; the rest of `seen` is there.
 *  `now`: the latest estimate; `rotor_Wb`: of ..._predict; `emf_V`: what is induced in x-y then. */
static HT_INTO_CALLERS void ht_induction_tell(const ht_observer_config *cfg,
                                              const ht_observer_state *st, const ht_estimate *now,
                                              const ht_ab *rotor_Wb, const ht_xy *emf_V,
                                              ht_voltage_law_input *seen)
{
    (void)rotor_Wb;
    (void)emf_V;
    seen->rotor_Wb = ht_observer_predict_rotor(cfg, st, now->psi_Wb, seen->i_A.ab);
    seen->turn_rad = ht_turn_of_short(now->psi_Wb, seen->flux_ref_Wb, seen->turn_rad);
}

/** The d axis is known, `axis`, while the machine carries `i_A`: the flux begins there. */
static inline void ht_induction_align(const ht_observer_config *cfg, ht_observer_state *st,
                                      ht_ab i_A, ht_ab axis)
{
    (void)cfg;
    (void)st;
    (void)i_A;
    (void)axis;
}

/** What the rotor's axis is ahead of the direct current `i_A` along `axis` that pulls it at rest. */
static inline float ht_induction_aside_rad(const ht_observer_config *machine, ht_ab axis,
                                           ht_vsd i_A)
{
    (void)machine;
    (void)axis;
    (void)i_A;
    return 0.0f;
}

/** The current one period later, a small part of a turn, while all terminals are connected. */
static inline ht_dq ht_induction_shorted_A(const ht_observer_config *machine, float omega_rad_s,
                                           ht_dq i_A)
{
    (void)machine;
    (void)omega_rad_s;
    return i_A;
}

/** The slow interrupt's adaptation: of the resistances, see ht_observer_adapt, ... */
static inline void ht_induction_adapt(const ht_observer_config *cfg, ht_observer_state *st,
                                      float gain)
{
    ht_observer_adapt(cfg, st, (cfg->kind == HT_OBSERVER_HYBRID) ? gain : 0.0f);
}

/** ... and of the rotor's own flux, where it induces more than `least_V`. */
static inline void ht_induction_adapt_flux(const ht_observer_config *cfg, ht_observer_state *st,
                                           float gain, float least_V)
{
    (void)cfg;
    (void)st;
    (void)gain;
    (void)least_V;
}

/** The flux that has the torque asked for, next to the length asked for. `psi_Wb`: the flux now. */
static HT_INTO_CALLERS ht_ab ht_induction_flux_for(const ht_observer_config *machine,
                                                   const ht_voltage_law_input *in, ht_ab psi_Wb,
                                                   float length_Wb)
{
    ht_ab r = in->rotor_Wb;
    float r2 = r.alpha * r.alpha + r.beta * r.beta;
    float inverse = 1.0f / ((r2 > HT_LAW_LEAST_WB2) ? r2 : HT_LAW_LEAST_WB2);
    float b = in->torque_ref_Nm * machine->sigma_ls_H / machine->torque_gain * inverse;
    float a2 = length_Wb * length_Wb * inverse - b * b;
    float a = sqrtf((a2 > HT_LAW_RADIAL2_LEAST) ? a2 : HT_LAW_RADIAL2_LEAST);
    ht_ab psi;
    (void)psi_Wb;
    psi.alpha = a * r.alpha - b * r.beta;
    psi.beta = a * r.beta + b * r.alpha;
    return psi;
}

/** References of i_d and i_q: the length of the stator flux and the torque, with the rotor flux as it
 *  is, of the length `rotor_Wb`. `now_A`: the current. */
static HT_INTO_CALLERS ht_ab ht_induction_current_for(const ht_observer_config *machine,
                                                      const ht_voltage_law_input *in,
                                                      float rotor_Wb, float inv_rotor, ht_ab now_A)
{
    float flux = in->flux_ref_Wb;
    float across;
    float radial2;
    ht_ab i;
    (void)now_A;
    i.beta = in->torque_ref_Nm / machine->torque_gain * inv_rotor;
    across = machine->sigma_ls_H * i.beta;
    radial2 = flux * flux - across * across;
    radial2 = (radial2 > HT_LAW_RADIAL2_LEAST * flux * flux) ? radial2
                                                             : (HT_LAW_RADIAL2_LEAST * flux * flux);
    i.alpha = machine->inv_sigma_ls * (sqrtf(radial2) - rotor_Wb);
    return i;
}

#endif
