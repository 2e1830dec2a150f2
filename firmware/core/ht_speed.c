#include "ht_speed.h"

static float limited(float value, float limit)
{
    if (value > limit) {
        return limit;
    }
    return (value < -limit) ? -limit : value;
}

float ht_speed_step(const ht_speed_config *cfg, ht_speed_state *st, float error_rad_s)
{
    float limit = cfg->torque_limit_Nm;
    float wanted = cfg->kp_Nms_rad * error_rad_s + st->integral_Nm;
    float torque = limited(wanted, limit);
    if ((wanted - wanted) != 0.0f) {
        return 0.0f; /* NaN or infinity: no torque, nothing learnt */
    }
    if ((torque == wanted) || ((error_rad_s * wanted) < 0.0f)) {
        /* Limited, not refused: the limit may have been lowered meanwhile. */
        st->integral_Nm = limited(st->integral_Nm + cfg->ki_ts_Nms_rad * error_rad_s, limit);
    }
    return torque;
}

float ht_flux_reference(const ht_flux_config *cfg, float vdc_V, float omega_sync_rad_s, float i_A)
{
    float omega = (omega_sync_rad_s < 0.0f) ? -omega_sync_rad_s : omega_sync_rad_s;
    float room_V = cfg->reach_pu * vdc_V - cfg->rs_ohm * i_A;
    if ((omega * cfg->flux_ref_Wb) <= room_V) {
        return cfg->flux_ref_Wb;
    }
    if (room_V > (omega * cfg->flux_min_Wb)) {
        return room_V / omega;
    }
    return cfg->flux_min_Wb;
}
