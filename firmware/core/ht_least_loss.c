#include "ht_least_loss.h"

#include <math.h>

static void hold(ht_least_loss_state *st, float flux_Wb)
{
    st->held_Wb = flux_Wb;
    st->asked_Wb = 0.0f;
    st->waited = 0u;
}

void ht_least_loss_reset(ht_least_loss_state *st, float most_Wb)
{
    st->error_Nm = 0.0f;
    hold(st, most_Wb);
}

float ht_least_loss_Wb(const ht_least_loss_config *cfg, const ht_least_loss_input *in,
                       float torque_Nm)
{
    float omega = (in->omega_rad_s < 0.0f) ? -in->omega_rad_s : in->omega_rad_s;
    float size_Nm = (torque_Nm < 0.0f) ? -torque_Nm : torque_Nm;
    float iron = omega * (cfg->hysteresis_ohm + cfg->eddy_ohm * omega);
    float along = in->rs_ohm + iron * cfg->ls2_H2;
    float across = in->rs_ohm + in->rr_scale * cfg->rotor_ohm + iron * cfg->across2_H2;
    float ratio = sqrtf(across / along); /* d/q */
    return sqrtf(cfg->per_Nm * size_Nm * (cfg->ls2_H2 * ratio + cfg->across2_H2 / ratio));
}

float ht_least_loss_step(const ht_least_loss_config *cfg, ht_least_loss_state *st,
                         const ht_least_loss_input *in, float most_Wb)
{
    float wanted;
    st->error_Nm += cfg->error_gain * (in->torque_Nm - in->torque_ref_Nm - st->error_Nm);
    if ((st->error_Nm - st->error_Nm) != 0.0f) {
        st->error_Nm = 0.0f; /* NaN or infinity: nothing learnt */
    }
    wanted = ht_least_loss_Wb(cfg, in, in->torque_ref_Nm + st->error_Nm);
    if (in->limited || !(wanted < most_Wb)) { /* NaN is no flux to fall to */
        wanted = most_Wb;
    } else if (wanted < cfg->floor_Wb) {
        wanted = cfg->floor_Wb;
    } else {
        /* between both */
    }
    if (!(wanted < st->held_Wb)) {
        hold(st, wanted);
    } else {
        st->asked_Wb = (wanted > st->asked_Wb) ? wanted : st->asked_Wb;
        st->waited++;
        if (st->waited >= cfg->wait) {
            hold(st, st->asked_Wb);
        }
    }
    return (st->held_Wb < most_Wb) ? st->held_Wb : most_Wb;
}
