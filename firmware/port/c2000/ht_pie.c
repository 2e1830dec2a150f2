/* Interrupt controller. Both interrupts are in group 1: 1.1 the end of the ADC's
 * sequence (SEQ1INT, ADCA1), 1.7 CPU timer 0. INT13, CPU timer 1, does not pass through it. */
#include "ht_drivers.h"

#define PIECTRL 0x0CE0u
#define PIEACK 0x0CE1u
#define PIEIER1 0x0CE2u
#define PIEIFR1 0x0CE3u
#define PIEIER2 0x0CE4u
#define PIEIFR2 0x0CE5u
#define PIEVECT 0x0D00u /* 32 bits each */
#define GROUPS 12u
#define PIECTRL_ENPIE 0x0001u
#define GROUP1 0x0001u
#define INT13 0x1000u
#define VECTOR_INT13 13u
#define FAST 0x0001u
#define SLOW 0x0040u
#define VECTOR_FIRST 13u /* below: not used with the PIE, and the boot ROM's */
#define VECTOR_FAST 32u
#define VECTOR_SLOW 38u

void ht_pie_start(ht_port *port, const ht_isrs *isrs)
{
    uint16_t n;
    HT_DINT(port->io);
    HT_IER_WRITE(port->io, 0u);
    HT_WR16(port->io, PIECTRL, 0u);
    HT_WR16(port->io, PIEIER1, 0u);
    HT_WR16(port->io, PIEIFR1, 0u);
    for (n = 0u; n < (GROUPS - 1u); n++) {
        HT_WR16(port->io, PIEIER2 + (2u * (uint32_t)n), 0u);
        HT_WR16(port->io, PIEIFR2 + (2u * (uint32_t)n), 0u);
    }
    HT_IFR_CLEAR(port->io);
    HT_EALLOW(port->io);
    for (n = VECTOR_FIRST; n < port->map->vectors; n++) {
        HT_VECTOR(port->io, PIEVECT + (2u * (uint32_t)n), isrs->unexpected);
    }
    HT_VECTOR(port->io, PIEVECT + (2u * VECTOR_INT13), isrs->lost);
    HT_VECTOR(port->io, PIEVECT + (2u * VECTOR_FAST), isrs->fast);
    HT_VECTOR(port->io, PIEVECT + (2u * VECTOR_SLOW), isrs->slow);
    HT_EDIS(port->io);
    HT_WR16(port->io, PIEACK, 0x0FFFu);
    HT_WR16(port->io, PIEIER1, FAST | SLOW);
    HT_WR16(port->io, PIECTRL, PIECTRL_ENPIE);
}

void ht_pie_enable(ht_port *port)
{
    (void)port; /* CPU registers only */
    HT_IER_WRITE(port->io, GROUP1 | INT13);
    HT_EINT(port->io);
}

void ht_pie_begin_slow(ht_port *port)
{
    /* The group is not acknowledged yet, so nothing can be on its way that this disables. */
    HT_WR16(port->io, PIEIER1, FAST);
    HT_WR16(port->io, PIEACK, GROUP1);
    /* Errata usage note: never PIEACK and EINT back to back. */
    HT_NOP(port->io);
    HT_IER_SET(port->io, GROUP1); /* the CPU cleared it on the way in */
    HT_EINT(port->io);
}

void ht_pie_end_slow(ht_port *port)
{
    HT_DINT(port->io);
    HT_WR16(port->io, PIEIER1, FAST | SLOW);
}

void ht_port_ack_fast(ht_port *port)
{
    HT_WR16(port->io, PIEACK, GROUP1);
}
