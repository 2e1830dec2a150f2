#include "ht_magnet.h"

#include "ht_limited.h"
#include "ht_turned.h"

#include <math.h>

/* Below this share of L_q a difference of the inductances is none. */
#define SALIENT 0.001f
/* Rounds of an iteration. That for the least current leaves in each a third of the error at 1.5 times the
 * torque of a machine whose L_q is three times its L_d, that for a flux halves its range. */
#define ROUNDS 8
/* Least part of the flux that is along r, and least slope of q r over q, in psi_f. */
#define LEAST_ALONG 0.1f
#define LEAST_ALONG2 (LEAST_ALONG * LEAST_ALONG)
#define LEAST_SLOPE 0.2f
/* Of a reference. Least r of a machine whose L_q is above its L_d, in psi_f; the largest part of the flux
 * across r from which a round begins. */
#define LEAST_ACTIVE 0.7f
#define MOST_ACROSS 0.98f
#define NO_LIMIT_WB 1.0e30f
/* Of the largest torque at a flux: beyond it the torque falls again. */
#define PULL_OUT 0.9f
#define ROOT_3 1.73205081f
/* A short circuit's current is followed over an electrical turn, in which it is the largest. A step is no
 * longer than this share of L_d/R_s. */
#define SHORT_STEPS 128
#define SHORT_STEP_RAD (6.2831853f / (float)SHORT_STEPS)
#define SHORT_STEP_TIMES 0.25f
/* Over the largest torque of a voltage: below this there is none. */
#define LEAST_DRIVEN 1.0e-9f

static bool salient(const ht_magnet_config *m)
{
    return m->saliency_H < -SALIENT * m->lq_H;
}

float ht_magnet_active_Wb(const ht_magnet_config *m, ht_ab axis, ht_ab i_A)
{
    return m->psi_f_Wb + m->saliency_H * ht_along(axis, i_A);
}

ht_xy ht_magnet_induced_V(const ht_magnet_config *m, ht_ab axis, float omega_rad_s)
{
    ht_ab two = ht_product(axis, axis);
    ht_ab five = ht_product(ht_product(two, two), axis);
    ht_ab seven = ht_product(five, two);
    ht_ab e5 = ht_product(m->emf5_Wb, five);
    ht_ab e7 = ht_product(m->emf7_Wb, seven);
    ht_xy v; /* j omega (e5 - conj(e7)) */
    v.x = -omega_rad_s * (e5.beta + e7.beta);
    v.y = omega_rad_s * (e5.alpha - e7.alpha);
    return v;
}

/* The harmonics at the angle turn with five or seven times of it: each round takes half of the rest. */
#define ASIDE_ROUNDS 6

float ht_magnet_pulled_rad(const ht_magnet_config *m, ht_ab axis, ht_vsd i_A)
{
    float along_A = ht_along(axis, i_A.ab);
    float stiff_VAs = along_A * (m->psi_f_Wb + m->saliency_H * along_A);
    float rad = 0.0f;
    int n;
    if (!(stiff_VAs > 0.0f)) {
        return 0.0f;
    }
    for (n = 0; n < ASIDE_ROUNDS; n++) {
        ht_xy e = ht_magnet_induced_V(m, ht_turned(axis, rad), 1.0f);
        rad = (e.x * i_A.xy.x + e.y * i_A.xy.y) / stiff_VAs;
    }
    return rad;
}

/* i_d = h - sqrt(h^2 + i_q^2) with h = psi_f / 2(L_q - L_d): there the torque per ampere is largest. */
static float along_A(const ht_magnet_config *m, float q_A)
{
    float h;
    if (!salient(m)) {
        return 0.0f;
    }
    h = -0.5f * m->psi_f_Wb / m->saliency_H;
    return h - sqrtf(h * h + q_A * q_A);
}

ht_dq ht_magnet_least_A(const ht_magnet_config *m, float torque_Nm)
{
    float per_Wb = torque_Nm / m->torque_gain;
    ht_dq i = {0.0f, per_Wb * m->inv_psi_f};
    int n;
    for (n = 0; salient(m) && (n < ROUNDS); n++) {
        i.d = along_A(m, i.q);
        i.q = 0.5f * (i.q + per_Wb / (m->psi_f_Wb + m->saliency_H * i.d));
    }
    return i;
}

ht_dq ht_magnet_least_loss_A(const ht_magnet_config *m, float rs_ohm, float iron_W_Wb2,
                             float torque_Nm)
{
    float along_ohm = rs_ohm + iron_W_Wb2 * m->ld_H * m->ld_H;
    float across_ohm = rs_ohm + iron_W_Wb2 * m->lq_H * m->lq_H;
    float idle_A = -iron_W_Wb2 * m->psi_f_Wb * m->ld_H / along_ohm;
    float weight = sqrtf(across_ohm / along_ohm);
    ht_magnet_config shifted = *m;
    ht_dq i;
    shifted.psi_f_Wb = m->psi_f_Wb + m->saliency_H * idle_A;
    shifted.inv_psi_f = 1.0f / shifted.psi_f_Wb;
    i = ht_magnet_least_A(&shifted, weight * torque_Nm);
    i.d += idle_A;
    i.q /= weight;
    return i;
}

float ht_magnet_flux_Wb(const ht_magnet_config *m, ht_dq i_A)
{
    float d_Wb = m->psi_f_Wb + m->ld_H * i_A.d;
    float q_Wb = m->lq_H * i_A.q;
    return sqrtf(d_Wb * d_Wb + q_Wb * q_Wb);
}

static float part_along(float flux2, float q)
{
    float d2 = flux2 - q * q;
    return sqrtf((d2 > LEAST_ALONG2 * flux2) ? d2 : (LEAST_ALONG2 * flux2));
}

/* NaN stays one. */
static float at_most(float value, float most)
{
    return (value > most) ? most : value;
}

/* Rounds of Newton's rule for the part of a flux across r, from `begin` on. Each begins at `across` at most; the
 * part along r is at most `along`. */
static ht_dq of_torque(const ht_magnet_config *m, float r_Wb, ht_dq now, float flux_Wb,
                       float torque_Nm, float begin, float across, float along, int rounds)
{
    float flux2 = flux_Wb * flux_Wb;
    float product = torque_Nm * m->lq_H / m->torque_gain;
    float least = LEAST_SLOPE * m->psi_f_Wb;
    ht_dq wanted = {0.0f, begin};
    int n;
    for (n = 0; n < rounds; n++) {
        float q = ht_limited(wanted.q, across);
        float d = at_most(part_along(flux2, q), along);
        float r = r_Wb + m->share * (d - now.d);
        float slope = r - m->share * q * q / d;
        wanted.q = q - (q * r - product) / ((slope > least) ? slope : least);
    }
    wanted.d = at_most(part_along(flux2, wanted.q), along);
    return wanted;
}

ht_dq ht_magnet_wanted_Wb(const ht_magnet_config *m, float r_Wb, ht_dq now, float flux_Wb,
                          float torque_Nm)
{
    return of_torque(m, r_Wb, now, flux_Wb, torque_Nm, now.q, NO_LIMIT_WB, NO_LIMIT_WB, 2);
}

ht_dq ht_magnet_reference_Wb(const ht_magnet_config *m, float r_Wb, ht_dq now, float flux_Wb,
                             float torque_Nm)
{
    float q = (now.q * torque_Nm < 0.0f) ? 0.0f : now.q;
    float along = flux_Wb;
    if (m->share < 0.0f) {
        along = ht_between(now.d + (LEAST_ACTIVE * m->psi_f_Wb - r_Wb) / m->share,
                           LEAST_ALONG * flux_Wb, flux_Wb);
    }
    return of_torque(m, r_Wb, now, flux_Wb, torque_Nm, q, MOST_ACROSS * flux_Wb, along, 3);
}

/* |v|^2 = (omega psi)^2 + 2 R omega T/(3 P) + ...: the drop along the voltage is R T/(3 P psi). */
float ht_magnet_turned_Wb(float reach_V, float omega_rad_s, float rs_ohm, float torque_Nm,
                          float torque_gain)
{
    float omega = fabsf(omega_rad_s);
    float power = ((omega_rad_s < 0.0f) ? -torque_Nm : torque_Nm) / torque_gain;
    float root2 = reach_V * reach_V - 4.0f * omega * rs_ohm * power;
    float root = (root2 > 0.0f) ? sqrtf(root2) : 0.0f;
    return 0.5f * (reach_V + root) / ((omega > 1.0f) ? omega : 1.0f);
}

/* Where the root above ends: V^2 = 4 R omega T/(3 P). */
float ht_magnet_driven_Nm(float reach_V, float omega_rad_s, float rs_ohm, float torque_gain)
{
    float per_Nm = 4.0f * omega_rad_s * rs_ohm;
    float reach2 = reach_V * reach_V * torque_gain;
    return (per_Nm > LEAST_DRIVEN * reach2) ? (reach2 / per_Nm) : (1.0f / LEAST_DRIVEN);
}

/* The flux's part along the d axis where the torque at this flux is the largest: 3 P/L_q r(d) q with
 * r = r0 + share d and q^2 = flux^2 - d^2. */
static float along_at_pull_out_Wb(const ht_magnet_config *m, float flux_Wb)
{
    float r0 = m->psi_f_Wb * (1.0f - m->share);
    return salient(m)
               ? (0.25f * (sqrtf(r0 * r0 + 8.0f * m->share * m->share * flux_Wb * flux_Wb) - r0)
                  / m->share)
               : 0.0f;
}

static float torque_at_Nm(const ht_magnet_config *m, float flux_Wb, float d_Wb)
{
    float r = m->psi_f_Wb + m->share * (d_Wb - m->psi_f_Wb);
    return m->torque_gain / m->lq_H * r * sqrtf(flux_Wb * flux_Wb - d_Wb * d_Wb);
}

/* Part along the d axis of a current of `i_A` that makes this flux:
 * (psi_f + L_d d)^2 + L_q^2 (i^2 - d^2) = flux^2. Below -i_A if all of the current is against the magnets
 * and the flux is still larger, on either side of 0. */
static float along_A_at(const ht_magnet_config *m, float i_A, float flux_Wb)
{
    float a = (m->ld_H - m->lq_H) * (m->ld_H + m->lq_H);
    float half_b = m->psi_f_Wb * m->ld_H;
    float lq_Wb = m->lq_H * i_A;
    float c = m->psi_f_Wb * m->psi_f_Wb + lq_Wb * lq_Wb - flux_Wb * flux_Wb;
    float root2 = half_b * half_b - a * c;
    /* Of the two solutions the one that stays finite for a = 0. */
    return (root2 > 0.0f) ? (-c / (half_b + sqrtf(root2))) : (-2.0f * i_A);
}

float ht_magnet_most_Nm(const ht_magnet_config *m, float i_A, float flux_Wb)
{
    float h = salient(m) ? (-0.25f * m->psi_f_Wb / m->saliency_H) : 0.0f;
    float pull_out_Wb = along_at_pull_out_Wb(m, flux_Wb);
    float most_Nm = PULL_OUT * torque_at_Nm(m, flux_Wb, pull_out_Wb);
    float torque_Nm;
    ht_dq i;
    i.d = salient(m) ? (h - sqrtf(h * h + 0.5f * i_A * i_A)) : 0.0f; /* most torque per ampere */
    i.q = sqrtf(i_A * i_A - i.d * i.d);
    if (ht_magnet_flux_Wb(m, i) > flux_Wb) { /* weakened: more current against the magnets */
        if ((m->psi_f_Wb - m->ld_H * i_A) >= flux_Wb) {
            return 0.0f; /* this current cannot lower the flux so far */
        }
        i.d = along_A_at(m, i_A, flux_Wb);
        if ((m->psi_f_Wb + m->ld_H * i.d) <= pull_out_Wb) {
            return most_Nm; /* takes less current */
        }
        i.q = sqrtf(i_A * i_A - i.d * i.d);
    }
    torque_Nm = m->torque_gain * (m->psi_f_Wb + m->saliency_H * i.d) * i.q;
    return (torque_Nm < most_Nm) ? torque_Nm : most_Nm;
}

float ht_magnet_needed_Wb(const ht_magnet_config *m, float i_A, float torque_Nm, float from_Wb,
                          float most_Wb)
{
    float low_Wb = from_Wb;
    float high_Wb = most_Wb;
    int n;
    if (ht_magnet_most_Nm(m, i_A, from_Wb) >= torque_Nm) {
        return from_Wb;
    }
    for (n = 0; n < ROUNDS; n++) {
        float middle_Wb = 0.5f * (low_Wb + high_Wb);
        if (ht_magnet_most_Nm(m, i_A, middle_Wb) >= torque_Nm) {
            high_Wb = middle_Wb;
        } else {
            low_Wb = middle_Wb;
        }
    }
    return high_Wb;
}

float ht_magnet_terminal_Wb(float psi_f_Wb, float share5, float share7)
{
    return ROOT_3 * psi_f_Wb * (1.0f + fabsf(share5) + fabsf(share7));
}

/* Slopes of both currents: L_d i_d' = omega L_q i_q - R i_d, L_q i_q' = -omega (L_d i_d + psi_f) - R i_q. */
static ht_dq shorted_slope(const ht_magnet_config *m, float rs_ohm, float omega_rad_s, ht_dq i)
{
    ht_dq k;
    k.d = (omega_rad_s * m->lq_H * i.q - rs_ohm * i.d) * m->inv_ld;
    k.q = (-omega_rad_s * (m->ld_H * i.d + m->psi_f_Wb) - rs_ohm * i.q) / m->lq_H;
    return k;
}

/* A step of second order. */
ht_dq ht_magnet_shorted(const ht_magnet_config *m, float rs_ohm, float omega_rad_s, float dt_s,
                        ht_dq i_A)
{
    ht_dq k = shorted_slope(m, rs_ohm, omega_rad_s, i_A);
    ht_dq half = {i_A.d + 0.5f * dt_s * k.d, i_A.q + 0.5f * dt_s * k.q};
    k = shorted_slope(m, rs_ohm, omega_rad_s, half);
    i_A.d += dt_s * k.d;
    i_A.q += dt_s * k.q;
    return i_A;
}

/* Square of the largest current, from this one across the d axis on. */
static float shorted_A2(const ht_magnet_config *m, float rs_ohm, float omega_rad_s, float across_A)
{
    float dt_s = SHORT_STEP_RAD / omega_rad_s;
    ht_dq i = {0.0f, across_A};
    float most = across_A * across_A;
    int n;
    if (dt_s * rs_ohm > SHORT_STEP_TIMES * m->ld_H) {
        dt_s = SHORT_STEP_TIMES * m->ld_H / rs_ohm;
    }
    for (n = 0; n < SHORT_STEPS; n++) {
        float size;
        i = ht_magnet_shorted(m, rs_ohm, omega_rad_s, dt_s, i);
        size = i.d * i.d + i.q * i.q;
        most = (size > most) ? size : most;
    }
    return most;
}

float ht_magnet_short_A(const ht_magnet_config *m, float rs_ohm, float omega_rad_s, float across_A)
{
    float one = shorted_A2(m, rs_ohm, omega_rad_s, across_A);
    float other = shorted_A2(m, rs_ohm, omega_rad_s, -across_A);
    return sqrtf((one > other) ? one : other);
}
