/* Clocks of the F28377S: crystal x multiplier = 400 MHz, / 2 = 200 MHz. All these
 * registers have 32 bits. */
#include "ht_change.h"
#include "ht_drivers.h"

#define CLKSRCCTL1 0x5D208u
#define SYSPLLCTL1 0x5D20Eu
#define SYSPLLMULT 0x5D214u
#define SYSPLLSTS 0x5D216u
#define SYSCLKDIVSEL 0x5D222u
#define PERCLKDIVSEL 0x5D226u
#define LOSPCP 0x5D22Cu
#define PCLKCR0 0x5D322u
#define PCLKCR2 0x5D326u
#define PCLKCR4 0x5D32Au
#define PCLKCR7 0x5D330u
#define PCLKCR13 0x5D33Cu

#define OSCCLKSRCSEL 0x00000003u
#define OSCCLKSRCSEL_XTAL 0x00000001u
#define XTALOFF 0x00000010u
#define PLLEN 0x00000001u
#define PLLCLKEN 0x00000002u
#define PLL_LOCKS 0x00000001u
#define PLL_SLIPS 0x00000002u
#define PLLSYSCLKDIV 0x0000003Fu
#define EPWMCLKDIV 0x00000003u
#define EPWMCLKDIV_2 0x00000001u /* ePWM: 100 MHz at most */
#define LSPCLKDIV_4 0x00000002u  /* 50 MHz: 1.25 Mbaud is exact */
#define PCLKCR0_CPUTIMER0 0x00000008u
#define PCLKCR0_TBCLKSYNC 0x00040000u
#define PCLKCR4_EQEP1 0x00000001u
#define PCLKCR7_SCIA 0x00000001u
#define PCLKCR13_ADCA 0x00000001u
/* The first lock after power-up may fail unnoticed; TI asks for five. */
#define LOCKS 5u
#define LOOKS 60000u

static bool lock(ht_port *port)
{
    uint16_t looks = 0u;
    ht_change32(port->io, SYSPLLCTL1, PLLEN, 0u);
    HT_WAIT_US(port->io, 1u);
    HT_WR32(port->io, SYSPLLMULT, port->board->pll_multiplier); /* starts the PLL as well */
    while ((HT_RD32(port->io, SYSPLLSTS) & PLL_LOCKS) == 0u) {
        looks++;
        if (looks >= LOOKS) {
            return false;
        }
    }
    return true;
}

static bool start_pll(ht_port *port)
{
    uint16_t n;
    ht_change32(port->io, CLKSRCCTL1, XTALOFF, 0u);
    HT_WAIT_US(port->io, 2u); /* 300 cycles between two writes of CLKSRCCTL1 */
    ht_change32(port->io, CLKSRCCTL1, OSCCLKSRCSEL, OSCCLKSRCSEL_XTAL);
    HT_WAIT_US(port->io, 2u);
    ht_change32(port->io, SYSPLLCTL1, PLLCLKEN, 0u);
    HT_WAIT_US(port->io, 12u); /* 120 crystal periods from PLL to crystal */
    ht_change32(port->io, SYSCLKDIVSEL, PLLSYSCLKDIV, 0u);
    for (n = 0u; n < LOCKS; n++) {
        if (!lock(port)) {
            return false;
        }
    }
    /* By way of a quarter: half the step in supply current. */
    ht_change32(port->io, SYSCLKDIVSEL, PLLSYSCLKDIV, 2u);
    ht_change32(port->io, SYSPLLCTL1, 0u, PLLCLKEN);
    HT_WAIT_US(port->io, 2u);
    ht_change32(port->io, SYSCLKDIVSEL, PLLSYSCLKDIV, 1u);
    return (HT_RD32(port->io, SYSPLLSTS) & PLL_SLIPS) == 0u;
}

bool ht_clock_start_f28377s(ht_port *port)
{
    bool locked;
    HT_EALLOW(port->io);
    locked = start_pll(port);
    if (locked) {
        ht_change32(port->io, PERCLKDIVSEL, EPWMCLKDIV, EPWMCLKDIV_2);
        HT_WR32(port->io, LOSPCP, LSPCLKDIV_4);
        ht_change32(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, PCLKCR0_CPUTIMER0);
        ht_change32(port->io, PCLKCR2, 0u, port->board->modules);
        ht_change32(port->io, PCLKCR4, 0u, PCLKCR4_EQEP1);
        ht_change32(port->io, PCLKCR7, 0u, PCLKCR7_SCIA);
        ht_change32(port->io, PCLKCR13, 0u, PCLKCR13_ADCA);
    }
    HT_EDIS(port->io);
    HT_SETTLE(port->io);
    return locked;
}

void ht_clock_pwm_f28377s(ht_port *port, bool run)
{
    HT_EALLOW(port->io);
    ht_change32(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, run ? PCLKCR0_TBCLKSYNC : 0u);
    HT_EDIS(port->io);
}
