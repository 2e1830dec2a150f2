/** @file ht_cmpss.h
 *  Over-current and over-voltage by hardware: the comparator subsystems (CMPSS) of the F28377S. Two
 *  comparators watch each phase current whose pin leads to a subsystem, one for each direction, and one
 *  watches the dc link. They trip all legs without code: subsystem -> ePWM X-BAR (TRIP5) -> digital
 *  compare (DCBEVT1) of each leg. They are a back-up for what happens between two samples. The F28335
 *  has none.
 *
 *  A digital filter takes 20 samples, 50 ns apart; 15 of them must be beyond the level. So what stays
 *  beyond it trips after 0.75 us, and switching noise of less than 0.7 us never does.
 */
#ifndef HT_CMPSS_H
#define HT_CMPSS_H

#include "ht_drivers.h"

/** All levels out of reach. With the legs tripped, after `ht_dead_man_start`. */
void ht_cmpss_start(ht_port *port);
/** Forget what has tripped. */
void ht_cmpss_forget(ht_port *port);

#endif
