#include "ht_ramp.h"

#include "ht_limited.h"

#include <math.h>
#include <stdint.h>

void ht_ramp_reset(ht_ramp_state *st, float speed_rpm)
{
    st->speed_rpm = speed_rpm;
    st->slope_rpm = 0.0f;
}

/* The stop is planned with this share of the jerk. Without the rest, rounding would take the last changes
 * beyond the jerk, and so beyond the target. */
#define PLANNED 0.98f

/* More changes than this do not fit into a way: the rate counts then. */
#define MOST_CHANGES 1.0e4f

/* The largest change v from which steps of the jerk j come to 0 within a way: v + (v - j) + (v - 2j) + ...
 * With v = (n + f) j, 0 <= f < 1, these are n + 1 changes, together j (n (n + 1)/2 + (n + 1) f). */
static float stopping_rpm(float way_rpm, float jerk_rpm, float rate_rpm)
{
    float way = way_rpm / jerk_rpm;
    float root = 0.5f * (sqrtf(1.0f + 8.0f * way) - 1.0f);
    float n;
    float v_rpm;
    if (!(root < MOST_CHANGES)) {
        return rate_rpm;
    }
    n = (float)(uint16_t)root;
    v_rpm = way_rpm; /* one change is left: exactly, or a target of 0 would never be reached */
    if (n > 0.0f) {
        v_rpm = jerk_rpm * (n + (way - 0.5f * n * (n + 1.0f)) / (n + 1.0f));
    }
    return (v_rpm < rate_rpm) ? v_rpm : rate_rpm;
}

float ht_ramp_step(const ht_ramp_config *cfg, ht_ramp_state *st, float target_rpm,
                   float measured_rpm, bool held)
{
    float speed = st->speed_rpm;
    bool falls = ((speed > 0.0f) && (target_rpm < speed))
                 || ((speed < 0.0f) && (target_rpm > speed));
    float rate = falls ? cfg->down_rpm : cfg->up_rpm;
    float aim = (falls && ((speed > 0.0f) != (target_rpm > 0.0f))) ? 0.0f : target_rpm;
    float missing = target_rpm - speed;
    float step = missing;
    bool away;
    if ((missing - missing) != 0.0f) {
        return speed; /* NaN or infinite */
    }
    if (rate > 0.0f) {
        if (cfg->jerk_rpm > 0.0f) {
            float most = stopping_rpm(fabsf(missing), PLANNED * cfg->jerk_rpm, rate);
            float wanted = ht_limited(missing, most);
            float change = wanted - st->slope_rpm;
            step = (fabsf(change) <= cfg->jerk_rpm)
                       ? wanted
                       : (st->slope_rpm + ht_limited(change, cfg->jerk_rpm));
        } else {
            /* Beyond 0 the other rate counts. */
            step = ht_limited(aim - speed, rate);
        }
    } else if (aim != target_rpm) {
        step = (cfg->up_rpm > 0.0f) ? (aim - speed) : missing;
    } else {
        /* at once */
    }
    away = (speed > measured_rpm) ? (step > 0.0f) : ((speed < measured_rpm) && (step < 0.0f));
    if (held && away) {
        st->slope_rpm = 0.0f;
        return speed;
    }
    st->slope_rpm = step;
    st->speed_rpm = (step == missing) ? target_rpm : (speed + step);
    return st->speed_rpm;
}
