/* The driver of the MPS2 boards' serial port, on registers that are plain memory. It tests what
 * never occurs in the emulator (a lost octet, a transmitter that stays full), and the line's rate.
 * */
#include <stdio.h>

#include "checks.h"
#include "cmsdk_uart.h"

/* Bits of STATE. */
#define TX_FULL 1u
#define RX_FULL 2u
#define RX_OVERRUN 8u

static const uint16_t octets[64] = {0x101u, 2u, 3u}; /* a cell may hold more than an octet */

static void test_start(void)
{
    cmsdk_uart_registers r = {0u, 0u, 0u, 0u, 0u};
    cmsdk_uart u;
    CHECK(!cmsdk_uart_start(&u, &r, 0u));
    CHECK(!cmsdk_uart_start(&u, &r, 2000000u));
    CHECK(!cmsdk_uart_start(&u, &r, 23u));
    CHECK(r.bauddiv == 0u && r.ctrl == 0u);
    CHECK(cmsdk_uart_start(&u, &r, 1562500u) && r.bauddiv == 16u);
    CHECK(cmsdk_uart_start(&u, &r, 24u) && r.bauddiv == 1041667u);
    CHECK(cmsdk_uart_start(&u, &r, 115200u) && r.bauddiv == 217u && u.octets_per_s == 11520u);
    CHECK(r.ctrl == 3u); /* both directions, no interrupts */
}

/* 1.25 Mbaud: an octet takes 8 us. */
static void test_rate(void)
{
    cmsdk_uart_registers r = {0x41u, 0u, 0u, 0u, 0u};
    cmsdk_uart u;
    ht_line line;
    uint16_t got[64];
    bool lost;
    int k;
    CHECK(cmsdk_uart_start(&u, &r, 1250000u));
    line = cmsdk_uart_line(&u);
    CHECK(line.octets_per_s == 125000u);
    r.state = RX_FULL; /* never empty */
    CHECK(line.write(line.at, octets, 64u) == 0u);
    CHECK(line.read(line.at, got, 64u, &lost) == 0u && !lost);
    cmsdk_uart_pass(&u, 81.0e-6f);
    CHECK(line.write(line.at, octets, 3u) == 3u && r.data == 3u);
    CHECK(line.write(line.at, octets, 1u) == 1u && r.data == 1u);
    CHECK(line.write(line.at, octets, 64u) == 6u);
    CHECK(line.write(line.at, octets, 64u) == 0u);
    r.data = 0x141u;
    CHECK(line.read(line.at, got, 4u, &lost) == 4u && got[3] == 0x41u);
    CHECK(line.read(line.at, got, 64u, &lost) == 6u);
    for (k = 0; k < 1000; k++) {
        cmsdk_uart_pass(&u, 81.0e-6f); /* nobody uses it */
    }
    CHECK(line.write(line.at, octets, 64u) == 11u);
    CHECK(line.read(line.at, got, 64u, &lost) == 11u);
}

static void test_full_and_lost(void)
{
    cmsdk_uart_registers r = {0u, 0u, 0u, 0u, 0u};
    cmsdk_uart u;
    ht_line line;
    uint16_t got[64];
    bool lost = false;
    CHECK(cmsdk_uart_start(&u, &r, 1250000u));
    line = cmsdk_uart_line(&u);
    cmsdk_uart_pass(&u, 81.0e-6f);
    r.state = TX_FULL;
    CHECK(line.write(line.at, octets, 64u) == 0u);
    r.state = 0u;
    CHECK(line.write(line.at, octets, 64u) == 10u); /* waiting has not used up anything */
    r.state = TX_FULL | RX_OVERRUN;
    CHECK(line.read(line.at, got, 64u, &lost) == 0u && lost);
    CHECK(r.state == RX_OVERRUN); /* written 1 to clear it, and nothing else */
    r.state = 0u;
    CHECK(line.read(line.at, got, 64u, &lost) == 0u && !lost);
}

int main(void)
{
    test_start();
    test_rate();
    test_full_and_lost();
    return (failures != 0) ? 1 : 0;
}
