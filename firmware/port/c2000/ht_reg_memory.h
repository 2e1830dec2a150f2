/** @file ht_reg_memory.h
 *  Registers in plain memory of an Arm, from HT_REGISTERS_AT on: what the accesses cost, one
 *  instruction each as on the DSP, without what they do. The interrupts' work only: nothing here waits,
 *  calls or enters vectors. ht_reg.h says what each of them does.
 */
#ifndef HT_REG_MEMORY_H
#define HT_REG_MEMORY_H

#include <stdint.h>

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
#define HT_ABSOLUTE(io) ((void)(io), HT_NO_READING)
#define HT_IDLE(io) ((void)(io))

#endif
