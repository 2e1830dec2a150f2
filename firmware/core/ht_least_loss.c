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

float ht_least_loss_iron_W_Wb2(const ht_least_loss_config *cfg, float omega_rad_s)
{
    float omega = (omega_rad_s < 0.0f) ? -omega_rad_s : omega_rad_s;
    return omega * (cfg->hysteresis_ohm + cfg->eddy_ohm * omega);
}

float ht_least_loss_Wb(const ht_least_loss_config *cfg, const ht_least_loss_input *in,
                       float torque_Nm)
{
    float size_Nm = (torque_Nm < 0.0f) ? -torque_Nm : torque_Nm;
    float iron = ht_least_loss_iron_W_Wb2(cfg, in->omega_rad_s);
    float along = in->rs_ohm + iron * cfg->ls2_H2;
    float across = in->rs_ohm + in->rr_scale * cfg->rotor_ohm + iron * cfg->across2_H2;
    float ratio = sqrtf(across / along); /* d/q */
    return sqrtf(cfg->per_Nm * size_Nm * (cfg->ls2_H2 * ratio + cfg->across2_H2 / ratio));
}

float ht_least_loss_torque_Nm(const ht_least_loss_config *cfg, ht_least_loss_state *st,
                              const ht_least_loss_input *in)
{
    st->error_Nm += cfg->error_gain * (in->torque_Nm - in->torque_ref_Nm - st->error_Nm);
    if ((st->error_Nm - st->error_Nm) != 0.0f) {
        st->error_Nm = 0.0f; /* NaN or infinity: nothing learnt */
    }
    return in->torque_ref_Nm + st->error_Nm;
}

float ht_least_loss_follow(const ht_least_loss_config *cfg, ht_least_loss_state *st, bool limited,
                           float wanted_Wb, float most_Wb)
{
    float wanted = wanted_Wb;
    if (limited || !(wanted < most_Wb)) { /* NaN is no flux to fall to */
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

float ht_least_loss_step(const ht_least_loss_config *cfg, ht_least_loss_state *st,
                         const ht_least_loss_input *in, float most_Wb)
{
    float torque_Nm = ht_least_loss_torque_Nm(cfg, st, in);
    return ht_least_loss_follow(cfg, st, in->limited, ht_least_loss_Wb(cfg, in, torque_Nm),
                                most_Wb);
}
