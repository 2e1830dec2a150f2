#include "ht_interleaved_law.h"

#include "ht_flux_step.h"
#include "ht_rotors.h"
#include "ht_turned.h"

#include <math.h>

/* Largest step of a set's flux, units of Vdc and the half: what `reach_pu` is beyond the current
 * `xy_free_A2`. */
#define XY_REACH_PU 0.5f

void ht_interleaved_law_configure(ht_interleaved_law_config *cfg, const ht_law_setting *given,
                                  ht_modulator_config *modulator)
{
    const ht_observer_config *machine = given->machine;
    ht_deadbeat_law_configure(&cfg->deadbeat, given, modulator);
    ht_modulator_centre(modulator, false);
    ht_interleaved_configure(&cfg->positions, machine->sigma_ls_H / machine->lxy_H, machine->inv_ts,
                             given->thd_share, (given->clamp != 0.0f) ? given->kappa : 0.0f,
                             given->kappa_from_pu);
}

bool ht_interleaved_law_check(const ht_interleaved_law_config *cfg)
{
    return ht_deadbeat_law_check(&cfg->deadbeat) && ht_interleaved_check(&cfg->positions);
}

void ht_interleaved_law_reset(ht_interleaved_law_state *st)
{
    const ht_ab none = {0.0f, 0.0f};
    ht_deadbeat_law_reset(&st->deadbeat);
    ht_interleaved_reset(&st->positions);
    st->off_pu[0] = none;
    st->off_pu[1] = none;
    st->v_pu[0] = none;
    st->v_pu[1] = none;
    st->begun = false;
}

ht_vsd ht_interleaved_law_step(const ht_interleaved_law_config *cfg,
                               const ht_observer_config *machine, ht_interleaved_law_state *st,
                               const ht_voltage_law_input *in)
{
    return ht_deadbeat_law_step(&cfg->deadbeat, machine, &st->deadbeat, in);
}

/* The task of the set that begins. */
static HT_INTO_CALLERS ht_interleaved_command command_of(const ht_interleaved_law_config *cfg,
                                                         const ht_observer_config *machine,
                                                         ht_interleaved_law_state *st,
                                                         const ht_voltage_law_input *in, unsigned a)
{
    ht_xy_config integral = {0.0f, cfg->deadbeat.xy_ki_per_A};
    float sign = (a == 0u) ? 1.0f : -1.0f;
    float step = in->vdc_V * machine->ts_s; /* of a period */
    bool brief = (a == 1u) && st->positions.brief;
    float periods = brief ? 1.0f : HT_HALF_PERIODS;
    float half = periods * step;
    float inv_vdc = 1.0f / in->vdc_V;
    float per_Wb = (brief ? 1.0f : (1.0f / HT_HALF_PERIODS)) * machine->inv_ts * inv_vdc;
    float drop = in->rs_ohm * machine->inv_sigma_ls * inv_vdc;
    ht_turn turns =
        ht_turn_of(periods * in->turn_rad, HT_ROTOR_DOES(machine->rotor, turns_far, ()));
    float middle = 0.5f * turns.sine; /* half of the turn */
    ht_ab r = in->rotor_Wb;
    ht_ab psi; /* of the set */
    ht_ab along;
    ht_ab wanted;
    ht_ab steady;
    ht_ab current; /* sigma L_s times it, in the middle of the half */
    ht_ab e;
    ht_xy xy;
    float size;
    float inv_size;
    float radial;
    float gain = cfg->deadbeat.gain;
    float most = XY_REACH_PU * half;
    float e2;
    float inv_r;
    ht_interleaved_command command;

    psi.alpha = in->psi_Wb.alpha + sign * in->psi_xy_Wb.x - step * st->off_pu[a].alpha;
    psi.beta = in->psi_Wb.beta - sign * in->psi_xy_Wb.y - step * st->off_pu[a].beta;
    size = sqrtf(psi.alpha * psi.alpha + psi.beta * psi.beta);
    inv_size = (size > 0.0f) ? (1.0f / size) : 0.0f;
    along.alpha = inv_size * psi.alpha;
    along.beta = inv_size * psi.beta;
    radial = ht_limited(in->flux_ref_Wb - size, HT_LAW_FLUX_SHARE * half);
    wanted = HT_ROTOR_DOES(machine->rotor, flux_for, (machine, in, psi, size + radial));
    steady.alpha = turns.back * wanted.alpha - turns.sine * wanted.beta;
    steady.beta = turns.back * wanted.beta + turns.sine * wanted.alpha;
    e.alpha = steady.alpha + gain * (wanted.alpha - psi.alpha);
    e.beta = steady.beta + gain * (wanted.beta - psi.beta);
    e2 = e.alpha * e.alpha + e.beta * e.beta;
    if (!(e2 <= (most * most))) {
        ht_xy i = in->i_A.xy;
        if ((i.x * i.x + i.y * i.y) <= cfg->deadbeat.xy_free_A2) { /* NaN is not */
            most = cfg->deadbeat.reach_pu * half;
        }
        if (!(e2 <= (most * most))) {
            e = ht_flux_step_within(e, along, inv_size, radial, most);
        }
    }
    current.alpha = wanted.alpha - r.alpha;
    current.beta = wanted.beta - r.beta;
    current.alpha -= middle * (wanted.beta - r.beta);
    current.beta += middle * (wanted.alpha - r.alpha);
    xy = ht_xy_step(&integral, &st->deadbeat.xy, in->i_A.xy, along, HT_LAW_XY_LIMIT_PU, false);
    if (HT_ROTOR_DOES(machine->rotor, induces, ())) {
        xy.x += inv_vdc * in->emf_V.x;
        xy.y += inv_vdc * in->emf_V.y;
    }
    steady.alpha = steady.alpha * per_Wb + drop * current.alpha;
    steady.beta = steady.beta * per_Wb + drop * current.beta;
    command.steady_pu = steady;
    command.v_pu.alpha = e.alpha * per_Wb + drop * current.alpha + sign * xy.x;
    command.v_pu.beta = e.beta * per_Wb + drop * current.beta - sign * xy.y;
    inv_r = r.alpha * r.alpha + r.beta * r.beta;
    inv_r = 1.0f / sqrtf((inv_r > HT_LAW_LEAST_WB2) ? inv_r : HT_LAW_LEAST_WB2);
    command.quad.alpha = inv_r * (-r.beta - middle * r.alpha);
    command.quad.beta = inv_r * (r.alpha - middle * r.beta);
    return command;
}

/* Both sets begin, or none does. */
HT_APART static void both_of(const ht_interleaved_law_config *cfg,
                             const ht_observer_config *machine, ht_interleaved_law_state *st,
                             const ht_voltage_law_input *in, const ht_modulator_input *pwm,
                             bool begins, ht_compare *out, ht_applied *applied, ht_toggles *toggles)
{
    ht_interleaved_command command[2];
    unsigned a;
    for (a = 0u; begins && (a < 2u); a++) {
        command[a] = command_of(cfg, machine, st, in, a);
        st->v_pu[a] = command[a].v_pu;
    }
    ht_interleaved_both(&cfg->positions, &st->positions, command, begins, pwm, st->off_pu, out,
                        applied, toggles);
}

ht_xy ht_interleaved_law_pattern(const ht_interleaved_law_config *cfg,
                                 const ht_observer_config *machine, ht_interleaved_law_state *st,
                                 const ht_voltage_law_input *in, const ht_modulator_input *pwm,
                                 ht_compare *out, ht_applied *applied, ht_toggles *toggles)
{
    unsigned begins = ht_interleaved_begins(&cfg->positions, &st->positions);
    ht_xy v;
    if ((begins == 1u) || (begins == 2u)) {
        unsigned a = begins - 1u;
        ht_interleaved_command command = command_of(cfg, machine, st, in, a);
        st->v_pu[a] = command.v_pu;
        st->off_pu[a] = ht_interleaved_step(&cfg->positions, &st->positions, &command, a,
                                            !st->begun, pwm, out, applied, toggles);
        st->begun = true;
    } else {
        both_of(cfg, machine, st, in, pwm, begins != 0u, out, applied, toggles);
    }
    v.x = 0.5f * (st->v_pu[0].alpha - st->v_pu[1].alpha);
    v.y = 0.5f * (st->v_pu[1].beta - st->v_pu[0].beta);
    return v;
}
