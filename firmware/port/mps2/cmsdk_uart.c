#include "cmsdk_uart.h"

#define STATE_TX_FULL 0x1u
#define STATE_RX_FULL 0x2u
#define STATE_RX_OVERRUN 0x8u /* written 1: cleared */
#define CTRL_TX 0x1u
#define CTRL_RX 0x2u
#define DIVIDER_MIN 16u
#define DIVIDER_MAX 0xFFFFFu
#define BITS 10u /* of a byte on the line: start, 8, stop */
#define OCTET 0xFFu

bool cmsdk_uart_start(cmsdk_uart *u, cmsdk_uart_registers *registers, uint32_t baud)
{
    uint32_t divider = (baud != 0u) ? ((CMSDK_UART_CLOCK_HZ + (baud / 2u)) / baud) : 0u;
    if ((divider < DIVIDER_MIN) || (divider > DIVIDER_MAX)) {
        return false;
    }
    registers->ctrl = 0u;
    registers->bauddiv = divider;
    registers->state = STATE_RX_OVERRUN;
    registers->ctrl = CTRL_TX | CTRL_RX;
    (void)registers->data; /* of before; and QEMU looks at the line again only after a read */
    u->registers = registers;
    u->octets_per_s = CMSDK_UART_CLOCK_HZ / (divider * BITS);
    u->credit_in = 0.0f;
    u->credit_out = 0.0f;
    return true;
}

static float more(float credit, float octets)
{
    return ((credit < 1.0f) ? credit : 1.0f) + octets;
}

void cmsdk_uart_pass(cmsdk_uart *u, float seconds)
{
    float octets = (float)u->octets_per_s * seconds;
    u->credit_in = more(u->credit_in, octets);
    u->credit_out = more(u->credit_out, octets);
}

static uint16_t line_read(void *at, uint16_t *octets, uint16_t n, bool *lost)
{
    cmsdk_uart *u = (cmsdk_uart *)at;
    uint16_t count = 0u;
    uint32_t state = u->registers->state;
    while (((state & STATE_RX_FULL) != 0u) && (count < n) && (u->credit_in >= 1.0f)) {
        octets[count] = (uint16_t)(u->registers->data & OCTET);
        count++;
        u->credit_in -= 1.0f;
        state = u->registers->state;
    }
    *lost = (state & STATE_RX_OVERRUN) != 0u;
    if (*lost) {
        u->registers->state = STATE_RX_OVERRUN;
    }
    return count;
}

static uint16_t line_write(void *at, const uint16_t *octets, uint16_t n)
{
    cmsdk_uart *u = (cmsdk_uart *)at;
    uint16_t count = 0u;
    while ((count < n) && (u->credit_out >= 1.0f)
           && ((u->registers->state & STATE_TX_FULL) == 0u)) {
        u->registers->data = octets[count] & OCTET;
        count++;
        u->credit_out -= 1.0f;
    }
    return count;
}

ht_line cmsdk_uart_line(cmsdk_uart *u)
{
    ht_line line;
    line.read = line_read;
    line.write = line_write;
    line.at = u;
    line.octets_per_s = u->octets_per_s;
    return line;
}
