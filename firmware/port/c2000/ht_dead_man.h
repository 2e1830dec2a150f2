/** @file ht_dead_man.h
 *  The dead-man timer of the fast interrupt. Each fast interrupt winds it. If none comes for 2.5
 *  periods, it trips all legs, whatever the frequency of the slow interrupt.
 *
 *  F28377S: eCAP1 counts as a PWM generator, and no code takes part in the trip. The end of its
 *  period makes a pulse, which goes through the ePWM X-BAR (TRIP4) to the digital compare (DCAEVT1)
 *  of each leg. F28335: CPU timer 1 raises INT13, whose routine trips; a processor that hangs with its
 *  interrupts masked is left to the watchdog.
 */
#ifndef HT_DEAD_MAN_H
#define HT_DEAD_MAN_H

#include "ht_drivers.h"

/** eCAP1's counter, and the length of its pulse, system clocks. The counter never goes back into
 *  the pulse, which would trip. */
#define HT_TSCTR 0x00u /* 32 bits */
#define HT_DEAD_MAN_PULSE 100u

/** With the legs tripped and the counters stopped. */
void ht_dead_man_start(ht_port *port, uint16_t period_counts);
/** Forget that it has expired. */
void ht_dead_man_forget(ht_port *port);

/** In each fast interrupt. */
static inline void ht_dead_man_wind(ht_port *port)
{
    uint32_t ecap = port->map->ecap;
    if (ecap == 0u) {
        HT_WR16(port->io, HT_TIMER1 + HT_TCR, HT_TCR_WIND);
    } else if (HT_RD32(port->io, ecap + HT_TSCTR) > HT_DEAD_MAN_PULSE) {
        HT_WR32(port->io, ecap + HT_TSCTR, HT_DEAD_MAN_PULSE);
    } else {
        /* it has just expired: the pulse must end by itself */
    }
}

#endif
