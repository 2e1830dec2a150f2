/** @file ht_drive_inside.h
 *  What the files of the drive (ht_drive*.c) share and no other code calls.
 */
#ifndef HT_DRIVE_INSIDE_H
#define HT_DRIVE_INSIDE_H

#include "ht_drive.h"

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

/** The levels of the comparators, around the offsets in force. */
HT_SELDOM void ht_drive_set_levels(ht_drive *d);

#endif
