/** @file ht_virtual_period.h
 *  One period of a drive on the register model.
 */
#ifndef HT_VIRTUAL_PERIOD_H
#define HT_VIRTUAL_PERIOD_H

#include "ht_drive.h"
#include "ht_port_c2000.h"

/** A period passes for the timers of the drive's chip, and the fast interrupt comes, unless it is lost
 *  (ht_regfile). For a drive without the rest of the board. */
void ht_virtual_period(ht_drive *d);

#endif
