/** @file ht_drive_inside.h
 *  The common part of the drive's files (ht_drive*.c). Of other code only the service reads here: the
 *  configuration in force.
 */
#ifndef HT_DRIVE_INSIDE_H
#define HT_DRIVE_INSIDE_H

#include "ht_drive.h"

#include <math.h>

#define HT_RAD_S_PER_RPM 0.104719755f

/** The configuration in force. The pointer is read once, because the fast interrupt may exchange
 *  the configuration at any time. */
static inline const ht_drive_config *ht_config_in_force(const ht_drive *d)
{
    const ht_drive_config *const volatile *config = &d->config;
    return *config;
}

static inline void ht_drive_enter(ht_drive *d, ht_state state)
{
    d->state_ticks = 0u; /* first: the interrupt acts on the state */
    d->state = (uint16_t)state;
}

/** The flux reference, and the control step's copy with what follows from it. */
static inline void ht_drive_set_flux_ref(ht_drive *d, float flux_Wb)
{
    d->flux_ref_Wb = flux_Wb;
    d->in.flux_ref_Wb = flux_Wb;
    d->in.inv_flux_ref2 = (flux_Wb > 0.0f) ? (1.0f / (flux_Wb * flux_Wb)) : 0.0f;
}

/** False for NaN. */
static inline bool ht_finite_below(float value, float limit)
{
    return fabsf(value) < limit;
}

/** Could a shaft be caught that turns? Its flux must be known, and the drive whole. */
bool ht_drive_can_catch(const ht_drive *d);

/** A comparator's findings since the gates went on, fault bits. */
HT_SELDOM uint16_t ht_drive_by_comparator(const ht_drive *d);

/** The brake closes: nothing holds the shaft any more. */
void ht_drive_close_brake(ht_drive *d);

/** The chopper, in every state: an over-voltage must go with the gates off, too. */
HT_SELDOM void ht_drive_follow_chopper(ht_drive *d);

/** From which voltage of the dc link on the fast interrupt looks closer. */
void ht_drive_look(ht_drive *d);

/** The levels of the comparators, around the offsets in force. */
HT_SELDOM void ht_drive_set_levels(ht_drive *d);

#endif
