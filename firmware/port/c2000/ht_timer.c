/* CPU timers, the same on both devices. Timer 0: interrupt 1.7, or a look at its flag. */
#include "ht_drivers.h"

#define TIM 0x00u /* 32 bits, counts down */
#define TPR 0x06u
#define TPRH 0x07u
#define TCR_STOP 0x0010u
#define TCR_RELOAD 0x0020u
#define TCR_INTERRUPT 0x4000u
#define TCR_FLAG 0x8000u /* writing 1 clears it */

void ht_timer_start(ht_port *port, float slow_Hz)
{
    uint32_t counts = (uint32_t)(port->map->system_clock_Hz / slow_Hz + 0.5f);
    ht_counter_prepare(port, HT_TIMER0, counts - 1u);
    HT_WR16(port->io, HT_TIMER0 + HT_TCR, TCR_INTERRUPT);
}

void ht_counter_prepare(ht_port *port, uint32_t timer, uint32_t from)
{
    HT_WR16(port->io, timer + HT_TCR, TCR_STOP);
    HT_WR16(port->io, timer + TPR, 0u);
    HT_WR16(port->io, timer + TPRH, 0u);
    HT_WR32(port->io, timer + HT_TIMER_PRD, from);
    HT_WR16(port->io, timer + HT_TCR, TCR_STOP | TCR_RELOAD | TCR_FLAG);
}

void ht_counter_run(ht_port *port, uint32_t timer)
{
    HT_WR16(port->io, timer + HT_TCR, 0u);
}

bool ht_counter_passed(const ht_port *port, uint32_t timer)
{
    return (HT_RD16(port->io, timer + HT_TCR) & TCR_FLAG) != 0u;
}

uint32_t ht_counter_stop(ht_port *port, uint32_t timer)
{
    HT_WR16(port->io, timer + HT_TCR, TCR_STOP);
    return HT_RD32(port->io, timer + HT_TIMER_PRD) - HT_RD32(port->io, timer + TIM);
}
