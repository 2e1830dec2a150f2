/** @file ht_change.h
 *  Read-modify-write of registers that not only this driver uses.
 */
#ifndef HT_CHANGE_H
#define HT_CHANGE_H

#include "ht_reg.h"

/** Clear some bits of a register and set others, in one read and one write. */
static inline void ht_change16(ht_io *io, uint32_t addr, uint16_t clear, uint16_t set)
{
    uint16_t kept = (uint16_t)(HT_RD16(io, addr) & (uint16_t)~clear);
    HT_WR16(io, addr, (uint16_t)(kept | set));
}

static inline void ht_change32(ht_io *io, uint32_t addr, uint32_t clear, uint32_t set)
{
    HT_WR32(io, addr, (HT_RD32(io, addr) & ~clear) | set);
}

#endif
