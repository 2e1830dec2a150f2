#include "ht_vdc.h"

static float larger(float a, float b)
{
    return (a > b) ? a : b;
}

static float smaller(float a, float b)
{
    return (a < b) ? a : b;
}

float ht_vdc_torque_Nm(const ht_vdc_config *cfg, float torque_Nm, float limit_Nm, float omega_rad_s,
                       float from_rad_s, float vdc_V)
{
    float sign = (omega_rad_s < 0.0f) ? -1.0f : 1.0f;
    float along_Nm = sign * torque_Nm; /* positive: the shaft takes energy from the link */
    float per_V = cfg->per_band * limit_Nm;
    if (vdc_V > cfg->above_V) {
        float least_Nm = per_V * (vdc_V - cfg->high_V);
        float room_Nm = cfg->kp_Nms_rad * (HT_VDC_FASTER * from_rad_s - sign * omega_rad_s);
        float push_Nm = smaller(HT_VDC_PUSH * limit_Nm, larger(room_Nm, 0.0f));
        along_Nm = larger(along_Nm, smaller(least_Nm, push_Nm));
    }
    if (vdc_V < cfg->below_V) {
        float braking_Nm = smaller(limit_Nm, cfg->kp_Nms_rad * sign * omega_rad_s);
        along_Nm = smaller(along_Nm, larger(per_V * (vdc_V - cfg->low_V), -braking_Nm));
    }
    return sign * along_Nm;
}
