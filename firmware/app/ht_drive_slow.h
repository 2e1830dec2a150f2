/** @file ht_drive_slow.h
 *  The parts of the slow interrupt (ht_drive_slow.c), a file for each: ht_drive_heat.c, ht_drive_flux.c,
 *  ht_drive_limits.c, ht_drive_magnets.c, ht_drive_motion.c. All of them get the configuration that was in
 *  force when the interrupt began.
 */
#ifndef HT_DRIVE_SLOW_H
#define HT_DRIVE_SLOW_H

#include "ht_drive_inside.h"

/** From this load on R_r matters (`ht_drive_load`). */
#define HT_LOWER_LOAD 0.4f

/** From this speed of the flux on, electrical, it turns: what it tells hangs on R_s no more. */
#define HT_TURNING_RAD_S 4.5f

/** The torque limit, and what makes it so. */
typedef struct {
    float most_Nm;
    uint16_t by; /**< HT_LIMIT_... */
} ht_limit;

/** The smaller one; NaN limits nothing. */
static inline float ht_smaller(float a, float limit)
{
    return (a < limit) ? a : limit;
}

/* Heat. The machine cools in every state. Gates that are on need a winding that is not too hot. */

/** Temperatures, and with them `heat_share`, `heat_warnings` and `heat_faults`. */
void ht_drive_follow_heat(ht_drive *d, const ht_drive_config *c);

/* Flux and limits of an induction machine in RUN, in the order of their calls. */

/** The torque limit, and the flux that leaves the torque current. */
void ht_drive_limit_torque(ht_drive *d, const ht_drive_config *c);
/** The current along the flux as it will be a slow period on, A, if it grows as it did since the last
 *  one: beyond the real pull-out it grows by itself. Without the ripple, of which the flux's distance
 *  from its reference tells. */
float ht_drive_follow_along(ht_drive *d, const ht_drive_config *c);
/** Current in alpha-beta that the lost legs leave. */
float ht_drive_derated_A(const ht_drive *d, const ht_drive_config *c);
/** Rotor flux, not below a share of the reference. */
float ht_drive_rotor_Wb(const ht_drive *d);
/** |i_q/i_d| of the references. */
float ht_drive_load(const ht_drive *d, const ht_drive_config *c);

/** What the loss depends on, in this slow interrupt. */
ht_least_loss_input ht_drive_loses(const ht_drive *d);

/* For each kind of rotor (HT_ROTOR_DOES). */

/** The references of RUN: limit, torque and flux. With magnets the torque that current and flux allow, the
 *  reference within it, and the flux with which it takes the least current, or costs the least loss. */
void ht_induction_refer(ht_drive *d, const ht_drive_config *c);
void ht_magnet_refer(ht_drive *d, const ht_drive_config *c);

/** Current of the rotor that heats it, seen from the stator. */
float ht_induction_across_A(const ht_drive *d, const ht_drive_config *c);
static inline float ht_magnet_across_A(const ht_drive *d, const ht_drive_config *c)
{
    (void)d;
    (void)c;
    return 0.0f;
}

/* Motion. */

/** The torque reference, by the speed or as it is given, within its limits. */
void ht_drive_follow_reference(ht_drive *d, const ht_drive_config *c);
/** A stop is over when the shaft stands as for a start and the brake holds it, or when its time is. Then
 *  the gates go off, as at a command of the background. */
void ht_drive_come_to_a_stop(ht_drive *d, const ht_drive_config *c);

#endif
