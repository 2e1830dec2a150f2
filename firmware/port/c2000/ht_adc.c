/* ADC-A: seven conversions in a row, started by ePWM1's SOCA at counter = 0. The end
 * of the last one raises the fast interrupt (PIE 1.1 on both devices). */
#include "ht_drivers.h"

#define LAST (HT_ADC_CHANNELS - 1)

/* F28335. 12.5 MHz; a sample takes 2 periods, the sequence about 2 us. */
#define ADCTRL1 0x7100u
#define ADCTRL2 0x7101u
#define ADCMAXCONV 0x7102u
#define ADCCHSELSEQ1 0x7103u /* four channels a register */
#define ADCTRL3 0x7118u
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

/* F28377S. 50 MHz; a sample takes 20 system clocks, the sequence about 2.2 us. */
#define ADCCTL1 0x7400u
#define ADCCTL2 0x7401u
#define ADCINTSEL1N2 0x7407u
#define ADCSOCPRICTL 0x7409u
#define ADCSOC0CTL 0x7410u /* 32 bits each */
#define ADCOFFTRIM 0x743Bu
#define ADCINLTRIM1 0x7470u /* 32 bits each */
#define ADCINLTRIM2 0x7472u
#define ADCINLTRIM4 0x7476u
#define ADCINLTRIM5 0x7478u
#define OTP_INL_TRIM 0x0703B4u    /* functions of TI's in OTP, for ADC-A */
#define OTP_OFFSET_TRIM 0x0703ACu /* argument: 4 x ADC, + 0 = 12 bits, single-ended */
#define OTP_EMPTY 0xFFFFu
#define ADCCTL1_LATE 0x0004u /* interrupt at the end of the conversion */
#define ADCCTL1_PWDNZ 0x0080u
#define ADCCTL2_PRESCALE_4 0x0006u
#define INT1E 0x0020u
#define TRIGGER_EPWM1_SOCA ((uint32_t)5u << 20)
#define CHANNEL_SHIFT 15u
#define ACQUIRE_20 19u
#define LOW_HALF 0x0000FFFFu
#define POWER_UP_F28377S_US 1000u

static void start_adc_f28335(ht_port *port)
{
    const uint16_t *channel = port->board->channel;
    uint16_t n;
    HT_CALL(port->io, ADC_CAL);
    HT_WR16(port->io, ADCTRL3, ADCTRL3_POWER_UP | ADCTRL3_ADCCLKPS_2);
    HT_WAIT_US(port->io, POWER_UP_F28335_US);
    HT_WR16(port->io, ADCTRL1, ADCTRL1_SEQ_CASC | ADCTRL1_ACQ_PS_2);
    HT_WR16(port->io, ADCMAXCONV, (uint16_t)LAST);
    for (n = 0u; n < 2u; n++) {
        uint16_t four = 0u;
        uint16_t k;
        for (k = 0u; (k < 4u) && ((4u * n + k) < (uint16_t)HT_ADC_CHANNELS); k++) {
            four |= (uint16_t)(channel[4u * n + k] << (4u * k));
        }
        HT_WR16(port->io, ADCCHSELSEQ1 + (uint32_t)n, four);
    }
    HT_WR16(port->io, ADCTRL2, ADCTRL2_RUN | ADCTRL2_RST_SEQ1);
}

/* The factory's trim for 12 bits, single-ended. A chip without it runs untrimmed. */
static void trim_f28377s(ht_port *port)
{
    uint16_t offset = 0u;
    if (HT_RD16(port->io, OTP_INL_TRIM) != OTP_EMPTY) {
        HT_CALL(port->io, OTP_INL_TRIM);
    }
    if (HT_RD16(port->io, OTP_OFFSET_TRIM) != OTP_EMPTY) {
        offset = HT_CALL16(port->io, OTP_OFFSET_TRIM, 0u);
    }
    if (offset != 0u) {
        HT_WR16(port->io, ADCOFFTRIM, offset);
    }
    /* What the linearity trim holds for 16 bits only. */
    HT_WR32(port->io, ADCINLTRIM1, HT_RD32(port->io, ADCINLTRIM1) & ~(uint32_t)LOW_HALF);
    HT_WR32(port->io, ADCINLTRIM2, HT_RD32(port->io, ADCINLTRIM2) & ~(uint32_t)LOW_HALF);
    HT_WR32(port->io, ADCINLTRIM4, HT_RD32(port->io, ADCINLTRIM4) & ~(uint32_t)LOW_HALF);
    HT_WR32(port->io, ADCINLTRIM5, HT_RD32(port->io, ADCINLTRIM5) & ~(uint32_t)LOW_HALF);
}

static void start_adc_f28377s(ht_port *port)
{
    uint16_t n;
    HT_EALLOW(port->io);
    HT_WR16(port->io, ADCCTL2, ADCCTL2_PRESCALE_4); /* 12 bits, single-ended: 0 */
    trim_f28377s(port);
    HT_WR16(port->io, ADCCTL1, ADCCTL1_PWDNZ | ADCCTL1_LATE);
    HT_WAIT_US(port->io, POWER_UP_F28377S_US);
    HT_WR16(port->io, ADCSOCPRICTL, (uint16_t)HT_ADC_CHANNELS); /* in this order, always */
    for (n = 0u; n < (uint16_t)HT_ADC_CHANNELS; n++) {
        HT_WR32(port->io, ADCSOC0CTL + (2u * (uint32_t)n),
                TRIGGER_EPWM1_SOCA | ((uint32_t)port->board->channel[n] << CHANNEL_SHIFT)
                    | ACQUIRE_20);
    }
    HT_WR16(port->io, ADCINTSEL1N2, (uint16_t)(INT1E | (uint16_t)LAST));
    HT_EDIS(port->io);
    HT_WR16(port->io, port->map->adc_clear, port->map->adc_clear_bit);
}

void ht_adc_start(ht_port *port)
{
    if (port->map->device == HT_F28335) {
        start_adc_f28335(port);
    } else {
        start_adc_f28377s(port);
    }
}

void ht_port_read(ht_port *port, ht_samples *samples)
{
    const ht_c2000_map *m = port->map;
    uint32_t result = m->adc_result;
    uint16_t shift = m->adc_shift;
    uint16_t channel;
    for (channel = 0u; channel < (uint16_t)HT_ADC_CHANNELS; channel++) {
        samples->adc[channel] = (uint16_t)(HT_RD16(port->io, result + (uint32_t)channel) >> shift);
    }
    samples->position = ht_eqep_position(port);
}

void ht_port_begin_fast(ht_port *port)
{
    HT_WR16(port->io, port->map->adc_clear, port->map->adc_clear_bit);
    if (port->map->device == HT_F28335) { /* the sequencer stands where it stopped */
        HT_WR16(port->io, ADCTRL2, ADCTRL2_RUN | ADCTRL2_RST_SEQ1);
    }
}

bool ht_port_overrun(const ht_port *port)
{
    return (HT_RD16(port->io, port->map->adc_flag) & port->map->adc_flag_bit) != 0u;
}
