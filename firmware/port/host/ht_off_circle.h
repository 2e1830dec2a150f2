/** @file ht_off_circle.h
 *  What the protection's check of the flux finds at one instant, for the host's text about a trip.
 */
#ifndef HT_OFF_CIRCLE_H
#define HT_OFF_CIRCLE_H

#include "ht_params.h"
#include "ht_types.h"
#include "port.h"

/** Distance of a current from the circle diagram of a flux, which is not 0, in no-load currents:
 *  `ht_protect_slow` without its means over time. */
float ht_off_circle(const ht_port *port, const ht_params *p, ht_ab psi_Wb, ht_ab i_A);

#endif
