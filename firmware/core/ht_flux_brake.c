#include "ht_flux_brake.h"

#include "ht_limited.h"

/* The current along the flux takes this share at most: then the torque's part is as large. */
#define ALONG_SHARE 0.70710678f
/* Share of the voltage that turns the raised flux at most. The tables' mean torque is below its
 * reference by an amount that grows with the flux and towards the voltage's limit, and must stay below
 * HT_VDC_PUSH. */
#define TURNS_SHARE 0.9f
/* Of the square of the check's limit: from the first share on less flux is added, from the second on
 * none. */
#define LESS_FROM 0.1f
#define NONE_FROM 0.25f

void ht_flux_brake_reset(ht_flux_brake_state *st)
{
    st->left = 0.0f;
}

/* `flux_Wb`, or as much of it as makes `per_Wb` times it no more than `most`; NaN if one of them is. */
static float lowered_Wb(float flux_Wb, float per_Wb, float most)
{
    float lower_Wb;
    if ((per_Wb * flux_Wb) <= most) {
        return flux_Wb;
    }
    lower_Wb = most / per_Wb;
    return (lower_Wb > flux_Wb) ? flux_Wb : lower_Wb;
}

float ht_flux_brake_step(const ht_flux_brake_config *cfg, ht_flux_brake_state *st,
                         const ht_flux_brake_input *in, float normal_Wb)
{
    float fits = (NONE_FROM - cfg->per_check * in->off2) / (NONE_FROM - LESS_FROM);
    float room = ht_between(fits, 0.0f, 1.0f) * ht_between(1.0f - in->torque_share, 0.0f, 1.0f);
    float raised = cfg->most_Wb - cfg->raise_Wb * (1.0f - room);
    float turns = TURNS_SHARE * in->turns_V;              /* times the flux's speed */
    float bears = ALONG_SHARE * in->most_A * in->flux_Wb; /* times the current along the flux */
    float by_current_Wb;
    float by_voltage_Wb;
    if (!in->may || !(cfg->raise_Wb > 0.0f)) {
        st->left = 0.0f;
    } else if (in->limits) {
        st->left = cfg->hold;
    } else {
        st->left = (st->left > 1.0f) ? (st->left - 1.0f) : 0.0f;
    }
    if (!(st->left > 0.0f)) {
        return normal_Wb;
    }
    by_current_Wb = lowered_Wb(raised, in->along_A, bears);
    by_voltage_Wb = lowered_Wb(raised, fabsf(in->omega_rad_s), turns);
    if (!(by_current_Wb > normal_Wb) || !(by_voltage_Wb > normal_Wb)) {
        return normal_Wb;
    }
    return (by_current_Wb < by_voltage_Wb) ? by_current_Wb : by_voltage_Wb;
}
