/* Drivers of the C2000 targets. Register order matters in three places, each
 * named below: clocks before registers, trip before outputs, sync last. */
#include "ht_port_c2000.h"

static uint32_t reg(const ht_port *port, int leg, uint16_t offset)
{
    return port->map->epwm + (uint32_t)leg * port->map->stride + offset;
}

static void init_leg(ht_port *port, int leg, const ht_pwm_setup *setup)
{
    const ht_c2000_map *m = port->map;
    ht_io *io = port->io;
    uint16_t never = setup->period_counts;
    (void)io;

    /* Trip first: the outputs stay low through everything that follows. */
    HT_EALLOW(io);
    HT_WR16(io, reg(port, leg, m->tzctl), TZCTL_BOTH_LOW);
    HT_WR16(io, reg(port, leg, m->tzfrc), TZ_OST);
    HT_WR16(io, reg(port, leg, m->tzsel), TZSEL_OSHT1);
    HT_EDIS(io);

    /* Up-count, clock undivided (the reset value halves it). Leg 1 is the sync
     * master; the others follow at phase 0. */
    HT_WR16(io, reg(port, leg, m->tbctl),
            (leg == 0) ? (TBCTL_FREE_RUN | TBCTL_SYNCOSEL_CTR0) : (TBCTL_FREE_RUN | TBCTL_PHSEN));
    HT_WR16(io, reg(port, leg, m->tbprd), (uint16_t)(setup->period_counts - 1u));
    HT_WR16(io, reg(port, leg, m->tbphs), 0u);
    HT_WR16(io, reg(port, leg, m->tbctr), 0u);

    HT_WR16(io, reg(port, leg, m->cmpctl),
            setup->shadow ? 0u : (CMPCTL_SHDWAMODE_IMMEDIATE | CMPCTL_SHDWBMODE_IMMEDIATE));
    HT_WR16(io, reg(port, leg, m->cmpa), never);
    HT_WR16(io, reg(port, leg, m->cmpb), never);
    if (m->aqctl != 0xFFFFu) {
        /* Load on PRD: settled before the ZERO action uses it. */
        HT_WR16(io, reg(port, leg, m->aqctl),
                setup->shadow ? (AQCTL_SHDWAQAMODE | AQCTL_LDAQAMODE_PRD) : 0u);
    }
    HT_WR16(io, reg(port, leg, m->aqctla),
            AQ_CAU_TOGGLE | AQ_CBU_TOGGLE | (setup->shadow ? AQ_ZRO_CLEAR : 0u));
    HT_WR16(io, reg(port, leg, m->aqcsfrc), 0u);

    HT_WR16(io, reg(port, leg, m->dbctl), DBCTL_COMPLEMENTARY);
    HT_WR16(io, reg(port, leg, m->dbred), setup->dead_counts);
    HT_WR16(io, reg(port, leg, m->dbfed), setup->dead_counts);

    if (leg == 0) { /* counter = 0 starts the ADC and raises the fast interrupt */
        HT_WR16(io, reg(port, leg, m->etps), ETPS_EVERY);
        HT_WR16(io, reg(port, leg, m->etsel), ETSEL_SOCA_CTR0 | ETSEL_INT_CTR0);
    }
}

/* Quadrature counter over all 32 bits and the capture unit. The pins are the board's
 * business. Nothing here moves the counter: it may stand anywhere. */
static void init_eqep(ht_port *port)
{
    uint32_t eqep = port->map->eqep;
    ht_io *io = port->io;
    (void)io;
    HT_WR16(io, eqep + EQEP_QDECCTL, 0u); /* quadrature, inputs as they are */
    HT_WR32(io, eqep + EQEP_QPOSMAX, 0xFFFFFFFFu);
    HT_WR16(io, eqep + EQEP_QEPCTL, QEPCTL_FREE_RUN | QEPCTL_PCRM_MAX | QEPCTL_QPEN);
    HT_WR16(io, eqep + EQEP_QCAPCTL, 0u); /* the prescalers change while it is off only */
    HT_WR16(io, eqep + EQEP_QCAPCTL, QCAPCTL_CCPS_128 | QCAPCTL_UPPS_4);
    HT_WR16(io, eqep + EQEP_QCAPCTL, QCAPCTL_CEN | QCAPCTL_CCPS_128 | QCAPCTL_UPPS_4);
}

bool ht_port_accepts(const ht_port *port, const ht_pwm_setup *setup)
{
    return (setup->period_counts >= 8u) && (setup->dead_counts <= port->map->dead_max_counts);
}

bool ht_port_init(ht_port *port, const ht_pwm_setup *setup)
{
    const ht_c2000_map *m = port->map;
    ht_io *io = port->io;
    int leg;
    (void)io;
    port->shadow = setup->shadow;

    /* Clocks before registers: writes to an unclocked module are lost. */
    HT_EALLOW(io);
    HT_WR16(io, m->pclk_tbsync, (uint16_t)(HT_RD16(io, m->pclk_tbsync) & (uint16_t)~m->tbsync_bit));
    HT_WR16(io, m->pclk_epwm, (uint16_t)(HT_RD16(io, m->pclk_epwm) | 0x003Fu));
    HT_WR16(io, m->pclk_eqep, (uint16_t)(HT_RD16(io, m->pclk_eqep) | m->eqep_bit));
    if (m->perclkdivsel != 0u) {
        HT_WR16(io, m->perclkdivsel, /* other clocks share the register */
                (uint16_t)((HT_RD16(io, m->perclkdivsel) & (uint16_t)~PERCLKDIVSEL_EPWM_MASK)
                           | PERCLKDIVSEL_EPWM_DIV2));
    }
    HT_EDIS(io);

    if (!ht_port_accepts(port, setup)) {
        ht_port_gates_off(port);
        return false;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        init_leg(port, leg, setup);
    }
    init_eqep(port);
    /* Sync last: all counters start together. */
    HT_EALLOW(io);
    HT_WR16(io, m->pclk_tbsync, (uint16_t)(HT_RD16(io, m->pclk_tbsync) | m->tbsync_bit));
    HT_EDIS(io);
    return true;
}

float ht_port_pwm_clock_Hz(const ht_port *port)
{
    return port->map->pwm_clock_Hz;
}

float ht_port_capture_clock_Hz(const ht_port *port)
{
    return port->map->system_clock_Hz * (1.0f / CAPTURE_CLOCK_DIVIDER);
}

void ht_port_read(ht_port *port, ht_samples *samples)
{
    const ht_c2000_map *m = port->map;
    int channel;
    for (channel = 0; channel < HT_ADC_CHANNELS; channel++) {
        samples->adc[channel] =
            (uint16_t)(HT_RD16(port->io, m->adc_result + (uint32_t)channel) >> m->adc_shift);
    }
    samples->position = HT_RD32(port->io, m->eqep + EQEP_QPOSCNT);
}

void ht_port_read_capture(ht_port *port, ht_capture *capture)
{
    uint32_t eqep = port->map->eqep;
    uint16_t status;
    /* Flags last: they then cover all that the two numbers may have suffered. */
    capture->period_ticks = HT_RD16(port->io, eqep + EQEP_QCPRD);
    capture->age_ticks = HT_RD16(port->io, eqep + EQEP_QCTMR);
    status = HT_RD16(port->io, eqep + EQEP_QEPSTS);
    capture->event = (status & QEPSTS_UPEVNT) != 0u;
    capture->overflow = (status & QEPSTS_COEF) != 0u;
    capture->reversed = (status & QEPSTS_CDEF) != 0u;
    capture->forward = (status & QEPSTS_QDF) != 0u;
    /* Only what was seen: a flag that comes up in between is for the next look. */
    HT_WR16(port->io, eqep + EQEP_QEPSTS,
            (uint16_t)(status & (QEPSTS_UPEVNT | QEPSTS_COEF | QEPSTS_CDEF)));
}

void ht_port_write(ht_port *port, const ht_compare *pattern)
{
    const ht_c2000_map *m = port->map;
    uint16_t bit = 0x20u;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        bool high = (pattern->start & bit) != 0u;
        HT_WR16(port->io, reg(port, leg, m->cmpa), pattern->ca[leg]);
        HT_WR16(port->io, reg(port, leg, m->cmpb), pattern->cb[leg]);
        if (port->shadow) { /* the start level is the ZERO action of the next period */
            HT_WR16(port->io, reg(port, leg, m->aqctla),
                    (uint16_t)(AQ_CAU_TOGGLE | AQ_CBU_TOGGLE | (high ? AQ_ZRO_SET : AQ_ZRO_CLEAR)));
        } else { /* the start level is forced now; ZERO does nothing */
            HT_WR16(port->io, reg(port, leg, m->aqsfrc),
                    (uint16_t)(AQSFRC_OTSFA | (high ? AQSFRC_ACTSFA_SET : AQSFRC_ACTSFA_CLEAR)));
        }
        bit = (uint16_t)(bit >> 1);
    }
}

void ht_port_gates_off(ht_port *port)
{
    int leg;
    HT_EALLOW(port->io);
    for (leg = 0; leg < HT_LEGS; leg++) {
        HT_WR16(port->io, reg(port, leg, port->map->tzfrc), TZ_OST);
    }
    HT_EDIS(port->io);
}

void ht_port_gates_on(ht_port *port)
{
    int leg;
    HT_EALLOW(port->io);
    for (leg = 0; leg < HT_LEGS; leg++) {
        HT_WR16(port->io, reg(port, leg, port->map->tzclr), TZ_OST | TZ_INT);
    }
    HT_EDIS(port->io);
}

bool ht_port_tripped(const ht_port *port)
{
    /* Pin and software trip all six legs together: one flag tells. */
    return (HT_RD16(port->io, reg(port, 0, port->map->tzflg)) & TZ_OST) != 0u;
}

void ht_port_begin_fast(ht_port *port)
{
    HT_WR16(port->io, reg(port, 0, port->map->etclr), ET_INT);
}

bool ht_port_overrun(const ht_port *port)
{
    return (HT_RD16(port->io, reg(port, 0, port->map->etflg)) & ET_INT) != 0u;
}

void ht_port_ack_fast(ht_port *port)
{
    HT_WR16(port->io, port->map->pieack, PIEACK_GROUP3);
}
