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
#define MCDCR 0x5D22Eu
#define PCLKCR0 0x5D322u
#define PCLKCR2 0x5D326u
#define PCLKCR3 0x5D328u
#define PCLKCR4 0x5D32Au
#define PCLKCR7 0x5D330u
#define PCLKCR13 0x5D33Cu
#define PCLKCR14 0x5D33Eu
#define TMR2CLKCTL 0x5D37Cu

#define OSCCLKSRCSEL 0x00000003u
#define OSCCLKSRCSEL_XTAL 0x00000001u
#define INTOSC2OFF 0x00000008u
#define XTALOFF 0x00000010u
#define PLLEN 0x00000001u
#define PLLCLKEN 0x00000002u
#define PLL_LOCKS 0x00000001u
#define PLL_SLIPS 0x00000002u
#define PLLSYSCLKDIV 0x0000003Fu
#define EPWMCLKDIV 0x00000003u
#define EPWMCLKDIV_2 0x00000001u /* ePWM: 100 MHz at most */
#define LSPCLKDIV_1 0x00000000u
#define LSPCLKDIV_4 0x00000002u /* 50 MHz: 1.25 Mbaud is exact */
#define MCLKSTS 0x00000001u
#define MCLKCLR 0x00000002u
#define PCLKCR0_CPUTIMERS 0x00000038u
#define PCLKCR0_TBCLKSYNC 0x00040000u
#define PCLKCR3_ECAP1 0x00000001u
#define PCLKCR4_EQEP1 0x00000001u /* the next modules' follow */
#define PCLKCR7_SCIA 0x00000001u
#define PCLKCR13_ADCA_B 0x00000003u
#define PCLKCR14_CMPSS1_TO_4 0x0000000Fu
/* The first lock after power-up may fail unnoticed; TI asks for five. */
#define LOCKS 5u
#define LOOKS 60000u
/* The PLL is started again when what comes out of it is not what was asked for. */
#define TRIES 5u
/* A missing clock shows after 8192 periods of the internal oscillator. */
#define MISSING_SHOWS_US 1000u

/* The measurement: CPU timer 2 counts a known clock, CPU timer 1 counts SYSCLK meanwhile. */
#define TMR2CLK 0x0000003Fu /* source and prescaler */
#define TMR2CLK_SYSCLK 0u
#define TMR2CLK_INTOSC1 1u
#define TMR2CLK_XTAL 3u
#define PERIODS 2000u /* of the known clock: 0.1 to 0.2 ms */
#define DIVIDER 4u    /* PLL to SYSCLK during the measurement */
#define INTOSC_HZ 10.0e6f
/* Against the crystal: only what starting and stopping takes. Against the internal
 * oscillator, 3 % exact: a crystal of another frequency than the board's table says. */
#define SHARE_XTAL 0.02f
#define SHARE_INTOSC 0.06f

static bool missing(const ht_port *port)
{
    return (HT_RD32(port->io, MCDCR) & MCLKSTS) != 0u;
}

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

/* Is SYSCLK `ratio` times this clock, within `share`? Not either if that clock stands still. */
static bool sysclk_is(ht_port *port, uint32_t source, float ratio, float share)
{
    float wanted = ratio * (float)PERIODS;
    float found;
    uint16_t looks = 0u;
    ht_counter_prepare(port, HT_TIMER1, 0xFFFFFFFFu);
    ht_counter_prepare(port, HT_TIMER2, PERIODS - 1u);
    ht_change32(port->io, TMR2CLKCTL, TMR2CLK, source);
    ht_counter_run(port, HT_TIMER2);
    ht_counter_run(port, HT_TIMER1);
    while (!ht_counter_passed(port, HT_TIMER2) && (looks < LOOKS)) {
        looks++;
    }
    found = (float)ht_counter_stop(port, HT_TIMER1);
    (void)ht_counter_stop(port, HT_TIMER2);
    ht_change32(port->io, TMR2CLKCTL, TMR2CLK, TMR2CLK_SYSCLK);
    return (looks < LOOKS) && (found > wanted * (1.0f - share))
           && (found < wanted * (1.0f + share));
}

static bool frequency_is_right(ht_port *port)
{
    float to_xtal = (float)port->board->pll_multiplier / (float)DIVIDER;
    float to_intosc = 2.0f * port->map->system_clock_Hz / ((float)DIVIDER * INTOSC_HZ);
    return sysclk_is(port, TMR2CLK_XTAL, to_xtal, SHARE_XTAL)
           && sysclk_is(port, TMR2CLK_INTOSC1, to_intosc, SHARE_INTOSC);
}

static void bypass_pll(ht_port *port)
{
    ht_change32(port->io, SYSPLLCTL1, PLLCLKEN, 0u);
    HT_WAIT_US(port->io, 12u); /* 120 crystal periods from PLL to crystal */
    ht_change32(port->io, SYSCLKDIVSEL, PLLSYSCLKDIV, 0u);
}

static ht_clock start_pll(ht_port *port)
{
    uint16_t n;
    bypass_pll(port);
    for (n = 0u; n < LOCKS; n++) {
        if (!lock(port)) {
            return HT_CLOCK_NO_LOCK;
        }
    }
    /* By way of a quarter: half the step in supply current, and a wrong lock is measured
     * at a frequency that the CPU stands. */
    ht_change32(port->io, SYSCLKDIVSEL, PLLSYSCLKDIV, DIVIDER / 2u);
    ht_change32(port->io, SYSPLLCTL1, 0u, PLLCLKEN);
    HT_WAIT_US(port->io, 2u);
    if (((HT_RD32(port->io, SYSPLLSTS) & PLL_SLIPS) != 0u) || !frequency_is_right(port)) {
        return HT_CLOCK_WRONG;
    }
    ht_change32(port->io, SYSCLKDIVSEL, PLLSYSCLKDIV, 1u);
    return HT_CLOCK_RIGHT;
}

static ht_clock start_crystal(ht_port *port)
{
    ht_clock clock = HT_CLOCK_MISSING;
    uint16_t n;
    HT_WR32(port->io, MCDCR, MCLKCLR); /* of a run before */
    bypass_pll(port);                  /* before its clock changes */
    ht_change32(port->io, CLKSRCCTL1, XTALOFF, 0u);
    HT_WAIT_US(port->io, 2u); /* 300 cycles between two writes of CLKSRCCTL1 */
    ht_change32(port->io, CLKSRCCTL1, OSCCLKSRCSEL, OSCCLKSRCSEL_XTAL);
    HT_WAIT_US(port->io, MISSING_SHOWS_US);
    for (n = 0u; (n < TRIES) && (clock != HT_CLOCK_RIGHT); n++) {
        clock = missing(port) ? HT_CLOCK_MISSING : start_pll(port);
    }
    return missing(port) ? HT_CLOCK_MISSING : clock;
}

/* Internal oscillator 2, no PLL: 10 MHz within 3 %. */
static void fall_back(ht_port *port)
{
    bypass_pll(port);
    ht_change32(port->io, CLKSRCCTL1, INTOSC2OFF, 0u);
    HT_WAIT_US(port->io, 2u);
    ht_change32(port->io, CLKSRCCTL1, OSCCLKSRCSEL, 0u);
    HT_WAIT_US(port->io, 2u);
    HT_WR32(port->io, MCDCR, MCLKCLR);
    ht_change32(port->io, SYSPLLCTL1, PLLEN, 0u);
    HT_WR32(port->io, LOSPCP, LSPCLKDIV_1);
    port->sci_clock_Hz = (uint32_t)INTOSC_HZ;
}

ht_clock ht_clock_start_f28377s(ht_port *port)
{
    ht_clock clock;
    HT_EALLOW(port->io);
    ht_change32(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, PCLKCR0_CPUTIMERS);
    ht_change32(port->io, PCLKCR13, 0u, PCLKCR13_ADCA_B); /* Device_cal trims the ADCs as well */
    HT_SETTLE(port->io);
    /* The boot ROM's work, which a debugger's start passes by. Before anything is measured: without
     * it the internal oscillators are out of their specification. It may end with EDIS. */
    HT_DEVICE_CAL(port->io);
    HT_EALLOW(port->io);
    clock = start_crystal(port);
    if (clock == HT_CLOCK_RIGHT) {
        HT_WR32(port->io, LOSPCP, LSPCLKDIV_4);
    } else {
        fall_back(port);
    }
    ht_change32(port->io, PERCLKDIVSEL, EPWMCLKDIV, EPWMCLKDIV_2);
    ht_change32(port->io, PCLKCR2, 0u, port->board->modules);
    ht_change32(port->io, PCLKCR3, 0u, PCLKCR3_ECAP1);
    ht_change32(port->io, PCLKCR4, 0u, (uint32_t)PCLKCR4_EQEP1 << port->board->eqep);
    ht_change32(port->io, PCLKCR7, 0u, PCLKCR7_SCIA);
    ht_change32(port->io, PCLKCR14, 0u, PCLKCR14_CMPSS1_TO_4);
    HT_EDIS(port->io);
    HT_SETTLE(port->io);
    return clock;
}

void ht_clock_pwm_f28377s(ht_port *port, bool run)
{
    HT_EALLOW(port->io);
    ht_change32(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, run ? PCLKCR0_TBCLKSYNC : 0u);
    HT_EDIS(port->io);
}
