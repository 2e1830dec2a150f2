/** @file ht_pil_side.h
 *  A register target: it has the C2000 driver and a register model of its own, and reports to the
 *  host which registers changed.
 */
#ifndef HT_PIL_SIDE_H
#define HT_PIL_SIDE_H

#include "ht_mirror.h"
#include "ht_port_c2000.h"

typedef struct {
    ht_regfile registers;
    ht_mirror mirror;
} ht_pil_side;

#endif
