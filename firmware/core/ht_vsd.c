#include "ht_vsd.h"

#define THIRD 0.333333333f
#define SIXTH 0.166666667f
#define COS_30_THIRD 0.288675135f

ht_vsd ht_vsd_from_six(const ht_six *s)
{
    float u1 = s->p[0];
    float u2 = s->p[1];
    float w1 = s->p[2];
    float w2 = s->p[3];
    float v1 = s->p[4];
    float v2 = s->p[5];
    /* The columns of ht_transform come in pairs of the same size: alpha and x are sum
     * and difference of two parts, so are beta and y. */
    float even = THIRD * u1 - SIXTH * (w1 + v1);
    float odd = COS_30_THIRD * (u2 - w2);
    float cross = COS_30_THIRD * (w1 - v1);
    float along = SIXTH * (u2 + w2) - THIRD * v2;
    ht_vsd v;
    v.ab.alpha = even + odd;
    v.ab.beta = along + cross;
    v.xy.x = even - odd;
    v.xy.y = along - cross;
    return v;
}
