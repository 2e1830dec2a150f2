/** @file ht_reg.h
 *  Register access for C2000 drivers. The same driver source runs on the DSP
 *  (volatile accesses to absolute word addresses) and on the host (calls into
 *  the register model, one register file per simulated drive). A third kind serves to
 *  count instructions.
 *
 *  Addresses are word addresses; a word has 16 bits. `io` is the handle of the
 *  register file: unused on the DSP, where the addresses are the hardware.
 */
#ifndef HT_REG_H
#define HT_REG_H

#include <stdint.h>

#ifdef __TMS320C2000__

typedef void ht_io;

#define HT_RD16(io, addr) (*(volatile uint16_t *)(addr))
#define HT_WR16(io, addr, value) (*(volatile uint16_t *)(addr) = (value))
#define HT_RD32(io, addr) (*(volatile uint32_t *)(addr))
#define HT_WR32(io, addr, value) (*(volatile uint32_t *)(addr) = (value))
#define HT_EALLOW(io) __asm(" EALLOW")
#define HT_EDIS(io) __asm(" EDIS")

#elif defined(HT_REGISTERS_AT)

/* Plain memory from this address on: what the accesses cost, without what they do. */
typedef void ht_io;

#define HT_REGISTER(type, addr) (*(volatile type *)(HT_REGISTERS_AT + 2u * (uint32_t)(addr)))
#define HT_RD16(io, addr) HT_REGISTER(uint16_t, addr)
#define HT_WR16(io, addr, value) (HT_REGISTER(uint16_t, addr) = (value))
#define HT_RD32(io, addr) HT_REGISTER(uint32_t, addr)
#define HT_WR32(io, addr, value) (HT_REGISTER(uint32_t, addr) = (value))
#define HT_EALLOW(io) __asm volatile("nop")
#define HT_EDIS(io) __asm volatile("nop")

#else

#include "../host/ht_regfile.h"

typedef ht_regfile ht_io;

#define HT_RD16(io, addr) ht_regfile_read16((io), (addr))
#define HT_WR16(io, addr, value) ht_regfile_write16((io), (addr), (value))
#define HT_RD32(io, addr) ht_regfile_read32((io), (addr))
#define HT_WR32(io, addr, value) ht_regfile_write32((io), (addr), (value))
#define HT_EALLOW(io) ht_regfile_eallow((io), 1)
#define HT_EDIS(io) ht_regfile_eallow((io), 0)

#endif

#endif
