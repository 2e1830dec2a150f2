#include "ht_catch.h"

#include "ht_turned.h"

#include <math.h>

/* Of a flux error, the share that one step removes under shadow load. The sample shows it a period later:
 * at a half the current does not overshoot, even if sigma L_s is 1.5 times as large as it is said to be. */
#define CATCH_SHARE 0.5f
/* Largest step, units of Vdc Ts: what the modulator makes in every direction. */
#define CATCH_MOST_PU 0.55f

/* The pull is this over the time since the beginning. The current model's error then falls with the fourth
 * power of time while the flux turns slowly, and at once as soon as it turns faster. */
#define CATCH_PULL 4.0f

void ht_catch_begin(ht_catch_state *st, ht_ab psi_Wb)
{
    float size_Wb = sqrtf(psi_Wb.alpha * psi_Wb.alpha + psi_Wb.beta * psi_Wb.beta);
    st->along.alpha = 1.0f;
    st->along.beta = 0.0f;
    if (size_Wb > 0.0f) {
        st->along.alpha = psi_Wb.alpha / size_Wb;
        st->along.beta = psi_Wb.beta / size_Wb;
    }
    st->step_Wb.alpha = 0.0f;
    st->step_Wb.beta = 0.0f;
    st->periods = 0.0f;
}

float ht_catch_pull(ht_catch_state *st)
{
    st->periods += 1.0f;
    return (st->periods > CATCH_PULL) ? (CATCH_PULL / st->periods) : 1.0f;
}

/* The unit vector, turned with the rotor. The factor takes back what many turns change of its length. */
static void turn_along(ht_catch_state *st, float turn_rad)
{
    ht_ab u = ht_turned(st->along, turn_rad);
    float keep = 1.5f - 0.5f * (u.alpha * u.alpha + u.beta * u.beta);
    st->along.alpha = keep * u.alpha;
    st->along.beta = keep * u.beta;
}

ht_ab ht_catch_step(const ht_observer_config *machine, const ht_observer_state *flux,
                    ht_catch_state *st, const ht_catch_input *in)
{
    float turn_rad = machine->ts_s * flux->omega_sync_rad_s;
    float most_Wb = CATCH_MOST_PU * in->vdc_V * machine->ts_s;
    float drop = machine->ts_s * flux->rs_ohm;
    ht_ab drop_Wb = {drop * in->i_A.alpha, drop * in->i_A.beta};
    ht_ab from;
    ht_ab step;
    float size_Wb;
    turn_along(st, in->turn_rad);
    from.alpha = in->flux_ref_Wb * st->along.alpha;
    from.beta = in->flux_ref_Wb * st->along.beta;
    from = ht_turned(from, turn_rad); /* a period after the sample */
    step.alpha = from.alpha - in->psi_Wb.alpha + drop_Wb.alpha;
    step.beta = from.beta - in->psi_Wb.beta + drop_Wb.beta;
    if (in->shadow) {
        ht_ab to = ht_turned(from, turn_rad);
        step.alpha = to.alpha - from.alpha + drop_Wb.alpha
                     + CATCH_SHARE * (step.alpha - st->step_Wb.alpha);
        step.beta = to.beta - from.beta + drop_Wb.beta
                    + CATCH_SHARE * (step.beta - st->step_Wb.beta);
    }
    size_Wb = sqrtf(step.alpha * step.alpha + step.beta * step.beta);
    if (size_Wb > most_Wb) {
        step.alpha *= most_Wb / size_Wb;
        step.beta *= most_Wb / size_Wb;
    }
    st->step_Wb = step;
    return step;
}
