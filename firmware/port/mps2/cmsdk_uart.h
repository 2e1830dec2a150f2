/** @file cmsdk_uart.h
 *  The MPS2 boards' serial port, an APB UART of Arm's Cortex-M system design kit: one byte of
 *  buffer each way, polled. An emulator may carry bytes as fast as they are handed over; here they
 *  pass at the line's rate, by the caller's clock.
 */
#ifndef CMSDK_UART_H
#define CMSDK_UART_H

#include <stdbool.h>

#include "ht_line.h"

/** Peripheral clock of the MPS2 boards. */
#define CMSDK_UART_CLOCK_HZ 25000000u

/** Registers, as in the Cortex-M system design kit's reference manual. */
typedef struct {
    volatile uint32_t data;
    volatile uint32_t state;
    volatile uint32_t ctrl;
    volatile uint32_t intstatus;
    volatile uint32_t bauddiv;
} cmsdk_uart_registers;

/** Two of the boards' UARTs. */
#define CMSDK_UART0 ((cmsdk_uart_registers *)0x40004000u)
#define CMSDK_UART1 ((cmsdk_uart_registers *)0x40005000u)

typedef struct {
    cmsdk_uart_registers *registers;
    uint32_t octets_per_s; /**< each way, from what the divider makes of the baud rate */
    float credit_in;       /**< bytes that may pass now */
    float credit_out;
} cmsdk_uart;

/** 8 data bits, no parity, no interrupts. False, and nothing done, for a rate that the
 *  divider does not reach. */
bool cmsdk_uart_start(cmsdk_uart *u, cmsdk_uart_registers *registers, uint32_t baud);

/** That many seconds have passed. The unused time of a quiet line does not accumulate. */
void cmsdk_uart_pass(cmsdk_uart *u, float seconds);

/** The link's view of it; valid as long as `u`. */
ht_line cmsdk_uart_line(cmsdk_uart *u);

#endif
