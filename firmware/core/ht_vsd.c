#include "ht_vsd.h"

#include "ht_tables.h"
#include "ht_turned.h"

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

/* Set 2 turned. */
static ht_vsd turned_by(ht_ab turn, ht_vsd v)
{
    ht_ab one = {v.ab.alpha + v.xy.x, v.ab.beta - v.xy.y};
    ht_ab two = {v.ab.alpha - v.xy.x, v.ab.beta + v.xy.y};
    ht_vsd of;
    two = ht_product(two, turn);
    of.ab.alpha = 0.5f * (one.alpha + two.alpha);
    of.ab.beta = 0.5f * (one.beta + two.beta);
    of.xy.x = 0.5f * (one.alpha - two.alpha);
    of.xy.y = 0.5f * (two.beta - one.beta);
    return of;
}

HT_SELDOM ht_vsd ht_vsd_turned(ht_winding winding, ht_vsd v)
{
    return turned_by(ht_set2_turn[winding], v);
}

HT_SELDOM ht_vsd ht_vsd_turned_back(ht_winding winding, ht_vsd v)
{
    ht_ab back = {ht_set2_turn[winding].alpha, -ht_set2_turn[winding].beta};
    return turned_by(back, v);
}
