#include "ht_lost_legs.h"

#include "ht_limited.h"
#include "ht_rotors.h"
#include "ht_tables.h"
#include "ht_winding.h"

#include <math.h>

#define COS_30 0.866025404f
/* Legs that are 90 degrees apart where the sets are 30. */
#define U1_V2 0x21u
#define U2_W1 0x18u
#define W2_V1 0x06u
/* The lost leg's own command over its terminal's voltage: the set's other legs come to a rail before
 * the terminal's voltage is 7 % of Vdc. */
#define CLAMP_GAIN 10.0f
/* Its largest command: with two thirds the three legs have all the room between the rails. A little
 * less, so that rounding does not take them beyond. */
#define CLAMP_ROOM 0.66f
/* No inverter makes more than this, units of Vdc. */
#define MOST_PU 1.0f
/* Directions of direct current in half a turn: the other half has the same, negated. */
#define HALF_TURN 6u
/* Squares that differ by less are equal. */
#define EQUAL 0.01f

static float along(ht_ab a, ht_ab v)
{
    return a.alpha * v.alpha + a.beta * v.beta;
}

static float along_xy(ht_xy b, ht_xy v)
{
    return b.x * v.x + b.y * v.y;
}

/* The axis of a leg, and the one across it. A leg of the same set, 120 degrees away, takes b to
 * where the other set's leg, 90 degrees away, takes it to minus b. */
static void axes_of(unsigned leg, bool set, ht_lost_legs *lost)
{
    const ht_vsd *column = &ht_transform[lost->winding][leg];
    ht_lost_axis *first = &lost->axis[0];
    ht_lost_axis *second = &lost->axis[1];
    float sign = set ? -1.0f : 1.0f;
    first->a.alpha = 3.0f * column->ab.alpha;
    first->a.beta = 3.0f * column->ab.beta;
    first->b.x = 3.0f * column->xy.x;
    first->b.y = 3.0f * column->xy.y;
    second->a.alpha = -first->a.beta;
    second->a.beta = first->a.alpha;
    second->b.x = -sign * first->b.y;
    second->b.y = sign * first->b.x;
    first->more_ohm = 0.0f;
    second->more_ohm = 0.0f;
    lost->set = set;
    lost->of_set2 = (leg & 1u) != 0u;
}

uint16_t ht_lost_legs_paired(ht_winding winding, uint16_t legs)
{
    static const uint16_t pairs[3] = {U1_V2, U2_W1, W2_V1};
    unsigned word = legs;
    uint16_t result = legs;
    if ((winding == HT_WINDING_30) && ((word & (word - 1u)) == 0u)) {
        int n;
        for (n = 0; n < 3; n++) {
            if ((word & pairs[n]) != 0u) {
                result = pairs[n];
            }
        }
    }
    return result;
}

uint16_t ht_lost_legs_of(ht_winding winding, uint16_t legs, ht_lost_legs *lost)
{
    unsigned off = legs;
    bool pair = (off == U1_V2) || (off == U2_W1) || (off == W2_V1);
    lost->winding = winding;
    lost->axes = 0u;
    lost->of_set2 = false;
    lost->set = false;
    if ((off == 0u) || (off > HT_ALL_LEGS)) {
        return 0u;
    }
    axes_of(ht_first_leg[off], false, lost);
    if ((off & (off - 1u)) == 0u) {
        lost->axes = 1u;
    } else if (pair && (winding == HT_WINDING_30)) {
        lost->axes = 2u;
    } else if (((off & HT_SET2) == 0u) || ((off & HT_SET1) == 0u)) {
        /* Two legs of a set: the third one has no return path. */
        off = ((off & HT_SET2) == 0u) ? HT_SET1 : HT_SET2;
        axes_of(ht_first_leg[off], true, lost);
        lost->axes = 2u;
    } else {
        off = 0u;
    }
    return (uint16_t)off;
}

void ht_lost_legs_differ(ht_lost_legs *lost, float set2_ohm)
{
    /* Along the first axis the set that does not have its leg carries the current. */
    float first_ohm = lost->of_set2 ? -set2_ohm : set2_ohm;
    lost->axis[0].more_ohm = first_ohm;
    lost->axis[1].more_ohm = lost->set ? first_ohm : -first_ohm;
}

ht_vsd ht_lost_legs_voltage(const ht_lost_legs *lost, const ht_observer_config *machine,
                            float rs_ohm, ht_vsd v_V, ht_xy from, ht_xy to)
{
    float l = machine->lxy_H * machine->inv_ts;
    float r = 0.5f * rs_ohm;
    ht_xy acts = {r * (from.x + to.x) + l * (to.x - from.x),
                  r * (from.y + to.y) + l * (to.y - from.y)};
    ht_vsd v = v_V;
    uint16_t n;
    for (n = 0u; n < lost->axes; n++) {
        const ht_lost_axis *x = &lost->axis[n];
        float more = along_xy(x->b, acts) - along_xy(x->b, v_V.xy);
        /* b.i = -a.i; in both planes the drop is larger by this, which the observer does not know */
        float drop = x->more_ohm * (along_xy(x->b, from) + along_xy(x->b, to));
        v.ab.alpha += (more + drop) * x->a.alpha;
        v.ab.beta += (more + drop) * x->a.beta;
        v.xy.x += more * x->b.x;
        v.xy.y += more * x->b.y;
    }
    return v;
}

ht_ab ht_lost_legs_expected(const ht_lost_legs *lost, const ht_observer_config *machine,
                            float rs_ohm, ht_vsd v_V, ht_ab i_A, ht_ab r_Wb, float turn_rad)
{
    float kappa = machine->lxy_H * machine->inv_sigma_ls;
    float turn = turn_rad * machine->inv_ts * kappa;
    ht_ab moves = {-turn * r_Wb.beta, turn * r_Wb.alpha}; /* kappa dr/dt */
    ht_ab v = v_V.ab;
    uint16_t n;
    for (n = 0u; n < lost->axes; n++) {
        const ht_lost_axis *x = &lost->axis[n];
        float i = along(x->a, i_A);
        float drop = rs_ohm * i;
        float drops = 2.0f * (drop + x->more_ohm * i); /* in both planes */
        float had = along(x->a, v_V.ab);
        float w = had - along_xy(x->b, v_V.xy);
        float more = (w - drops + along(x->a, moves)) / (1.0f + kappa) + drop - had;
        v.alpha += more * x->a.alpha;
        v.beta += more * x->a.beta;
    }
    return v;
}

ht_xy ht_lost_legs_across(const ht_lost_legs *lost, ht_xy value)
{
    ht_xy n5 = {-lost->axis[0].b.y, lost->axis[0].b.x};
    float size = (lost->axes == 1u) ? along_xy(n5, value) : 0.0f;
    n5.x *= size;
    n5.y *= size;
    return n5;
}

/* The x-y current that a current in alpha-beta has without the legs, if there is none across b. */
static ht_xy forced(const ht_lost_legs *lost, ht_ab i)
{
    ht_xy made = {0.0f, 0.0f};
    uint16_t n;
    for (n = 0u; n < lost->axes; n++) {
        const ht_lost_axis *x = &lost->axis[n];
        float size = along(x->a, i);
        made.x -= size * x->b.x;
        made.y -= size * x->b.y;
    }
    return made;
}

uint16_t ht_lost_legs_aligning(const ht_lost_legs *lost)
{
    uint16_t best = 0u;
    float least2 = 2.0f; /* more than any */
    uint16_t k;
    for (k = 0u; k < HALF_TURN; k++) {
        ht_xy i = forced(lost, ht_twelfth(lost->winding, k));
        float size2 = i.x * i.x + i.y * i.y;
        if (size2 < (least2 - EQUAL)) {
            least2 = size2;
            best = k;
        }
    }
    return best;
}

float ht_lost_legs_most_A(const ht_lost_legs *lost, ht_ab i_A)
{
    ht_xy xy = forced(lost, i_A);
    float most = 0.0f;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        const ht_vsd *column = &ht_transform[lost->winding][leg];
        float size = fabsf(3.0f * (along(column->ab, i_A) + along_xy(column->xy, xy)));
        most = (size > most) ? size : most;
    }
    return most;
}

ht_vsd ht_lost_legs_command(const ht_lost_legs *lost, const ht_observer_config *machine,
                            const ht_voltage_law_input *in, ht_vsd v_pu)
{
    float inv_vdc = 1.0f / in->vdc_V;
    float kappa = machine->lxy_H * machine->inv_sigma_ls;
    float per_ohm = machine->inv_sigma_ls * inv_vdc;
    float turn = in->turn_rad * machine->inv_ts * inv_vdc;
    /* sigma L_s i: times `per_ohm` a current over Vdc */
    ht_ab leaks = {in->psi_Wb.alpha - in->rotor_Wb.alpha, in->psi_Wb.beta - in->rotor_Wb.beta};
    ht_ab moves = {-turn * in->rotor_Wb.beta, turn * in->rotor_Wb.alpha};
    ht_vsd v = v_pu;
    float phase[2];    /* a.v_ab - b.v_xy, along and across */
    float terminal[2]; /* voltage of the lost leg's terminal */
    ht_xy emf = {0.0f, 0.0f};
    uint16_t n;
    if (HT_ROTOR_DOES(machine->rotor, induces, ())) {
        emf.x = inv_vdc * in->emf_V.x;
        emf.y = inv_vdc * in->emf_V.y;
    }
    phase[1] = along(lost->axis[1].a, v_pu.ab) - along_xy(lost->axis[1].b, v_pu.xy);
    for (n = 0u; n < lost->axes; n++) {
        const ht_lost_axis *x = &lost->axis[n];
        float law = along(x->a, v_pu.ab);
        float i = per_ohm * along(x->a, leaks);
        float drop = in->rs_ohm * i;
        float more = drop + 2.0f * x->more_ohm * i;
        more -= along_xy(x->b, emf);
        phase[n] = ht_limited(law + kappa * (law - drop - along(x->a, moves)) + more, MOST_PU);
        terminal[n] = 2.0f * law - phase[n];
    }
    for (n = 0u; n < lost->axes; n++) {
        const ht_lost_axis *x = &lost->axis[n];
        /* The set's other two legs are at minus half of this sum, plus and minus cos 30 of `phase`. */
        float room = CLAMP_ROOM * (1.0f - COS_30 * fabsf(phase[1u - n]));
        float sum = lost->set ? 0.0f
                              : ht_limited(CLAMP_GAIN * terminal[n], (room > 0.0f) ? room : 0.0f);
        float more = 0.5f * (sum + phase[n]) - along(x->a, v_pu.ab);
        float more_xy = 0.5f * (sum - phase[n]) - along_xy(x->b, v_pu.xy);
        v.ab.alpha += more * x->a.alpha;
        v.ab.beta += more * x->a.beta;
        v.xy.x += more_xy * x->b.x;
        v.xy.y += more_xy * x->b.y;
    }
    return v;
}
