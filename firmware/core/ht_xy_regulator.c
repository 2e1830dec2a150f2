#include "ht_xy_regulator.h"

#include "ht_limited.h"

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
    ht_xy with;
    ht_xy against;

    /* Both frames have the same proportional gain, and rotating there and back
     * leaves the error as it was: 2 Kp. */
    full.x = 2.0f * cfg->kp_pu_A * error.x + (st->with.x + st->against.x) * c
             - (st->with.y - st->against.y) * s;
    full.y = 2.0f * cfg->kp_pu_A * error.y + (st->with.x - st->against.x) * s
             + (st->with.y + st->against.y) * c;
    out.x = ht_limited(full.x, limit_pu);
    out.y = ht_limited(full.y, limit_pu);

    if (!hold) {
        if ((out.x != full.x) && ((error.x * full.x) > 0.0f)) {
            error.x = 0.0f;
        }
        if ((out.y != full.y) && ((error.y * full.y) > 0.0f)) {
            error.y = 0.0f;
        }
        error.x *= cfg->ki_ts_pu_A;
        error.y *= cfg->ki_ts_pu_A;
        with.x = st->with.x + error.x * c + error.y * s;
        with.y = st->with.y + error.y * c - error.x * s;
        against.x = st->against.x + error.x * c - error.y * s;
        against.y = st->against.y + error.y * c + error.x * s;
        if (!(with.x * with.x + with.y * with.y + against.x * against.x + against.y * against.y
              <= limit_pu * limit_pu)) { /* else none of the four exceeds the limit */
            with.x = ht_limited(with.x, limit_pu);
            with.y = ht_limited(with.y, limit_pu);
            against.x = ht_limited(against.x, limit_pu);
            against.y = ht_limited(against.y, limit_pu);
        }
        st->with.x = with.x;
        st->with.y = with.y;
        st->against.x = against.x;
        st->against.y = against.y;
    }
    return out;
}
