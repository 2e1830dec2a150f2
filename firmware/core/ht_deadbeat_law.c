#include "ht_deadbeat_law.h"

#include "ht_flux_step.h"
#include "ht_rotors.h"
#include "ht_turned.h"

#include <math.h>

/* Largest step of the flux with much L_xy, units of Vdc Ts. The inverter reaches 0.64; a command beyond it makes
 * the modulator limit legs, up to twelve-step operation. */
#define REACH_PU 1.0f
/* Legs that the modulator limits make an x-y voltage of their own. While a torque step lasts, it has
 * one direction for many periods, and the less L_xy is, the faster an x-y current grows. Beyond this
 * share of i_trip_A the step stays where both sets have room between the rails (up to 1/sqrt(3))
 * and 0.07 V_dc are left that bring the current back. */
#define XY_FREE_SHARE 0.2f
#define XY_REACH_PU 0.5f
/* Largest x-y voltage of limited legs, units of Vdc: that of twelve-step operation. It acts for two
 * periods before the law sees its current. Where they make more than that share of i_trip_A, no
 * command is beyond the room of both sets. */
#define XY_LIMITED_PU 0.173f
#define XY_ROOM_PU 0.577f
/* Voltage from which set 2's carrier turns, units of Vdc. */
#define TURN_PU 0.3f

void ht_deadbeat_law_configure(ht_deadbeat_law_config *cfg, const ht_law_setting *given,
                               ht_modulator_config *modulator)
{
    bool clamped = (given->kappa > 0.0f) && (given->kappa_from_pu == 0.0f);
    float turn_pu[3] = {TURN_PU, HT_NEVER_PU, 0.0f}; /* auto, off, always */
    float free_A = XY_FREE_SHARE * given->i_trip_A;
    float unseen_A = 2.0f * XY_LIMITED_PU * given->vdc_max_V * given->machine->ts_s
                     / given->machine->lxy_H;
    turn_pu[0] = clamped ? 0.0f : TURN_PU;
    cfg->gain = given->step_share;
    cfg->xy_ki_per_A = ht_voltage_law_xy_ki_per_A(given);
    cfg->xy_free_A2 = free_A * free_A;
    cfg->reach_pu = (unseen_A <= free_A) ? REACH_PU : XY_ROOM_PU;
    modulator->kappa = given->kappa;
    modulator->kappa_from_pu = given->kappa_from_pu;
    modulator->alternate = given->clamp != 0.0f;
    modulator->turn_pu = turn_pu[(uint16_t)given->carrier_turn];
}

bool ht_deadbeat_law_check(const ht_deadbeat_law_config *cfg)
{
    return (cfg->gain > 0.0f) && (cfg->gain <= 1.0f) && (cfg->xy_ki_per_A >= 0.0f)
           && (cfg->xy_ki_per_A < 1.0e30f) && (cfg->xy_free_A2 > 0.0f)
           && (cfg->reach_pu >= XY_REACH_PU) && (cfg->reach_pu <= REACH_PU); /* NaN is not */
}

void ht_deadbeat_law_reset(ht_deadbeat_law_state *st)
{
    ht_xy_reset(&st->xy);
}

ht_vsd ht_deadbeat_law_step(const ht_deadbeat_law_config *cfg, const ht_observer_config *machine,
                            ht_deadbeat_law_state *st, const ht_voltage_law_input *in)
{
    ht_xy_config integral = {0.0f, cfg->xy_ki_per_A};
    ht_ab psi = in->psi_Wb;
    float step = in->vdc_V * machine->ts_s;
    float size = sqrtf(psi.alpha * psi.alpha + psi.beta * psi.beta);
    float inv_size = (size > 0.0f) ? (1.0f / size) : 0.0f;
    float radial = ht_limited(in->flux_ref_Wb - size, HT_LAW_FLUX_SHARE * step);
    float most = XY_REACH_PU * step;
    float inv_vdc = 1.0f / in->vdc_V;
    float volts_per_Wb = machine->inv_ts * inv_vdc;
    float drop = in->rs_ohm * machine->inv_sigma_ls * inv_vdc;
    ht_turn turns = ht_turn_of(in->turn_rad, HT_ROTOR_DOES(machine->rotor, turns_far, ()));
    float turn = turns.sine;
    float back = turns.back;
    ht_ab along = {inv_size * psi.alpha, inv_size * psi.beta};
    ht_ab wanted =
        HT_ROTOR_DOES(machine->rotor, flux_for, (machine, in, in->psi_Wb, size + radial));
    ht_ab e;
    float e2;
    ht_vsd v;
    v.xy = ht_xy_step(&integral, &st->xy, in->i_A.xy, along, HT_LAW_XY_LIMIT_PU, false);
    e.alpha = back * wanted.alpha - turn * wanted.beta + cfg->gain * (wanted.alpha - psi.alpha);
    e.beta = back * wanted.beta + turn * wanted.alpha + cfg->gain * (wanted.beta - psi.beta);
    e2 = e.alpha * e.alpha + e.beta * e.beta;
    if (!(e2 <= (most * most))) {
        ht_xy i = in->i_A.xy;
        if ((i.x * i.x + i.y * i.y) <= cfg->xy_free_A2) { /* NaN is not */
            most = cfg->reach_pu * step;
        }
        if (!(e2 <= (most * most))) {
            e = ht_flux_step_within(e, along, inv_size, radial, most);
        }
    }
    v.ab.alpha = e.alpha * volts_per_Wb + drop * (psi.alpha - in->rotor_Wb.alpha);
    v.ab.beta = e.beta * volts_per_Wb + drop * (psi.beta - in->rotor_Wb.beta);
    v.xy.x -= HT_LAW_XY_SHARE * volts_per_Wb * in->psi_xy_Wb.x;
    v.xy.y -= HT_LAW_XY_SHARE * volts_per_Wb * in->psi_xy_Wb.y;
    if (HT_ROTOR_DOES(machine->rotor, induces, ())) {
        v.xy.x += inv_vdc * in->emf_V.x;
        v.xy.y += inv_vdc * in->emf_V.y;
    }
    return v;
}
