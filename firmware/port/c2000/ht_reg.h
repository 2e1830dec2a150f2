/** @file ht_reg.h
 *  Register access and CPU instructions for C2000 drivers: on the DSP, in the register
 *  model of the host, or in plain memory, where they are counted.
 *
 *  Addresses are word addresses; a word has 16 bits. `io` is the handle of the
 *  register file: unused on the DSP, where the addresses are the hardware.
 *
 *  HT_RD16, HT_WR16, HT_RD32, HT_WR32   one access of that width
 *  HT_SETTLE     after clock enables have been written, before the first access
 *  HT_NOP        one instruction that does nothing
 *  HT_WAIT_US    at least that many microseconds
 *  HT_VECTOR     enter an interrupt function into a vector
 *  HT_CALL       call a function of TI's in ROM or OTP; HT_CALL16 with argument and result
 *  HT_DEVICE_CAL call TI's Device_cal, which does not keep the registers that C expects
 *  HT_ABSOLUTE   reading of an absolute encoder, HT_NO_READING: none
 *  HT_IDLE       one turn of the background loop is over
 */
#ifndef HT_REG_H
#define HT_REG_H

#if defined(__TMS320C2000__)
#include "ht_reg_chip.h"
#elif defined(HT_REGISTERS_AT)
#include "ht_reg_memory.h"
#else
#include "ht_reg_model.h"
#endif

#endif
