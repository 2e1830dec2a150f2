/* CPU timer 0, the same on both devices. Interrupt 1.7, or a look at its flag. */
#include "ht_drivers.h"

#define PRD 0x0C02u /* 32 bits */
#define TCR 0x0C04u
#define TPR 0x0C06u
#define TPRH 0x0C07u
#define TCR_STOP 0x0010u
#define TCR_RELOAD 0x0020u
#define TCR_INTERRUPT 0x4000u
#define TCR_FLAG 0x8000u /* writing 1 clears it */

void ht_timer_start(ht_port *port, float slow_Hz)
{
    uint32_t counts = (uint32_t)(port->map->system_clock_Hz / slow_Hz + 0.5f);
    HT_WR16(port->io, TCR, TCR_STOP);
    HT_WR16(port->io, TPR, 0u);
    HT_WR16(port->io, TPRH, 0u);
    HT_WR32(port->io, PRD, counts - 1u);
    HT_WR16(port->io, TCR, TCR_STOP | TCR_RELOAD | TCR_FLAG);
    HT_WR16(port->io, TCR, TCR_INTERRUPT);
}

bool ht_timer_passed(ht_port *port)
{
    bool passed = (HT_RD16(port->io, TCR) & TCR_FLAG) != 0u;
    if (passed) {
        HT_WR16(port->io, TCR, TCR_INTERRUPT | TCR_FLAG);
    }
    return passed;
}
