/* Clocks of the F28335: 30 MHz x 10 / 2 = 150 MHz. */
#include "ht_change.h"
#include "ht_drivers.h"

#define PLLSTS 0x7011u
#define HISPCP 0x701Au
#define LOSPCP 0x701Bu
#define PCLKCR0 0x701Cu
#define PCLKCR1 0x701Du
#define PCLKCR3 0x7020u
#define PLLCR 0x7021u
#define WDCNTR 0x7023u

#define PLLSTS_PLLLOCKS 0x0001u
#define PLLSTS_MCLKSTS 0x0008u
#define PLLSTS_MCLKOFF 0x0040u
#define PLLSTS_DIVSEL 0x0180u
#define PLLSTS_DIVSEL_2 0x0100u
#define HISPCP_6 0x0003u /* 25 MHz for the ADC */
#define LOSPCP_1 0x0000u
#define LOSPCP_2 0x0001u /* 75 MHz, the most that the SCI may have */
#define PCLKCR0_TBCLKSYNC 0x0004u
#define PCLKCR0_ADC 0x0008u
#define PCLKCR0_SCIA 0x0400u
#define PCLKCR1_EQEP1 0x4000u /* the next modules' follow */
#define PCLKCR3_CPUTIMERS_0_1 0x0300u
#define PCLKCR3_GPIOIN 0x2000u
/* A lock takes 131072 crystal periods, 4.4 ms; a look takes a few CPU cycles. */
#define LOOKS 60000u
#define TRIES 3u

/* The measurement: the watchdog's counter runs on the crystal, CPU timer 1 on SYSCLKOUT. */
#define STEP_PERIODS 32768.0f /* of the crystal: 512, prescaler 64 (ht_watchdog_hold) */
#define DIVIDER 4.0f          /* PLL to SYSCLKOUT during the measurement */
#define SHARE 0.02f
#define CRYSTAL_HZ 30000000u

static bool lock(const ht_port *port)
{
    uint16_t looks = 0u;
    while ((HT_RD16(port->io, PLLSTS) & PLLSTS_PLLLOCKS) == 0u) {
        looks++;
        if (looks >= LOOKS) {
            return false;
        }
    }
    return true;
}

/* Wait for the watchdog's counter to move on. */
static bool step(const ht_port *port)
{
    uint16_t looks = 0u;
    uint16_t first = HT_RD16(port->io, WDCNTR);
    while (HT_RD16(port->io, WDCNTR) == first) {
        looks++;
        if (looks >= LOOKS) {
            return false;
        }
    }
    return true;
}

static bool frequency_is_right(ht_port *port)
{
    float wanted = STEP_PERIODS * (float)port->board->pll_multiplier / DIVIDER;
    float found;
    bool counts;
    ht_counter_prepare(port, HT_TIMER1, 0xFFFFFFFFu);
    counts = step(port);
    ht_counter_run(port, HT_TIMER1);
    counts = step(port) && counts;
    found = (float)ht_counter_stop(port, HT_TIMER1);
    return counts && (found > wanted * (1.0f - SHARE)) && (found < wanted * (1.0f + SHARE));
}

static bool set_pll(ht_port *port, uint16_t multiplier)
{
    bool locked;
    ht_change16(port->io, PLLSTS, PLLSTS_DIVSEL, 0u);  /* before PLLCR may change */
    ht_change16(port->io, PLLSTS, 0u, PLLSTS_MCLKOFF); /* nor may anyone miss a clock meanwhile */
    HT_WR16(port->io, PLLCR, multiplier);
    locked = lock(port);
    ht_change16(port->io, PLLSTS, PLLSTS_MCLKOFF, 0u);
    return locked;
}

static bool missing(const ht_port *port)
{
    /* The crystal does not swing: this is the PLL's emergency clock, of a few MHz. */
    return (HT_RD16(port->io, PLLSTS) & PLLSTS_MCLKSTS) != 0u;
}

static ht_clock start_pll(ht_port *port)
{
    ht_clock clock = HT_CLOCK_MISSING;
    uint16_t n;
    for (n = 0u; (n < TRIES) && (clock != HT_CLOCK_RIGHT) && !missing(port); n++) {
        if (n != 0u) {
            (void)set_pll(port, 0u); /* only a changed PLLCR makes it lock again */
        }
        if (!set_pll(port, port->board->pll_multiplier)) {
            clock = HT_CLOCK_NO_LOCK;
        } else {
            clock = frequency_is_right(port) ? HT_CLOCK_RIGHT : HT_CLOCK_WRONG;
        }
    }
    return missing(port) ? HT_CLOCK_MISSING : clock;
}

/* Crystal / 4, no PLL: there is no internal oscillator. Without crystal the few MHz that are
 * left are not known, and the serial line has no rate to go by. */
static void fall_back(ht_port *port, ht_clock clock)
{
    if (clock != HT_CLOCK_MISSING) {
        (void)set_pll(port, 0u);
    }
    HT_WR16(port->io, LOSPCP, LOSPCP_1);
    port->sci_clock_Hz = CRYSTAL_HZ / 4u;
}

ht_clock ht_clock_start_f28335(ht_port *port)
{
    ht_clock clock;
    HT_EALLOW(port->io);
    ht_change16(port->io, PCLKCR3, 0u, PCLKCR3_CPUTIMERS_0_1 | PCLKCR3_GPIOIN);
    HT_SETTLE(port->io);
    clock = start_pll(port);
    if (clock == HT_CLOCK_RIGHT) {
        ht_change16(port->io, PLLSTS, PLLSTS_DIVSEL, PLLSTS_DIVSEL_2);
        HT_WR16(port->io, LOSPCP, LOSPCP_2);
    } else {
        fall_back(port, clock);
    }
    HT_WR16(port->io, HISPCP, HISPCP_6);
    ht_change16(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, PCLKCR0_ADC | PCLKCR0_SCIA);
    ht_change16(port->io, PCLKCR1, 0u,
                (uint16_t)((PCLKCR1_EQEP1 << port->board->eqep) | port->board->modules));
    HT_EDIS(port->io);
    HT_SETTLE(port->io);
    return clock;
}

void ht_clock_pwm_f28335(ht_port *port, bool run)
{
    HT_EALLOW(port->io);
    ht_change16(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, run ? PCLKCR0_TBCLKSYNC : 0u);
    HT_EDIS(port->io);
}
