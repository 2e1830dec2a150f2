#include "ht_duty.h"

ht_action_points ht_duty(unsigned group, unsigned k, ht_xy v_pu)
{
    const ht_duty_row *row = &ht_duty_table[group][k];
    ht_action_points p;
    p.t1 = row->t1_0 + row->t1_x * v_pu.x + row->t1_y * v_pu.y;
    p.t2 = p.t1 + row->t2_0 + row->t2_x * v_pu.x + row->t2_y * v_pu.y;
    /* Written so that NaN ends on a bound too. */
    p.t1 = (p.t1 > 0.0f) ? p.t1 : 0.0f;
    p.t1 = (p.t1 < 1.0f) ? p.t1 : 1.0f;
    p.t2 = (p.t2 > p.t1) ? p.t2 : p.t1;
    p.t2 = (p.t2 < 1.0f) ? p.t2 : 1.0f;
    return p;
}
