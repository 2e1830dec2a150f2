/** @file ht_reg_model.h
 *  Registers of the register model on the host, one register file per simulated drive. ht_reg.h says what each of them does.
 */
#ifndef HT_REG_MODEL_H
#define HT_REG_MODEL_H

#include "../host/ht_regfile.h"

#define HT_INTERRUPT

typedef ht_regfile ht_io;
typedef HT_INTERRUPT void (*ht_isr)(void);

#define HT_RD16(io, addr) ht_regfile_read16((io), (addr))
#define HT_WR16(io, addr, value) ht_regfile_write16((io), (addr), (value))
#define HT_RD32(io, addr) ht_regfile_read32((io), (addr))
#define HT_WR32(io, addr, value) ht_regfile_write32((io), (addr), (value))
#define HT_VECTOR(io, addr, isr) ht_regfile_vector((io), (addr), (isr))
#define HT_CALL(io, addr) ((void)ht_regfile_call((io), (addr), 0u))
#define HT_CALL16(io, addr, argument) ht_regfile_call((io), (addr), (argument))
#define HT_EALLOW(io) ht_regfile_eallow((io), 1u)
#define HT_EDIS(io) ht_regfile_eallow((io), 0u)
#define HT_SETTLE(io) ht_regfile_settle(io)
#define HT_NOP(io) ht_regfile_nop(io)
#define HT_DEVICE_CAL(io) ((void)ht_regfile_call((io), HT_REGFILE_DEVICE_CAL, 0u))
#define HT_WAIT_US(io, us) ht_regfile_busy((io), (us))
#define HT_DINT(io) ht_regfile_intm((io), 1u)
#define HT_EINT(io) ht_regfile_intm((io), 0u)
#define HT_IFR_CLEAR(io) ht_regfile_ifr_clear(io)
#define HT_IER_WRITE(io, mask) ht_regfile_ier((io), (mask))
#define HT_IER_SET(io, mask) ht_regfile_ier((io), (uint16_t)((io)->ier | (mask)))
#define HT_ABSOLUTE(io) ht_regfile_absolute(io)
#define HT_IDLE(io) ht_regfile_idle(io)

#endif
