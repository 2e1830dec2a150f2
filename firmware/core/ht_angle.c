#include "ht_angle.h"

#include "ht_limited.h"

#define HALF_PI 1.57079633f

/* Sine and cosine on -pi/4..pi/4 by their series; what is left out is below 4e-7 and 3e-8. The last
 * coefficients are those that keep the error equal at the ends and inside. */
static float sine(float x)
{
    float x2 = x * x;
    return x * (1.0f + x2 * (-0.16666667f + x2 * (8.3333310e-3f + x2 * -1.9839336e-4f)));
}

static float cosine(float x)
{
    float x2 = x * x;
    return 1.0f + x2 * (-0.5f + x2 * (4.1666642e-2f + x2 * (-1.3888397e-3f + x2 * 2.4760495e-5f)));
}

ht_ab ht_unit(float turns)
{
    float quarters = 4.0f * ht_between(turns, 0.0f, 1.0f);
    uint16_t whole = (uint16_t)(quarters + 0.5f);
    float x = HALF_PI * (quarters - (float)whole); /* the difference is exact */
    float c = cosine(x);
    float s = sine(x);
    ht_ab u;
    switch (whole & 3u) {
    case 0u:
        u.alpha = c;
        u.beta = s;
        break;
    case 1u:
        u.alpha = -s;
        u.beta = c;
        break;
    case 2u:
        u.alpha = -c;
        u.beta = -s;
        break;
    default:
        u.alpha = s;
        u.beta = -c;
        break;
    }
    return u;
}
