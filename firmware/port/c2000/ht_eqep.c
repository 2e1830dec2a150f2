/* eQEP: the same registers on both devices. */
#include "ht_drivers.h"

/* Words from the module's first register */
#define QPOSCNT 0x00u  /* 32 bits */
#define QPOSMAX 0x04u  /* 32 bits */
#define QPOSILAT 0x08u /* 32 bits */
#define QDECCTL 0x14u
#define QEPCTL 0x15u
#define QCAPCTL 0x16u
#define QFLG 0x19u
#define QCLR 0x1Au
#define QEPSTS 0x1Cu
#define QCTMR 0x1Du
#define QCPRD 0x1Eu
/* QEPCTL: run on under the debugger, reset at QPOSMAX and not at the index, latch at the index's rise,
 * counter enabled */
#define QEPCTL_FREE_RUN 0x8000u
#define QEPCTL_PCRM_MAX 0x1000u
#define QEPCTL_IEL_RISE 0x0010u
#define QEPCTL_QPEN 0x0008u
/* QCAPCTL: CCPS divides SYSCLKOUT by 2^CCPS, UPPS makes every 2^UPPS-th edge a unit event */
#define QCAPCTL_CEN 0x8000u
#define QCAPCTL_CCPS_128 0x0070u
#define QCAPCTL_UPPS_4 0x0002u
#define CAPTURE_CLOCK_DIVIDER 128.0f
/* QFLG and QCLR: the index has latched the counter */
#define QFLG_IEL 0x0400u
/* QEPSTS */
#define QEPSTS_UPEVNT 0x0080u
#define QEPSTS_QDF 0x0020u
#define QEPSTS_COEF 0x0008u
#define QEPSTS_CDEF 0x0004u

void ht_eqep_start(ht_port *port)
{
    uint32_t eqep = port->eqep;
    HT_WR16(port->io, eqep + QDECCTL, 0u); /* quadrature, inputs as they are */
    HT_WR32(port->io, eqep + QPOSMAX, 0xFFFFFFFFu);
    HT_WR16(port->io, eqep + QEPCTL,
            QEPCTL_FREE_RUN | QEPCTL_PCRM_MAX | QEPCTL_IEL_RISE | QEPCTL_QPEN);
    /* The prescalers change while it is off only. */
    HT_WR16(port->io, eqep + QCAPCTL, QCAPCTL_CCPS_128 | QCAPCTL_UPPS_4);
    HT_WR16(port->io, eqep + QCAPCTL, QCAPCTL_CEN | QCAPCTL_CCPS_128 | QCAPCTL_UPPS_4);
}

uint32_t ht_eqep_position(const ht_port *port)
{
    return HT_RD32(port->io, port->eqep + QPOSCNT);
}

float ht_port_capture_clock_Hz(const ht_port *port)
{
    return port->map->system_clock_Hz * (1.0f / CAPTURE_CLOCK_DIVIDER);
}

void ht_port_read_capture(ht_port *port, ht_capture *capture)
{
    uint32_t eqep = port->eqep;
    uint16_t status;
    /* Flags last: they then cover all that the two numbers may have suffered. */
    capture->period_ticks = HT_RD16(port->io, eqep + QCPRD);
    capture->age_ticks = HT_RD16(port->io, eqep + QCTMR);
    status = HT_RD16(port->io, eqep + QEPSTS);
    capture->event = (status & QEPSTS_UPEVNT) != 0u;
    capture->overflow = (status & QEPSTS_COEF) != 0u;
    capture->reversed = (status & QEPSTS_CDEF) != 0u;
    capture->forward = (status & QEPSTS_QDF) != 0u;
    /* Only what was seen: a flag that comes up in between is for the next look. */
    HT_WR16(port->io, eqep + QEPSTS,
            (uint16_t)(status & (QEPSTS_UPEVNT | QEPSTS_COEF | QEPSTS_CDEF)));
    capture->index = (HT_RD16(port->io, eqep + QFLG) & QFLG_IEL) != 0u;
    if (capture->index) {
        /* The flag first: an index that comes in between is found again at the next look. */
        HT_WR16(port->io, eqep + QCLR, QFLG_IEL);
        capture->index_position = HT_RD32(port->io, eqep + QPOSILAT);
    }
}

uint32_t ht_port_read_absolute(const ht_port *port)
{
    return HT_ABSOLUTE(port->io);
}
