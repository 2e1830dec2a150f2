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

#define PLLSTS_PLLLOCKS 0x0001u
#define PLLSTS_MCLKSTS 0x0008u
#define PLLSTS_MCLKOFF 0x0040u
#define PLLSTS_DIVSEL 0x0180u
#define PLLSTS_DIVSEL_2 0x0100u
#define HISPCP_6 0x0003u /* 25 MHz for the ADC */
#define LOSPCP_2 0x0001u /* 75 MHz, the most that the SCI may have */
#define PCLKCR0_TBCLKSYNC 0x0004u
#define PCLKCR0_ADC 0x0008u
#define PCLKCR0_SCIA 0x0400u
#define PCLKCR1_EQEP1 0x4000u
#define PCLKCR3_CPUTIMER0 0x0100u
#define PCLKCR3_GPIOIN 0x2000u
/* A lock takes 131072 crystal periods, 4.4 ms; a look takes a few CPU cycles. */
#define LOOKS 60000u

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

bool ht_clock_start_f28335(ht_port *port)
{
    bool locked;
    if ((HT_RD16(port->io, PLLSTS) & PLLSTS_MCLKSTS) != 0u) {
        return false; /* the crystal does not swing: this is the emergency clock */
    }
    HT_EALLOW(port->io);
    ht_change16(port->io, PLLSTS, PLLSTS_DIVSEL, 0u); /* before PLLCR may change */
    ht_change16(port->io, PLLSTS, 0u, PLLSTS_MCLKOFF); /* nor may anyone miss a clock meanwhile */
    HT_WR16(port->io, PLLCR, port->board->pll_multiplier);
    locked = lock(port);
    ht_change16(port->io, PLLSTS, PLLSTS_MCLKOFF, 0u);
    if (locked) {
        ht_change16(port->io, PLLSTS, PLLSTS_DIVSEL, PLLSTS_DIVSEL_2);
        HT_WR16(port->io, HISPCP, HISPCP_6);
        HT_WR16(port->io, LOSPCP, LOSPCP_2);
        ht_change16(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, PCLKCR0_ADC | PCLKCR0_SCIA);
        ht_change16(port->io, PCLKCR1, 0u, (uint16_t)(PCLKCR1_EQEP1 | port->board->modules));
        ht_change16(port->io, PCLKCR3, 0u, PCLKCR3_CPUTIMER0 | PCLKCR3_GPIOIN);
    }
    HT_EDIS(port->io);
    HT_SETTLE(port->io);
    return locked;
}

void ht_clock_pwm_f28335(ht_port *port, bool run)
{
    HT_EALLOW(port->io);
    ht_change16(port->io, PCLKCR0, PCLKCR0_TBCLKSYNC, run ? PCLKCR0_TBCLKSYNC : 0u);
    HT_EDIS(port->io);
}
