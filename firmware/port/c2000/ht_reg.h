/** @file ht_reg.h
 *  Register access and CPU instructions for C2000 drivers. The same driver source
 *  runs on the DSP (volatile accesses to absolute word addresses) and on the host
 *  (calls into the register model, one register file per simulated drive). A third
 *  kind serves to count instructions.
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
 *  HT_IDLE       one turn of the background loop is over
 */
#ifndef HT_REG_H
#define HT_REG_H

#include <stdint.h>

#if !defined(__TMS320C2000__) && !defined(HT_REGISTERS_AT)
#include "../host/ht_regfile.h"
#endif

#ifdef __TMS320C2000__

#define HT_INTERRUPT __interrupt

typedef void ht_io;
typedef HT_INTERRUPT void (*ht_isr)(void);

extern __cregister volatile unsigned int IER;
extern __cregister volatile unsigned int IFR;

/** Busy waiting: no timer is needed, and more than `us` does not hurt. */
void ht_wait_us(uint16_t us);

/** Device_cal with the CPU's registers saved around it (devicecal.asm). */
void ht_device_cal(void);

static inline uint16_t ht_rd16(const ht_io *io, uint32_t addr)
{
    (void)io;
    return *(volatile uint16_t *)(uintptr_t)addr;
}

static inline void ht_wr16(ht_io *io, uint32_t addr, uint16_t value)
{
    (void)io;
    *(volatile uint16_t *)(uintptr_t)addr = value;
}

static inline uint32_t ht_rd32(const ht_io *io, uint32_t addr)
{
    (void)io;
    return *(volatile uint32_t *)(uintptr_t)addr;
}

static inline void ht_wr32(ht_io *io, uint32_t addr, uint32_t value)
{
    (void)io;
    *(volatile uint32_t *)(uintptr_t)addr = value;
}

static inline void ht_enter_vector(ht_io *io, uint32_t addr, ht_isr isr)
{
    (void)io;
    *(ht_isr volatile *)(uintptr_t)addr = isr;
}

static inline void ht_call(ht_io *io, uint32_t addr)
{
    (void)io;
    ((void (*)(void))(uintptr_t)addr)();
}

static inline uint16_t ht_call16(ht_io *io, uint32_t addr, uint16_t argument)
{
    (void)io;
    return ((uint16_t (*)(uint16_t))(uintptr_t)addr)(argument);
}

#define HT_RD16(io, addr) ht_rd16((io), (addr))
#define HT_WR16(io, addr, value) ht_wr16((io), (addr), (value))
#define HT_RD32(io, addr) ht_rd32((io), (addr))
#define HT_WR32(io, addr, value) ht_wr32((io), (addr), (value))
#define HT_VECTOR(io, addr, isr) ht_enter_vector((io), (addr), (isr))
#define HT_CALL(io, addr) ht_call((io), (addr))
#define HT_CALL16(io, addr, argument) ht_call16((io), (addr), (argument))
#define HT_EALLOW(io) __asm(" EALLOW")
#define HT_EDIS(io) __asm(" EDIS")
#define HT_SETTLE(io) __asm(" RPT #7 || NOP")
#define HT_NOP(io) __asm(" NOP")
#define HT_DEVICE_CAL(io) ht_device_cal()
#define HT_WAIT_US(io, us) ht_wait_us(us)
#define HT_DINT(io) __asm(" SETC INTM")
#define HT_EINT(io) __asm(" CLRC INTM")
#define HT_IFR_CLEAR(io) (IFR = 0u)
#define HT_IER_WRITE(io, mask) (IER = (mask))
#define HT_IER_SET(io, mask) (IER |= (mask))
#define HT_IDLE(io) __asm(" NOP")

#elif defined(HT_REGISTERS_AT)

/* Plain memory of an Arm from this address on: what the accesses cost, one instruction
 * each as on the DSP, without what they do. The interrupts' work only: nothing here
 * waits, calls or enters vectors. */
#define HT_INTERRUPT

typedef void ht_io;
typedef HT_INTERRUPT void (*ht_isr)(void);

static inline uint16_t ht_rd16(const ht_io *io, uint32_t addr)
{
    uint32_t value;
    (void)io;
    __asm volatile("ldrh %0, [%1, %2, lsl #1]" : "=r"(value) : "r"(HT_REGISTERS_AT), "r"(addr));
    if (value > 0xFFFFu) {
        __builtin_unreachable(); /* the compiler does not know what ldrh loads */
    }
    return (uint16_t)value;
}

static inline void ht_wr16(ht_io *io, uint32_t addr, uint16_t value)
{
    (void)io;
    __asm volatile("strh %0, [%1, %2, lsl #1]" : : "r"(value), "r"(HT_REGISTERS_AT), "r"(addr));
}

static inline uint32_t ht_rd32(const ht_io *io, uint32_t addr)
{
    uint32_t value;
    (void)io;
    __asm volatile("ldr %0, [%1, %2, lsl #1]" : "=r"(value) : "r"(HT_REGISTERS_AT), "r"(addr));
    return value;
}

static inline void ht_wr32(ht_io *io, uint32_t addr, uint32_t value)
{
    (void)io;
    __asm volatile("str %0, [%1, %2, lsl #1]" : : "r"(value), "r"(HT_REGISTERS_AT), "r"(addr));
}

#define HT_RD16(io, addr) ht_rd16((io), (addr))
#define HT_WR16(io, addr, value) ht_wr16((io), (addr), (value))
#define HT_RD32(io, addr) ht_rd32((io), (addr))
#define HT_WR32(io, addr, value) ht_wr32((io), (addr), (value))
#define HT_EALLOW(io) __asm volatile("nop")
#define HT_EDIS(io) __asm volatile("nop")
#define HT_SETTLE(io) ((void)(io))
#define HT_NOP(io) __asm volatile("nop")
#define HT_DEVICE_CAL(io) ((void)(io))
#define HT_WAIT_US(io, us) ((void)(io), (void)(us))
#define HT_VECTOR(io, addr, isr) ((void)(io), (void)(addr), (void)(isr))
#define HT_CALL(io, addr) ((void)(io), (void)(addr))
#define HT_CALL16(io, addr, argument) ((void)(io), (void)(addr), (uint16_t)(argument))
#define HT_DINT(io) ((void)(io))
#define HT_EINT(io) ((void)(io))
#define HT_IFR_CLEAR(io) ((void)(io))
#define HT_IER_WRITE(io, mask) ((void)(io), (void)(mask))
#define HT_IER_SET(io, mask) ((void)(io), (void)(mask))
#define HT_IDLE(io) ((void)(io))

#else

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
#define HT_IDLE(io) ht_regfile_idle(io)

#endif

#endif
