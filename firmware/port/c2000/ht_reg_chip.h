/** @file ht_reg_chip.h
 *  Registers and CPU instructions on the DSP: volatile accesses to absolute word addresses. ht_reg.h says what each of them does.
 */
#ifndef HT_REG_CHIP_H
#define HT_REG_CHIP_H

#include <stdint.h>

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
/** The boards have none. With one the call of a function that reads it belongs here. */
#define HT_ABSOLUTE(io) ((void)(io), HT_NO_READING)
#define HT_IDLE(io) __asm(" NOP")

#endif
