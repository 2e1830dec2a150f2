#include "ht_look.h"

#include "ht_rotors.h"

static bool toggles_within(uint16_t at, const ht_period *period)
{
    return at < period->counts;
}

/* State word at the end of a pattern. */
HT_SELDOM static unsigned last_word(const ht_compare *p, const ht_period *period)
{
    unsigned word = p->start;
    unsigned bit = HT_LEG_U1;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        if (toggles_within(p->ca[leg], period) != toggles_within(p->cb[leg], period)) {
            word ^= bit;
        }
        bit >>= 1;
    }
    return word;
}

/* Edges of a pattern that is on the legs from currents i_A[0] to i_A[1]. One of the two switches makes an edge
 * late by the dead time: the lower one where the current flows out of the leg. */
HT_SELDOM static void find_edges(ht_look *look, const ht_look_circuit *c)
{
    const ht_compare *p = &look->pattern[1];
    uint16_t full = c->period->counts;
    float rounded = c->dead->dead_pu * (float)full + 0.5f;
    uint16_t dead = (uint16_t)rounded;
    unsigned bit = HT_LEG_U1;
    int leg;
    look->before = last_word(&look->pattern[0], c->period);
    for (leg = 0; leg < HT_LEGS; leg++) {
        bool outward = (look->i_A[0].p[leg] + look->i_A[1].p[leg]) > 0.0f;
        bool high = (look->before & bit) != 0u;
        int32_t sum = high ? (int32_t)full : 0;
        uint16_t *at = look->at[leg];
        int n;
        at[0] = (((look->before ^ p->start) & bit) != 0u) ? c->period->first : full;
        at[1] = p->ca[leg];
        at[2] = p->cb[leg];
        for (n = 0; n < HT_LOOK_EDGES; n++) {
            if (at[n] < full) {
                uint16_t left = (uint16_t)(full - at[n]);
                high = !high;
                if (high == outward) {
                    left = (left > dead) ? (uint16_t)(left - dead) : 0u;
                }
                at[n] = (uint16_t)(full - left);
                sum += high ? (int32_t)left : -(int32_t)left;
            }
        }
        look->high[leg] = (float)sum / (float)full;
        bit >>= 1;
    }
}

/* A leg that is off takes the voltage with which it has no current. */
HT_SELDOM static void open(ht_look *y, int off)
{
    float own = y->A[off][off];
    int j;
    int k;
    own = (own > 0.0f) ? (1.0f / own) : 0.0f; /* 0: its set's other legs are off, too */
    for (j = 0; j < HT_LEGS; j++) {
        float share = own * y->A[j][off];
        for (k = 0; (k < HT_LEGS) && (j != off); k++) {
            y->A[j][k] -= share * y->A[off][k];
        }
    }
    for (k = 0; k < HT_LEGS; k++) {
        y->A[off][k] = 0.0f;
    }
}

/* The inverse of the transient inductance takes u to u/L_q + (1/L_d - 1/L_q) (u along d) d. */
HT_SELDOM static void find_responses(ht_look *look, const ht_look_circuit *c)
{
    const ht_observer_config *m = c->machine;
    ht_ab axis = look->axis;
    const ht_vsd *column = ht_transform[m->winding];
    float gain = 3.0f * c->vdc_V * m->ts_s; /* the transform's inverse is its transpose, times 3 */
    float ab = gain * m->inv_sigma_ls;
    float d = HT_ROTOR_DOES(m->rotor, salient, ())
                  ? (gain * HT_ROTOR_DOES(m->rotor, inv_d, (m)) - ab)
                  : 0.0f;
    float xy = gain / c->lxy_H;
    int leg;
    int j;
    for (leg = 0; leg < HT_LEGS; leg++) {
        ht_vsd u = column[leg];
        float along = d * (axis.alpha * u.ab.alpha + axis.beta * u.ab.beta);
        u.ab.alpha = ab * u.ab.alpha + along * axis.alpha;
        u.ab.beta = ab * u.ab.beta + along * axis.beta;
        u.xy.x *= xy;
        u.xy.y *= xy;
        for (j = 0; j < HT_LEGS; j++) {
            const ht_vsd *v = &column[j];
            look->A[j][leg] = u.ab.alpha * v->ab.alpha + u.ab.beta * v->ab.beta + u.xy.x * v->xy.x
                              + u.xy.y * v->xy.y;
        }
    }
}

/* The first edge after `now`; those that are there change the word. */
HT_SELDOM static uint16_t step_word(const ht_look *look, uint16_t now, uint16_t counts,
                                    unsigned *word)
{
    uint16_t next = counts;
    unsigned bit = HT_LEG_U1;
    int leg;
    int n;
    for (leg = 0; leg < HT_LEGS; leg++) {
        for (n = 0; n < HT_LOOK_EDGES; n++) {
            uint16_t at = look->at[leg][n];
            if (at == now) {
                *word ^= bit;
            } else if ((at > now) && (at < next)) {
                next = at;
            } else {
                /* past, or later than another one */
            }
        }
        bit >>= 1;
    }
    return next;
}

/* How far each leg's voltage is from its mean, in parts of V_dc. */
HT_SELDOM static void find_away(ht_look *look, unsigned word)
{
    unsigned bit = HT_LEG_U1;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        look->away[leg] = (((word & bit) != 0u) ? 1.0f : 0.0f) - look->high[leg];
        bit >>= 1;
    }
}

/* This share of the period with one state word: the currents go on, and their squares are added up. */
HT_SELDOM static void add(const ht_look *look, float share, ht_six *i_A, ht_six *square_A2)
{
    int j;
    int k;
    for (j = 0; j < HT_LEGS; j++) {
        float from = i_A->p[j];
        float slope = look->i_A[1].p[j] - look->i_A[0].p[j];
        float to;
        for (k = 0; k < HT_LEGS; k++) {
            slope += look->A[j][k] * look->away[k];
        }
        to = from + share * slope;
        square_A2->p[j] += (1.0f / 3.0f) * share * (from * from + from * to + to * to);
        i_A->p[j] = to;
    }
}

HT_SELDOM void ht_look_squares(ht_look *look, const ht_look_circuit *circuit, ht_six *square_A2)
{
    uint16_t counts = circuit->period->counts;
    ht_six i_A;
    unsigned word;
    unsigned bit = HT_LEG_U1;
    uint16_t now;
    uint16_t next;
    int leg;
    find_edges(look, circuit);
    find_responses(look, circuit);
    for (leg = 0; leg < HT_LEGS; leg++) {
        if ((circuit->off_legs & bit) != 0u) {
            open(look, leg);
        }
        square_A2->p[leg] = 0.0f;
        bit >>= 1;
    }
    i_A = look->i_A[0];
    word = look->before;
    for (now = 0u; now < counts; now = next) {
        uint16_t span;
        next = step_word(look, now, counts, &word);
        span = (uint16_t)(next - now);
        find_away(look, word);
        add(look, (float)span / (float)counts, &i_A, square_A2);
    }
}
