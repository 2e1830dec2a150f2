/** @file ht_magnet.h
 *  A machine whose rotor has permanent magnets.
 *
 *  Its stator flux is psi = L_q i + r with r = (psi_f + (L_d - L_q) i_d) u, where u is the d axis. So
 *  the control takes L_q for the stator transient inductance, and r for the rotor flux seen from the
 *  stator: the "active flux" (Boldea, Paicu, Andreescu, IEEE Trans. Power Electron. 24(1), 2009).
 *  Torque is 3 P/L_q r x psi, as in an induction machine. What differs stands here: where r comes
 *  from, how it moves, and which flux and torque are asked for.
 */
#ifndef HT_MAGNET_H
#define HT_MAGNET_H

#include "ht_types.h"

typedef struct {
    float psi_f_Wb;  /**< flux linkage of the magnets, > 0 */
    float inv_psi_f; /**< 1 / psi_f_Wb */
    float ld_H;      /**< at most L_q */
    float lq_H;
    float inv_ld;      /**< 1 / ld_H */
    float saliency_H;  /**< L_d - L_q, 0 or less */
    float share;       /**< (L_d - L_q)/L_d: how much r changes with the flux along the d axis */
    float torque_gain; /**< 3 P */
    ht_ab
        emf5_Wb; /**< fifth and seventh harmonic of the induced voltage over the electrical speed, */
    ht_ab emf7_Wb; /**< as complex numbers: size psi_f times the share, and phase */
} ht_magnet_config;

/** The length of r at the current `i_A` if the d axis is `axis`. */
float ht_magnet_active_Wb(const ht_magnet_config *m, ht_ab axis, ht_ab i_A);

/** Voltage that the magnets' harmonics induce in x-y while the d axis `axis` turns with
 *  `omega_rad_s`: the fifth turns with five times the angle, the seventh against it. */
ht_xy ht_magnet_induced_V(const ht_magnet_config *m, ht_ab axis, float omega_rad_s);

/** Angle by which a rotor at rest, pulled by direct current, is ahead of it: the harmonics make a torque with
 *  the current in x-y. `axis`: direction of the current. */
float ht_magnet_pulled_rad(const ht_magnet_config *m, ht_ab axis, ht_vsd i_A);

/** Parts along the d axis and across it. */
typedef struct {
    float d;
    float q;
} ht_dq;

/** The least current that makes this torque. */
ht_dq ht_magnet_least_A(const ht_magnet_config *m, float torque_Nm);

/** The current that makes this torque with the least loss in copper and iron,
 *  3 (R_s i^2 + k psi^2) with k = `iron_W_Wb2`. With psi_d = psi_f + L_d i_d and psi_q = L_q i_q it is
 *
 *    3 (a (i_d - d_0)^2 + b i_q^2) + constant,  a = R_s + k L_d^2,  b = R_s + k L_q^2,
 *    d_0 = -k psi_f L_d/a,  T = 3 P (psi_f + (L_d - L_q) i_d) i_q.
 *
 *  So (i_d - d_0, sqrt(b/a) i_q) is the least current of a machine with the magnets
 *  psi_f + (L_d - L_q) d_0 at the torque sqrt(b/a) T. (The loss as a rule for magnets: Morimoto, Tong,
 *  Takeda, Hirasa, IEEE Trans. Ind. Electron. 41(5), 1994.) No number if there is no loss. */
ht_dq ht_magnet_least_loss_A(const ht_magnet_config *m, float rs_ohm, float iron_W_Wb2,
                             float torque_Nm);

/** Length of the stator flux with this current. */
float ht_magnet_flux_Wb(const ht_magnet_config *m, ht_dq i_A);

/** The stator flux of this length that has this torque one step on: its parts along r and across it,
 *  Wb. `r_Wb`: length of r now, at the flux `now`. While the flux moves along r, r changes with it, so
 *  the torque is 3 P/L_q q (r + share (d - d_now)). By Newton's rule, two rounds from the present q: a
 *  fixed point would diverge where the saliency is large. The part along r stays a tenth of the flux. */
ht_dq ht_magnet_wanted_Wb(const ht_magnet_config *m, float r_Wb, ht_dq now, float flux_Wb,
                          float torque_Nm);

/** The same for the end of a transient, whose flux may be far from `now`. Three rounds, from 0 if the present
 *  q has the other sign. With L_q above L_d the part along r stays so small that r does not vanish: more
 *  flux than the torque asks for would need a large current that strengthens the magnets. */
ht_dq ht_magnet_reference_Wb(const ht_magnet_config *m, float r_Wb, ht_dq now, float flux_Wb,
                             float torque_Nm);

/** Largest flux that `reach_V` turns at this electrical speed with this torque. */
float ht_magnet_turned_Wb(float reach_V, float omega_rad_s, float rs_ohm, float torque_Nm,
                          float torque_gain);

/** Largest torque that `reach_V` can drive at this electrical speed, which is positive where the torque
 *  drives and negative where it brakes: then it is endless. */
float ht_magnet_driven_Nm(float reach_V, float omega_rad_s, float rs_ohm, float torque_gain);

/** Flux that its largest voltage between two terminals has, over the electrical speed: with the fundamental
 *  `psi_f_Wb`, and the shares of the harmonics at their worst. */
float ht_magnet_terminal_Wb(float psi_f_Wb, float share5, float share7);

/** The current `dt_s` later, a small part of a turn, while all terminals are connected. */
ht_dq ht_magnet_shorted(const ht_magnet_config *m, float rs_ohm, float omega_rad_s, float dt_s,
                        ht_dq i_A);

/** Largest current, amplitude, once all terminals are connected at this electrical speed while the machine
 *  carries `across_A` across the d axis, of either sign: i_d swings to about -2 psi_f/L_d where R_s is
 *  small, and settles near -psi_f/L_d. */
float ht_magnet_short_A(const ht_magnet_config *m, float rs_ohm, float omega_rad_s, float across_A);

/** Largest torque with a current of `i_A` at most and a stator flux of `flux_Wb` at most. */
float ht_magnet_most_Nm(const ht_magnet_config *m, float i_A, float flux_Wb);

/** The least flux between these two with which a current of `i_A` makes this torque, which is not
 *  negative, within a 256th of their distance; `most_Wb` if none does. */
float ht_magnet_needed_Wb(const ht_magnet_config *m, float i_A, float torque_Nm, float from_Wb,
                          float most_Wb);

#endif
