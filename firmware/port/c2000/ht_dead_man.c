#include "ht_dead_man.h"

#define PERIODS 2.5f
/* eCAP: words from its first register. In the mode APWM CAP1 is the period, CAP2 the compare value,
 * and the output is high from the end of the period until the compare value. */
#define CAP1 0x04u /* 32 bits */
#define CAP2 0x06u /* 32 bits */
#define ECCTL1 0x14u
#define ECCTL2 0x15u
#define ECFLG 0x17u
#define ECCLR 0x18u
#define ECCTL1_FREE_RUN 0x8000u
#define ECCTL2_TSCTR_RUNS 0x0010u
#define ECCTL2_SYNCO_OFF 0x0080u
#define ECCTL2_APWM 0x0200u
#define CTR_PRD 0x0040u
/* ePWM X-BAR: what TRIP4 listens to */
#define TRIP4MUX0TO15CFG 0x7A00u /* 32 bits */
#define TRIP4MUXENABLE 0x7A20u   /* 32 bits */
#define MUX0_ECAP1OUT 0x00000003u
#define MUX0 0x00000001u
/* Digital compare of an ePWM module */
#define DCACTL 0xC3u
#define DCTRIPSEL_DCAH_TRIP4 0x0003u
#define DCAEVT1_DCAH_HIGH 0x0002u
#define DCACTL_EVT1_ASYNC 0x0002u
/* CPU timer 1 */
#define TCR_RUN 0x4000u    /* TIE */
#define TCR_FORGET 0xC020u /* TIF, TIE, TRB */

static void start_ecap(ht_port *port, uint32_t clocks)
{
    uint32_t ecap = port->map->ecap;
    ht_io *io = port->io;
    uint16_t leg;
    HT_WR16(io, ecap + ECCTL2, 0u); /* stops, and is no generator: its output goes back */
    HT_WR16(io, ecap + ECCTL1, ECCTL1_FREE_RUN);
    HT_WR16(io, ecap + ECCTL2, ECCTL2_APWM | ECCTL2_SYNCO_OFF);
    HT_WR32(io, ecap + CAP1, clocks);
    HT_WR32(io, ecap + CAP2, HT_DEAD_MAN_PULSE);
    HT_WR32(io, ecap + HT_TSCTR, HT_DEAD_MAN_PULSE);
    HT_WR16(io, ecap + ECCTL2, ECCTL2_APWM | ECCTL2_SYNCO_OFF | ECCTL2_TSCTR_RUNS);
    HT_EALLOW(io);
    HT_WR32(io, TRIP4MUX0TO15CFG, MUX0_ECAP1OUT);
    HT_WR32(io, TRIP4MUXENABLE, MUX0);
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        uint32_t base = port->leg[leg];
        HT_WR16(io, base + HT_DCTRIPSEL, DCTRIPSEL_DCAH_TRIP4);
        HT_WR16(io, base + HT_TZDCSEL, DCAEVT1_DCAH_HIGH);
        HT_WR16(io, base + DCACTL, DCACTL_EVT1_ASYNC);
    }
    HT_EDIS(io);
}

static void start_timer(ht_port *port, uint32_t clocks)
{
    ht_counter_prepare(port, HT_TIMER1, clocks);
    HT_WR16(port->io, HT_TIMER1 + HT_TCR, TCR_RUN);
}

void ht_dead_man_start(ht_port *port, uint16_t period_counts)
{
    const ht_c2000_map *m = port->map;
    uint32_t clocks =
        (uint32_t)(PERIODS * (float)period_counts * m->system_clock_Hz / m->pwm_clock_Hz);
    if (m->ecap != 0u) {
        start_ecap(port, clocks);
    } else {
        start_timer(port, clocks);
    }
    ht_dead_man_forget(port);
}

void ht_dead_man_forget(ht_port *port)
{
    if (port->map->ecap != 0u) {
        HT_WR16(port->io, port->map->ecap + ECCLR, CTR_PRD);
    } else {
        HT_WR16(port->io, HT_TIMER1 + HT_TCR, TCR_FORGET);
    }
}

bool ht_port_interrupt_lost(const ht_port *port)
{
    return (port->map->ecap != 0u) ? ((HT_RD16(port->io, port->map->ecap + ECFLG) & CTR_PRD) != 0u)
                                   : ht_counter_passed(port, HT_TIMER1);
}
