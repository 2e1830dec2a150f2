#include "ht_speed.h"

#include "ht_limited.h"

void ht_speed_reset(ht_speed_state *st)
{
    st->integral_Nm = 0.0f;
}

void ht_speed_follow(ht_speed_state *st, float torque_Nm)
{
    st->integral_Nm = torque_Nm;
}

float ht_speed_step(const ht_speed_config *cfg, ht_speed_state *st, float error_rad_s,
                    float least_Nm, float most_Nm)
{
    float wanted = cfg->kp_Nms_rad * error_rad_s + st->integral_Nm;
    float torque = ht_between(wanted, least_Nm, most_Nm);
    if ((wanted - wanted) != 0.0f) {
        return 0.0f; /* NaN or infinity: no torque, nothing learnt */
    }
    if ((torque == wanted) || ((error_rad_s * wanted) < 0.0f)) {
        /* Limited, not refused: the limit may have been lowered meanwhile. */
        st->integral_Nm =
            ht_between(st->integral_Nm + cfg->ki_ts_Nms_rad * error_rad_s, least_Nm, most_Nm);
    }
    return torque;
}

float ht_flux_reference(const ht_flux_config *cfg, const ht_flux_input *in)
{
    float omega = (in->omega_sync_rad_s < 0.0f) ? -in->omega_sync_rad_s : in->omega_sync_rad_s;
    float room_V = cfg->reach_pu * in->vdc_V - cfg->rs_ohm * in->i_A;
    if ((omega * in->flux_Wb) <= room_V) {
        return in->flux_Wb;
    }
    if (room_V > (omega * cfg->flux_min_Wb)) {
        return room_V / omega;
    }
    return cfg->flux_min_Wb;
}
