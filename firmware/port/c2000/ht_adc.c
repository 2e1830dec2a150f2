/* Seven channels, and slow ones, started by ePWM1's SOCA at counter = 0. The end of the last conversion
 * raises the fast interrupt (PIE 1.1 on both devices). F28335: one after the other, the last one a slow
 * channel, by turns; it takes 0.24 us. F28377S: ADC-A the first set's currents and the dc link, ADC-B the
 * second set's currents, both at the same time; a slow channel of each follows. ADC-B's is over with the
 * dc link, ADC-A's is converted while the fast interrupt begins. */
#include "ht_change.h"
#include "ht_dead_man.h"

/* F28335. 12.5 MHz; a sample takes 2 periods, the sequence about 2 us. */
#define ADCTRL1 0x7100u
#define ADCTRL2 0x7101u
#define ADCMAXCONV 0x7102u
#define ADCCHSELSEQ1 0x7103u /* four channels a register */
#define EIGHTH 0xF000u       /* of ADCCHSELSEQ2 */
#define EIGHTH_SHIFT 12u
#define NO_TURNS 0xFFFFu
#define CONVERSIONS_F28335 8u
#define ADCTRL3 0x7118u
#define ADCST 0x7119u
#define ADCST_INT_SEQ1_CLR 0x0010u
#define ADC_CAL 0x380080u /* in OTP: reference and offset of this very chip */
#define ADCTRL1_SEQ_CASC 0x0010u
#define ADCTRL1_ACQ_PS_2 0x0100u
#define ADCTRL2_SOCA_SEQ1 0x0100u
#define ADCTRL2_INT_ENA_SEQ1 0x0800u
#define ADCTRL2_RST_SEQ1 0x4000u
#define ADCTRL2_RUN (ADCTRL2_SOCA_SEQ1 | ADCTRL2_INT_ENA_SEQ1)
#define ADCTRL3_POWER_UP 0x00E0u
#define ADCTRL3_ADCCLKPS_2 0x0002u
#define POWER_UP_F28335_US 5000u

/* F28377S. 50 MHz; a sample takes 20 system clocks, the sequence of four about 1.2 us. */
#define ADCA 0x7400u
#define ADCB 0x7480u
/* Words from a converter's first register */
#define ADCCTL1 0x00u
#define ADCCTL2 0x01u
#define ADCINTFLGCLR 0x04u
#define ADCINTOVF 0x05u
#define ADCINTOVFCLR 0x06u
#define ADCINTSEL1N2 0x07u
#define ADCSOCPRICTL 0x09u
#define ADCSOC0CTL 0x10u /* 32 bits each */
#define ADCOFFTRIM 0x3Bu
#define ADCINLTRIM1 0x70u /* 32 bits each */
#define ADCINLTRIM2 0x72u
#define ADCINLTRIM4 0x76u
#define ADCINLTRIM5 0x78u
#define OTP_INL_TRIM_A 0x0703B4u /* functions of TI's in OTP */
#define OTP_INL_TRIM_B 0x0703B2u
#define OTP_OFFSET_TRIM 0x0703ACu /* argument: 4 x ADC, + 0 = 12 bits, single-ended */
#define OTP_OFFSET_TRIM_B 4u
#define OTP_EMPTY 0xFFFFu
#define ADCCTL1_LATE 0x0004u /* interrupt at the end of the conversion */
#define ADCCTL1_PWDNZ 0x0080u
#define ADCCTL2_PRESCALE_4 0x0006u
#define ADCINT1 0x0001u
#define INT1E 0x0020u
/* Errata: without it a clear that meets the end of a conversion stops the interrupt for good. */
#define INT1CONT 0x0040u
#define CONVERSIONS_A 4u /* before the interrupt */
#define CONVERSIONS_B 3u
#define TRIGGER_EPWM1_SOCA ((uint32_t)5u << 20)
#define CHANNEL_SHIFT 15u
#define ACQUIRE_20 19u
#define LOW_HALF 0x0000FFFFu
#define POWER_UP_F28377S_US 1000u

/* F28335: which slow channel the last conversion is. */
static void select_slow(ht_port *port, uint16_t channel)
{
    ht_change16(port->io, port->map->adc_slow_select, EIGHTH,
                (uint16_t)(port->board->slow_channel[channel] << EIGHTH_SHIFT));
}

static void start_adc_f28335(ht_port *port)
{
    const uint16_t *channel = port->board->channel;
    uint16_t n;
    HT_CALL(port->io, ADC_CAL);
    HT_WR16(port->io, ADCTRL3, ADCTRL3_POWER_UP | ADCTRL3_ADCCLKPS_2);
    HT_WAIT_US(port->io, POWER_UP_F28335_US);
    HT_WR16(port->io, ADCTRL1, ADCTRL1_SEQ_CASC | ADCTRL1_ACQ_PS_2);
    HT_WR16(port->io, ADCMAXCONV, CONVERSIONS_F28335 - 1u);
    for (n = 0u; n < 2u; n++) {
        uint16_t four = 0u;
        uint16_t k;
        for (k = 0u; (k < 4u) && ((4u * n + k) < (uint16_t)HT_ADC_CHANNELS); k++) {
            four |= (uint16_t)(channel[4u * n + k] << (4u * k));
        }
        HT_WR16(port->io, ADCCHSELSEQ1 + (uint32_t)n, four);
    }
    select_slow(port, 0u);
    HT_WR16(port->io, ADCTRL2, ADCTRL2_RUN | ADCTRL2_RST_SEQ1);
    HT_WR16(port->io, ADCST, ADCST_INT_SEQ1_CLR); /* of a run before, else none ever comes */
}

/* The factory's trim for 12 bits, single-ended. A chip without it runs untrimmed. */
static void trim_f28377s(ht_port *port, uint32_t adc)
{
    uint32_t linearity = (adc == ADCA) ? OTP_INL_TRIM_A : OTP_INL_TRIM_B;
    uint16_t offset = 0u;
    if (HT_RD16(port->io, linearity) != OTP_EMPTY) {
        HT_CALL(port->io, linearity);
    }
    if (HT_RD16(port->io, OTP_OFFSET_TRIM) != OTP_EMPTY) {
        offset = HT_CALL16(port->io, OTP_OFFSET_TRIM, (adc == ADCA) ? 0u : OTP_OFFSET_TRIM_B);
    }
    if (offset != 0u) {
        HT_WR16(port->io, adc + ADCOFFTRIM, offset);
    }
    /* The linearity trim for 16 bits only. */
    ht_change32(port->io, adc + ADCINLTRIM1, LOW_HALF, 0u);
    ht_change32(port->io, adc + ADCINLTRIM2, LOW_HALF, 0u);
    ht_change32(port->io, adc + ADCINLTRIM4, LOW_HALF, 0u);
    ht_change32(port->io, adc + ADCINLTRIM5, LOW_HALF, 0u);
}

static void power_up_f28377s(ht_port *port, uint32_t adc)
{
    HT_WR16(port->io, adc + ADCCTL2, ADCCTL2_PRESCALE_4); /* 12 bits, single-ended: 0 */
    trim_f28377s(port, adc);
    HT_WR16(port->io, adc + ADCCTL1, ADCCTL1_PWDNZ | ADCCTL1_LATE);
}

/* Every second channel, from the first one on, and a slow one: the same timing on both converters. */
static void convert_f28377s(ht_port *port, uint32_t adc, uint16_t first, uint16_t conversions)
{
    uint16_t n;
    HT_WR16(port->io, adc + ADCSOCPRICTL, (uint16_t)(conversions + 1u)); /* in this order, always */
    for (n = 0u; n <= conversions; n++) {
        uint32_t channel = (n < conversions) ? port->board->channel[first + (2u * n)]
                                             : port->board->slow_channel[first];
        HT_WR32(port->io, adc + ADCSOC0CTL + (2u * (uint32_t)n),
                TRIGGER_EPWM1_SOCA | (channel << CHANNEL_SHIFT) | ACQUIRE_20);
    }
}

static void start_adc_f28377s(ht_port *port)
{
    HT_EALLOW(port->io);
    power_up_f28377s(port, ADCA);
    power_up_f28377s(port, ADCB);
    HT_WAIT_US(port->io, POWER_UP_F28377S_US);
    convert_f28377s(port, ADCA, 0u, CONVERSIONS_A);
    convert_f28377s(port, ADCB, 1u, CONVERSIONS_B);
    HT_WR16(port->io, ADCA + ADCINTSEL1N2, INT1CONT | INT1E | (CONVERSIONS_A - 1u));
    HT_EDIS(port->io);
    HT_WR16(port->io, ADCA + ADCINTFLGCLR, ADCINT1);
    HT_WR16(port->io, ADCA + ADCINTOVFCLR, ADCINT1);
}

void ht_adc_start(ht_port *port)
{
    if (port->map->adc_sequencer) {
        start_adc_f28335(port);
    } else {
        start_adc_f28377s(port);
    }
}

void ht_port_read(ht_port *port, ht_samples *samples)
{
    const ht_c2000_map *m = port->map;
    uint16_t shift = m->adc_shift;
    uint16_t channel;
    for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
        samples->adc[channel] = (uint16_t)(HT_RD16(port->io, m->adc_result[channel]) >> shift);
    }
    samples->position = ht_eqep_position(port);
}

uint16_t ht_port_read_slow(ht_port *port, uint16_t channel, uint16_t next)
{
    const ht_c2000_map *m = port->map;
    uint16_t reading = HT_RD16(port->io, m->adc_slow_result[channel]);
    if (m->adc_slow_select != NO_TURNS) {
        select_slow(port, next);
    }
    return (uint16_t)(reading >> m->adc_shift);
}

void ht_port_begin_fast(ht_port *port)
{
    HT_WR16(port->io, port->map->adc_clear, port->map->adc_clear_bit);
    if (port->map->adc_sequencer) { /* the sequencer stands where it stopped */
        HT_WR16(port->io, ADCTRL2, ADCTRL2_RUN | ADCTRL2_RST_SEQ1);
    } else if ((HT_RD16(port->io, ADCA + ADCINTOVF) & ADCINT1) != 0u) {
        /* Errata: the end of a conversion in the instant of the clear keeps the flag set. */
        HT_WR16(port->io, ADCA + ADCINTFLGCLR, ADCINT1);
        HT_WR16(port->io, ADCA + ADCINTOVFCLR, ADCINT1);
    } else {
        /* nothing in the way of the next one */
    }
    ht_dead_man_wind(port);
}

bool ht_port_overrun(const ht_port *port)
{
    return (HT_RD16(port->io, port->map->adc_flag) & port->map->adc_flag_bit) != 0u;
}
