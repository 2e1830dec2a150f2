/** @file ht_drive_inside.h
 *  The common part of the drive's files (ht_drive*.c). Of other code only the service reads here: the
 *  configuration in force.
 */
#ifndef HT_DRIVE_INSIDE_H
#define HT_DRIVE_INSIDE_H

#include "ht_drive.h"

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

/** From which voltage of the dc link on the fast interrupt looks closer. */
void ht_drive_look(ht_drive *d);

/** The levels of the comparators, around the offsets in force. */
HT_SELDOM void ht_drive_set_levels(ht_drive *d);

#endif
