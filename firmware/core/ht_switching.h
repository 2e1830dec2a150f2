/** @file ht_switching.h
 *  Flux sector and switching tables: which direction, if any, the next period's
 *  voltage takes.
 */
#ifndef HT_SWITCHING_H
#define HT_SWITCHING_H

#include "ht_types.h"

#define HT_SECTORS 12u

/** Switching table, named after the angle between the flux and the vectors that
 *  raise and lower it (both tables place sector s at 30 s degrees, +-15). */
typedef enum {
    HT_TABLE_45_135 = 0, /**< keeps the flux sign over the whole TMVCL box */
    HT_TABLE_75_105 = 1, /**< paper B, Table I */
    HT_TABLE_60_120 = 2  /**< six vectors at 60 n degrees, groups HT_L0 and HT_L60. Sector s lies at
                          *   30 s - 15 degrees, +-15, and a pair of sectors has the same vectors */
} ht_table;

/** Sector 0..11 of a vector. Sector s covers 30 s - 15 to 30 s + 15 degrees; a vector exactly on
 *  an edge may get either neighbour. Every input, NaN included, gives a valid sector. */
unsigned ht_sector(ht_ab v);

/** The same for the sectors of HT_TABLE_60_120. */
unsigned ht_sector_of_six(ht_ab v);

/** Direction 0..11 (15 + 30 k degrees, or an entry of HT_L0) for a flux in `sector`, torque to rise or
 *  fall, flux to rise or fall. */
unsigned ht_direction(ht_table table, unsigned sector, bool torque_up, bool flux_up);

/** Direction 0..11 closest to the flux in `sector`, on the side that raises the
 *  torque (`ahead`) or lowers it. */
unsigned ht_direction_along(ht_table table, unsigned sector, bool ahead);

#endif
