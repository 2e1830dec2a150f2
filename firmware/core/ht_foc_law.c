#include "ht_foc_law.h"

#include "ht_limited.h"
#include "ht_rotors.h"
#include "ht_turned.h"

#include <math.h>

/* Largest voltage, units of Vdc: the circle of linear modulation, squared. */
#define REACH2_PU2 0.333333333f
/* Of a salient rotor: largest part of it along the d axis. */
#define D_MOST_PU 0.5f
/* Bandwidth of the current regulators times the period. */
#define ALPHA_TS 0.3f

void ht_foc_law_configure(ht_foc_law_config *cfg, const ht_law_setting *given,
                          ht_modulator_config *modulator)
{
    cfg->alpha_ts = ALPHA_TS;
    cfg->xy_ki_per_A = ht_voltage_law_xy_ki_per_A(given);
    ht_modulator_centre(modulator, given->scheme->vectors == HT_VECTORS_TURNED);
}

bool ht_foc_law_check(const ht_foc_law_config *cfg)
{
    return (cfg->alpha_ts > 0.0f) && (cfg->alpha_ts <= 0.5f) && (cfg->xy_ki_per_A >= 0.0f)
           && (cfg->xy_ki_per_A < 1.0e30f); /* NaN is not */
}

void ht_foc_law_reset(ht_foc_law_state *st)
{
    const ht_ab none = {0.0f, 0.0f};
    ht_xy_reset(&st->xy);
    st->along = none;
    st->integral_A = none;
    st->wanted_A = none;
    st->begun = false;
}

/* Into the frame with the unit vector u, and out of it. */
static ht_ab into(ht_ab u, ht_ab p)
{
    ht_ab q;
    q.alpha = u.alpha * p.alpha + u.beta * p.beta;
    q.beta = u.alpha * p.beta - u.beta * p.alpha;
    return q;
}

static ht_ab out_of(ht_ab u, ht_ab p)
{
    ht_ab q;
    q.alpha = u.alpha * p.alpha - u.beta * p.beta;
    q.beta = u.alpha * p.beta + u.beta * p.alpha;
    return q;
}

/* A voltage in the frame that is out of reach, of a salient rotor: what the d axis needs, then as much of
 * the rest as there is room for. If both gave way alike, the flux would not be weakened when torque is
 * asked for, and more voltage would be missing. `wanted`: less by what is cut off, as above. */
static ht_ab d_axis_first(const ht_observer_config *machine, const ht_voltage_law_input *in,
                          ht_ab v_pu, float a, ht_ab *wanted)
{
    float per_pu = in->vdc_V * machine->ts_s / a;
    ht_ab v;
    v.alpha = ht_limited(v_pu.alpha, D_MOST_PU);
    v.beta = ht_limited(v_pu.beta, sqrtf(REACH2_PU2 - v.alpha * v.alpha));
    wanted->alpha += per_pu * HT_ROTOR_DOES(machine->rotor, inv_d, (machine))
                     * (v.alpha - v_pu.alpha);
    wanted->beta += per_pu * machine->inv_sigma_ls * (v.beta - v_pu.beta);
    return v;
}

ht_vsd ht_foc_law_step(const ht_foc_law_config *cfg, const ht_observer_config *machine,
                       ht_foc_law_state *st, const ht_voltage_law_input *in)
{
    ht_xy_config integral = {0.0f, cfg->xy_ki_per_A};
    ht_ab psi = in->psi_Wb;
    ht_ab r = in->rotor_Wb;
    float rotor2 = r.alpha * r.alpha + r.beta * r.beta;
    float rotor = sqrtf((rotor2 > HT_LAW_LEAST_WB2) ? rotor2 : HT_LAW_LEAST_WB2);
    float inv_rotor = 1.0f / rotor;
    float inv_vdc = 1.0f / in->vdc_V;
    float volts_per_Wb = machine->inv_ts * inv_vdc;
    float drop = in->rs_ohm * inv_vdc;
    ht_turn turns = ht_turn_of(in->turn_rad, HT_ROTOR_DOES(machine->rotor, turns_far, ()));
    float turn = turns.sine;
    float back = turns.back;
    float a = cfg->alpha_ts;
    float size2;
    ht_ab u = {inv_rotor * r.alpha, inv_rotor * r.beta};
    ht_ab i1 = {machine->inv_sigma_ls * (psi.alpha - r.alpha),
                machine->inv_sigma_ls * (psi.beta - r.beta)};
    ht_ab frame_i1 = into(u, i1);
    ht_ab wanted =
        HT_ROTOR_DOES(machine->rotor, current_for, (machine, in, rotor, inv_rotor, frame_i1));
    ht_ab sampled;
    ht_ab move; /* of the current, in the frame */
    ht_ab flux; /* at the end of the period, but for the turn */
    ht_vsd v;
    wanted.alpha =
        frame_i1.alpha
        + ht_limited(wanted.alpha - frame_i1.alpha,
                     HT_LAW_FLUX_SHARE * in->vdc_V * machine->ts_s * machine->inv_sigma_ls / a);
    if (!st->begun) { /* as if this current had been held */
        st->begun = true;
        st->along = u;
        st->integral_A.alpha = a * frame_i1.alpha;
        st->integral_A.beta = a * frame_i1.beta;
        st->wanted_A = into(u, in->i_A.ab);
    }
    sampled = into(st->along, in->i_A.ab);
    st->integral_A.alpha += a * a * (st->wanted_A.alpha - sampled.alpha);
    st->integral_A.beta += a * a * (st->wanted_A.beta - sampled.beta);
    st->along = u;
    v.xy = ht_xy_step(&integral, &st->xy, in->i_A.xy, u, HT_LAW_XY_LIMIT_PU, false);
    v.xy.x -= HT_LAW_XY_SHARE * volts_per_Wb * in->psi_xy_Wb.x;
    v.xy.y -= HT_LAW_XY_SHARE * volts_per_Wb * in->psi_xy_Wb.y;

    move.alpha = a * (wanted.alpha - 2.0f * frame_i1.alpha) + st->integral_A.alpha;
    move.beta = a * (wanted.beta - 2.0f * frame_i1.beta) + st->integral_A.beta;
    if (HT_ROTOR_DOES(machine->rotor, salient, ())) { /* as if L_q held along the d axis, too */
        move.alpha *= HT_ROTOR_DOES(machine->rotor, d_H, (machine)) * machine->inv_sigma_ls;
    }
    if (HT_ROTOR_DOES(machine->rotor, induces, ())) {
        v.xy.x += inv_vdc * in->emf_V.x;
        v.xy.y += inv_vdc * in->emf_V.y;
    }
    flux = out_of(u, move);
    flux.alpha = psi.alpha + machine->sigma_ls_H * flux.alpha;
    flux.beta = psi.beta + machine->sigma_ls_H * flux.beta;
    v.ab.alpha = volts_per_Wb * (flux.alpha - psi.alpha + back * flux.alpha - turn * flux.beta)
                 + drop * i1.alpha;
    v.ab.beta = volts_per_Wb * (flux.beta - psi.beta + back * flux.beta + turn * flux.alpha)
                + drop * i1.beta;
    size2 = v.ab.alpha * v.ab.alpha + v.ab.beta * v.ab.beta;
    if ((size2 > REACH2_PU2) && HT_ROTOR_DOES(machine->rotor, salient, ())) {
        v.ab = d_axis_first(machine, in, into(u, v.ab), a, &wanted);
        v.ab = out_of(u, v.ab);
    } else if (!(size2 <= REACH2_PU2)) {
        /* What is cut off, as a current in the frame, over a: by so much the reference was too
         * far. */
        float share = sqrtf(REACH2_PU2 / size2);
        float cut = (share - 1.0f) * in->vdc_V * machine->ts_s * machine->inv_sigma_ls / a;
        ht_ab less = into(u, v.ab);
        wanted.alpha += cut * less.alpha;
        wanted.beta += cut * less.beta;
        v.ab.alpha *= share;
        v.ab.beta *= share;
    } else {
        /* within reach */
    }
    st->wanted_A = wanted;
    return v;
}
