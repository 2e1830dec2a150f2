/** @file ht_port_c2000.h
 *  `ht_port` of the C2000 targets: one PWM per leg, ePWM1..6 = u1 u2 w1 w2 v1 v2.
 */
#ifndef HT_PORT_C2000_H
#define HT_PORT_C2000_H

#include "../port.h"
#include "ht_c2000_map.h"
#include "ht_reg.h"

struct ht_port {
    ht_io *io;               /**< register file (unused on the DSP) */
    const ht_c2000_map *map; /**< device */
    bool shadow;
};

#endif
