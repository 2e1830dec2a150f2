#include "ht_xy_regulator.h"

#include <math.h>

static float limited(float value, float limit)
{
    if (fabsf(value) <= limit) {
        return value;
    }
    return (value > 0.0f) ? limit : -limit; /* NaN ends here too */
}

void ht_xy_reset(ht_xy_state *st)
{
    st->with.x = 0.0f;
    st->with.y = 0.0f;
    st->against.x = 0.0f;
    st->against.y = 0.0f;
}

ht_xy ht_xy_step(const ht_xy_config *cfg, ht_xy_state *st, ht_xy i_A, ht_ab turn, float limit_pu,
                 bool hold)
{
    float c = turn.alpha;
    float s = turn.beta;
    ht_xy error = {-i_A.x, -i_A.y};
    ht_xy full;
    ht_xy out;

    /* Both frames have the same proportional gain, and rotating there and back
     * leaves the error as it was: 2 Kp. */
    full.x = 2.0f * cfg->kp_pu_A * error.x + (st->with.x + st->against.x) * c
             - (st->with.y - st->against.y) * s;
    full.y = 2.0f * cfg->kp_pu_A * error.y + (st->with.x - st->against.x) * s
             + (st->with.y + st->against.y) * c;
    out.x = limited(full.x, limit_pu);
    out.y = limited(full.y, limit_pu);

    if (!hold) {
        if ((out.x != full.x) && ((error.x * full.x) > 0.0f)) {
            error.x = 0.0f;
        }
        if ((out.y != full.y) && ((error.y * full.y) > 0.0f)) {
            error.y = 0.0f;
        }
        error.x *= cfg->ki_ts_pu_A;
        error.y *= cfg->ki_ts_pu_A;
        st->with.x = limited(st->with.x + error.x * c + error.y * s, limit_pu);
        st->with.y = limited(st->with.y + error.y * c - error.x * s, limit_pu);
        st->against.x = limited(st->against.x + error.x * c - error.y * s, limit_pu);
        st->against.y = limited(st->against.y + error.y * c + error.x * s, limit_pu);
    }
    return out;
}
