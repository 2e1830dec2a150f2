#include "ht_cmpss.h"

#include "ht_change.h"

/* Words from one subsystem to the next, and from its first register */
#define STRIDE 0x20u
#define COMPCTL 0x00u
#define COMPHYSCTL 0x01u
#define COMPSTS 0x02u
#define COMPSTSCLR 0x03u
#define COMPDACCTL 0x04u
#define DACHVALS 0x06u
#define DACLVALS 0x12u
#define CTRIPLFILCTL 0x16u
#define CTRIPLFILCLKCTL 0x17u
#define CTRIPHFILCTL 0x18u
#define CTRIPHFILCLKCTL 0x19u
/* COMPCTL: DACs at the negative inputs, the low comparator inverted, filtered outputs to the X-BAR */
#define COMPDACE 0x8000u
#define CTRIPLSEL_FILTER 0x0800u
#define COMPLINV 0x0200u
#define CTRIPHSEL_FILTER 0x0008u
#define COMPCTL_RUN (COMPDACE | CTRIPLSEL_FILTER | COMPLINV | CTRIPHSEL_FILTER)
/* COMPDACCTL: reference VDDA, new values at the next clock, runs while a debugger halts */
#define COMPDACCTL_FREE 0x8000u
#define HYSTERESIS 1u
#define FILTER_CLOCKS 9u        /* a sample every 10 system clocks, 50 ns */
#define FILTER_15_OF_20 0x1D30u /* THRESH 14, SAMPWIN 19 */
#define FILINIT 0x8000u
/* COMPSTS, COMPSTSCLR */
#define HIGH_LATCH 0x0002u
#define LOW_LATCH 0x0200u
#define DAC_MOST 4095u
/* ePWM X-BAR: what TRIP5 listens to; two multiplexers a subsystem, two bits a multiplexer */
#define TRIP5MUX0TO15CFG 0x7A04u /* 32 bits */
#define TRIP5MUXENABLE 0x7A22u   /* 32 bits */
#define CTRIPH 0u
#define CTRIPH_OR_CTRIPL 1u
/* Digital compare of an ePWM module */
#define TZOSTFLG 0x95u
#define TZOSTCLR 0x99u
#define DCBCTL 0xC4u
#define DCBHCOMPSEL 0x0F00u
#define DCBHCOMPSEL_TRIP5 0x0400u
#define DCBEVT1 0x01C0u
#define DCBEVT1_DCBH_HIGH 0x0080u
#define DCBCTL_EVT1_ASYNC 0x0002u
#define TZ_DCBEVT1 0x0020u
#define OST_DCBEVT1 0x0080u

static uint32_t first_register(const ht_port *port, uint16_t number)
{
    return port->map->cmpss + (((uint32_t)number - 1u) * STRIDE);
}

/* Whole steps of the DAC: never tighter than `counts` of the ADC. */
static uint16_t dac_high(const ht_port *port, uint16_t counts)
{
    float steps = ((float)counts * port->board->dac_per_count) + 1.0f;
    return (uint16_t)((steps < (float)DAC_MOST) ? steps : (float)DAC_MOST);
}

static uint16_t dac_low(const ht_port *port, uint16_t counts)
{
    return (uint16_t)((float)counts * port->board->dac_per_count);
}

static void start_one(ht_port *port, uint32_t base)
{
    ht_io *io = port->io;
    HT_WR16(io, base + COMPHYSCTL, HYSTERESIS);
    HT_WR16(io, base + COMPDACCTL, COMPDACCTL_FREE);
    HT_WR16(io, base + DACHVALS, DAC_MOST);
    HT_WR16(io, base + DACLVALS, 0u);
    HT_WR16(io, base + CTRIPHFILCLKCTL, FILTER_CLOCKS);
    HT_WR16(io, base + CTRIPLFILCLKCTL, FILTER_CLOCKS);
    HT_WR16(io, base + CTRIPHFILCTL, FILTER_15_OF_20);
    HT_WR16(io, base + CTRIPLFILCTL, FILTER_15_OF_20);
    HT_WR16(io, base + COMPCTL, COMPCTL_RUN);
    /* The filters begin with what the comparators say. The DACs may not stand yet: what trips now is
     * forgotten before a gate goes on. */
    HT_WR16(io, base + CTRIPHFILCTL, FILINIT | FILTER_15_OF_20);
    HT_WR16(io, base + CTRIPLFILCTL, FILINIT | FILTER_15_OF_20);
}

/* A dc link at 0 V is no fault, and its low comparator's offset may lie above that. */
static bool has_low_level(uint16_t channel)
{
    return channel != (uint16_t)HT_ADC_VDC;
}

HT_SELDOM void ht_cmpss_start(ht_port *port)
{
    ht_io *io = port->io;
    uint32_t listens = 0u;
    uint32_t enabled = 0u;
    uint16_t channel;
    uint16_t leg;
    if (port->map->cmpss == 0u) {
        return;
    }
    HT_EALLOW(io);
    for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
        uint16_t number = ht_board_cmpss(port->board, channel);
        if (number != 0u) {
            uint32_t multiplexer = 2u * ((uint32_t)number - 1u);
            uint32_t position = has_low_level(channel) ? CTRIPH_OR_CTRIPL : CTRIPH;
            start_one(port, first_register(port, number));
            listens |= position << (2u * multiplexer);
            enabled |= (uint32_t)1u << multiplexer;
        }
    }
    HT_WR32(io, TRIP5MUX0TO15CFG, listens);
    HT_WR32(io, TRIP5MUXENABLE, enabled);
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        uint32_t base = port->leg[leg];
        ht_change16(io, base + HT_DCTRIPSEL, DCBHCOMPSEL, DCBHCOMPSEL_TRIP5);
        ht_change16(io, base + HT_TZDCSEL, DCBEVT1, DCBEVT1_DCBH_HIGH);
        HT_WR16(io, base + DCBCTL, DCBCTL_EVT1_ASYNC);
    }
    HT_EDIS(io);
    ht_cmpss_forget(port);
}

HT_SELDOM void ht_cmpss_forget(ht_port *port)
{
    if (port->map->cmpss != 0u) {
        uint16_t channel;
        uint16_t leg;
        HT_EALLOW(port->io);
        for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
            uint16_t number = ht_board_cmpss(port->board, channel);
            if (number != 0u) {
                HT_WR16(port->io, first_register(port, number) + COMPSTSCLR,
                        HIGH_LATCH | LOW_LATCH);
            }
        }
        for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
            HT_WR16(port->io, port->leg[leg] + port->map->tzclr, TZ_DCBEVT1);
            HT_WR16(port->io, port->leg[leg] + TZOSTCLR, OST_DCBEVT1);
        }
        HT_EDIS(port->io);
    }
}

HT_SELDOM void ht_port_trip_levels(ht_port *port, const ht_trip_levels *levels)
{
    if (port->map->cmpss != 0u) {
        uint16_t channel;
        for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
            uint16_t number = ht_board_cmpss(port->board, channel);
            if (number != 0u) {
                uint32_t base = first_register(port, number);
                HT_WR16(port->io, base + DACHVALS, dac_high(port, levels->high[channel]));
                HT_WR16(port->io, base + DACLVALS, dac_low(port, levels->low[channel]));
            }
        }
    }
}

HT_SELDOM uint16_t ht_port_beyond(const ht_port *port)
{
    uint16_t found = 0u;
    /* All legs listen to the comparators, and each keeps that one has tripped it. Which one it was says
     * the subsystem's own latch. */
    if ((port->map->cmpss != 0u)
        && ((HT_RD16(port->io, port->leg[0] + TZOSTFLG) & OST_DCBEVT1) != 0u)) {
        uint16_t channel;
        for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
            uint16_t number = ht_board_cmpss(port->board, channel);
            uint16_t latches = has_low_level(channel) ? (HIGH_LATCH | LOW_LATCH) : HIGH_LATCH;
            if ((number != 0u)
                && ((HT_RD16(port->io, first_register(port, number) + COMPSTS) & latches) != 0u)) {
                found = (uint16_t)(found | (1u << channel));
            }
        }
    }
    return found;
}
