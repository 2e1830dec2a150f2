/* What the laws that command a voltage see: every value. */
#ifndef HT_PROVE_LAW_INPUT_H
#define HT_PROVE_LAW_INPUT_H

#include "ht_voltage_law.h"
#include "prove.h"

static inline ht_voltage_law_input any_law_input(void)
{
    ht_voltage_law_input in;
    in.psi_Wb = any_ab();
    in.rotor_Wb = any_ab();
    in.psi_xy_Wb = any_xy();
    in.i_A.ab = any_ab();
    in.i_A.xy = any_xy();
    in.turn_rad = nondet_float();
    in.emf_V.x = nondet_float();
    in.emf_V.y = nondet_float();
    in.rs_ohm = nondet_float();
    in.torque_ref_Nm = nondet_float();
    in.flux_ref_Wb = nondet_float();
    in.vdc_V = nondet_float();
    return in;
}

/* What they read of the machine. */
static inline ht_observer_config any_law_machine(void)
{
    ht_observer_config machine;
    machine.ts_s = nondet_float();
    machine.inv_ts = nondet_float();
    machine.sigma_ls_H = nondet_float();
    machine.inv_sigma_ls = nondet_float();
    machine.lxy_H = nondet_float();
    machine.torque_gain = nondet_float();
    machine.rotor = nondet_bool() ? HT_ROTOR_MAGNET : HT_ROTOR_INDUCTION;
    machine.magnet.psi_f_Wb = nondet_float();
    machine.magnet.inv_psi_f = nondet_float();
    machine.magnet.ld_H = nondet_float();
    machine.magnet.lq_H = nondet_float();
    machine.magnet.inv_ld = nondet_float();
    machine.magnet.saliency_H = nondet_float();
    machine.magnet.share = nondet_float();
    machine.magnet.torque_gain = nondet_float();
    machine.magnet.emf5_Wb = any_ab();
    machine.magnet.emf7_Wb = any_ab();
    return machine;
}

#endif
