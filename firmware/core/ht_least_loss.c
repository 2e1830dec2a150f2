#include "ht_least_loss.h"

#include <math.h>

void ht_least_loss_reset(ht_least_loss_state *st, float most_Wb)
{
    st->held_Wb = most_Wb;
    st->asked_Wb = 0.0f;
    st->waited = 0u;
}

float ht_least_loss_Wb(const ht_least_loss_config *cfg, const ht_least_loss_input *in)
{
    float omega = (in->omega_rad_s < 0.0f) ? -in->omega_rad_s : in->omega_rad_s;
    float torque_Nm = (in->torque_Nm < 0.0f) ? -in->torque_Nm : in->torque_Nm;
    float iron = omega * (cfg->hysteresis_ohm + cfg->eddy_ohm * omega);
    float along = in->rs_ohm + iron * cfg->ls2_H2;
    float across = in->rs_ohm + in->rr_scale * cfg->rotor_ohm + iron * cfg->across2_H2;
    float ratio = sqrtf(across / along); /* d/q */
    return sqrtf(cfg->per_Nm * torque_Nm * (cfg->ls2_H2 * ratio + cfg->across2_H2 / ratio));
}

float ht_least_loss_step(const ht_least_loss_config *cfg, ht_least_loss_state *st,
                         const ht_least_loss_input *in, float most_Wb)
{
    float wanted = ht_least_loss_Wb(cfg, in);
    wanted = (wanted > cfg->floor_Wb) ? wanted : cfg->floor_Wb;
    if (in->limited || !(wanted < most_Wb)) {
        wanted = most_Wb;
    }
    if (!(wanted < st->held_Wb)) {
        ht_least_loss_reset(st, wanted);
    } else {
        st->asked_Wb = (wanted > st->asked_Wb) ? wanted : st->asked_Wb;
        st->waited++;
        if (st->waited >= cfg->wait) {
            ht_least_loss_reset(st, st->asked_Wb);
        }
    }
    return (st->held_Wb < most_Wb) ? st->held_Wb : most_Wb;
}
