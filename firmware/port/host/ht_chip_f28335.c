/* Registers of the F28335 (TMS320x2833x manuals, SPRS439). */
#include "ht_registers.h"

#define COUNT(table) ((uint16_t)(sizeof(table) / sizeof((table)[0])))
#define PLAIN(name, offset, writable, fields) \
    REG(name, offset, 0u, writable, HT_PLAIN, 0u, 0u, fields)

static const ht_register epwm[] = {
    REG("TBCTL", 0x00u, 0x0083u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u,
        "15-14 FREE_SOFT, 13 PHSDIR, 12-10 CLKDIV, 9-7 HSPCLKDIV, 6 SWFSYNC, 5-4 SYNCOSEL, "
        "3 PRDLD, 2 PHSEN, 1-0 CTRMODE"),
    REG("TBSTS", 0x01u, 0x0001u, 0x0006u, HT_ONES_CLEAR, 0u, 0u, "2 CTRMAX, 1 SYNCI, 0 CTRDIR"),
    PLAIN("TBPHSHR", 0x02u, 0xFF00u, ""),
    REG("TBPHS", 0x03u, 0u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    REG("TBCTR", 0x04u, 0u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    REG("TBPRD", 0x05u, 0u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    REG("CMPCTL", 0x07u, 0u, 0x005Fu, HT_PLAIN, HT_SET_UP, 0u,
        "9 SHDWBFULL, 8 SHDWAFULL, 6 SHDWBMODE, 4 SHDWAMODE, 3-2 LOADBMODE, 1-0 LOADAMODE"),
    PLAIN("CMPAHR", 0x08u, 0xFF00u, ""),
    PLAIN("CMPA", 0x09u, 0xFFFFu, ""),
    PLAIN("CMPB", 0x0Au, 0xFFFFu, ""),
    PLAIN("AQCTLA", 0x0Bu, 0x0FFFu, "11-10 CBD, 9-8 CBU, 7-6 CAD, 5-4 CAU, 3-2 PRD, 1-0 ZRO"),
    PLAIN("AQCTLB", 0x0Cu, 0x0FFFu, "11-10 CBD, 9-8 CBU, 7-6 CAD, 5-4 CAU, 3-2 PRD, 1-0 ZRO"),
    PLAIN("AQSFRC", 0x0Du, 0x00FFu, "7-6 RLDCSF, 5 OTSFB, 4-3 ACTSFB, 2 OTSFA, 1-0 ACTSFA"),
    PLAIN("AQCSFRC", 0x0Eu, 0x000Fu, "3-2 CSFB, 1-0 CSFA"),
    REG("DBCTL", 0x0Fu, 0u, 0x003Fu, HT_PLAIN, HT_SET_UP, 0u,
        "5-4 IN_MODE, 3-2 POLSEL, 1-0 OUT_MODE"),
    REG("DBRED", 0x10u, 0u, 0x03FFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    REG("DBFED", 0x11u, 0u, 0x03FFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    REG("TZSEL", 0x12u, 0u, 0x3F3Fu, HT_PLAIN, HT_EALLOWED | HT_SET_UP, 0u,
        "13 OSHT6, 12 OSHT5, 11 OSHT4, 10 OSHT3, 9 OSHT2, 8 OSHT1, 5 CBC6, 4 CBC5, 3 CBC4, 2 CBC3, "
        "1 CBC2, 0 CBC1"),
    REG("TZCTL", 0x14u, 0u, 0x000Fu, HT_PLAIN, HT_EALLOWED | HT_TRIP_ACTION, 0u,
        "3-2 TZB, 1-0 TZA"),
    REG("TZEINT", 0x15u, 0u, 0x0006u, HT_PLAIN, HT_EALLOWED, 0u, "2 OST, 1 CBC"),
    REG("TZFLG", 0x16u, 0u, 0u, HT_READ_ONLY, 0u, 0u, "2 OST, 1 CBC, 0 INT"),
    REG("TZCLR", 0x17u, 0u, 0x0007u, HT_ONES_CLEAR_AT, HT_EALLOWED, 0x16u, ""),
    REG("TZFRC", 0x18u, 0u, 0x0006u, HT_ONES_SET_AT, HT_EALLOWED, 0x16u, ""),
    PLAIN("ETSEL", 0x19u, 0xFF0Fu,
          "15 SOCBEN, 14-12 SOCBSEL, 11 SOCAEN, 10-8 SOCASEL, 3 INTEN, 2-0 INTSEL"),
    PLAIN("ETPS", 0x1Au, 0x3303u,
          "15-14 SOCBCNT, 13-12 SOCBPRD, 11-10 SOCACNT, 9-8 SOCAPRD, 3-2 INTCNT, 1-0 INTPRD"),
    REG("ETFLG", 0x1Bu, 0u, 0u, HT_READ_ONLY, 0u, 0u, "3 SOCB, 2 SOCA, 0 INT"),
    REG("ETCLR", 0x1Cu, 0u, 0x000Du, HT_ONES_CLEAR_AT, 0u, 0x1Bu, ""),
    REG("ETFRC", 0x1Du, 0u, 0x000Du, HT_ONES_SET_AT, 0u, 0x1Bu, ""),
    REG("PCCTL", 0x1Eu, 0u, 0x07FFu, HT_PLAIN, HT_SET_UP, 0u,
        "10-8 CHPDUTY, 7-5 CHPFREQ, 4-1 OSHTWTH, 0 CHPEN"),
    REG("HRCNFG", 0x20u, 0u, 0x000Fu, HT_PLAIN, HT_EALLOWED, 0u,
        "3 HRLOAD, 2 CTLMODE, 1-0 EDGMODE"),
};

#define RESULT(n, offset) REG("ADCRESULT" n, offset, 0u, 0u, HT_READ_ONLY, 0u, 0u, "")

static const ht_register adc[] = {
    PLAIN("ADCTRL1", 0x00u, 0x7FF0u,
          "14 RESET, 13-12 SUSMOD, 11-8 ACQ_PS, 7 CPS, 6 CONT_RUN, 5 SEQ_OVRD, 4 SEQ_CASC"),
    REG("ADCTRL2", 0x01u, 0u, 0xEDEDu, HT_FX_ADCTRL2, 0u, 0u,
        "15 EPWM_SOCB_SEQ, 14 RST_SEQ1, 13 SOC_SEQ1, 11 INT_ENA_SEQ1, 10 INT_MOD_SEQ1, "
        "8 EPWM_SOCA_SEQ1, 7 EXT_SOC_SEQ1, 6 RST_SEQ2, 5 SOC_SEQ2, 3 INT_ENA_SEQ2, 2 INT_MOD_SEQ2, "
        "0 EPWM_SOCB_SEQ2"),
    PLAIN("ADCMAXCONV", 0x02u, 0x007Fu, "6-4 MAX_CONV2, 3-0 MAX_CONV1"),
    PLAIN("ADCCHSELSEQ1", 0x03u, 0xFFFFu, "15-12 CONV03, 11-8 CONV02, 7-4 CONV01, 3-0 CONV00"),
    PLAIN("ADCCHSELSEQ2", 0x04u, 0xFFFFu, "15-12 CONV07, 11-8 CONV06, 7-4 CONV05, 3-0 CONV04"),
    PLAIN("ADCCHSELSEQ3", 0x05u, 0xFFFFu, "15-12 CONV11, 11-8 CONV10, 7-4 CONV09, 3-0 CONV08"),
    PLAIN("ADCCHSELSEQ4", 0x06u, 0xFFFFu, "15-12 CONV15, 11-8 CONV14, 7-4 CONV13, 3-0 CONV12"),
    REG("ADCASEQSR", 0x07u, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    RESULT("0", 0x08u),
    RESULT("1", 0x09u),
    RESULT("2", 0x0Au),
    RESULT("3", 0x0Bu),
    RESULT("4", 0x0Cu),
    RESULT("5", 0x0Du),
    RESULT("6", 0x0Eu),
    RESULT("7", 0x0Fu),
    REG("ADCTRL3", 0x18u, 0u, 0x00FFu, HT_FX_ADCTRL3, 0u, 0u,
        "7-6 ADCBGRFDN, 5 ADCPWDN, 4-1 ADCCLKPS, 0 SMODE_SEL"),
    REG("ADCST", 0x19u, 0u, 0x0030u, HT_FX_ADCST, 0u, 0u,
        "7 EOS_BUF2, 6 EOS_BUF1, 3 SEQ2_BSY, 2 SEQ1_BSY, 1 INT_SEQ2, 0 INT_SEQ1"),
    PLAIN("ADCREFSEL", 0x1Cu, 0xC000u, "15-14 REF_SEL"),
    PLAIN("ADCOFFTRIM", 0x1Du, 0x01FFu, "8-0 OFFSET_TRIM"),
};

#define GPIO32(name, offset, reset, what) \
    REG32(name, offset, reset, 0xFFFFFFFFu, what, HT_EALLOWED, 0u, "")
#define PORT(letter, pud)                                \
    GPIO32("GP" letter "CTRL", 0x0u, 0u, HT_PLAIN),      \
        GPIO32("GP" letter "QSEL1", 0x2u, 0u, HT_PLAIN), \
        GPIO32("GP" letter "QSEL2", 0x4u, 0u, HT_PLAIN), \
        GPIO32("GP" letter "MUX1", 0x6u, 0u, HT_FX_MUX), \
        GPIO32("GP" letter "MUX2", 0x8u, 0u, HT_FX_MUX), \
        GPIO32("GP" letter "DIR", 0xAu, 0u, HT_PLAIN),   \
        GPIO32("GP" letter "PUD", 0xCu, pud, HT_PLAIN)

static const ht_register gpio_a[] = {PORT("A", 0x00000FFFu)}; /* no pull-ups on the PWM's pins */
static const ht_register gpio_b[] = {PORT("B", 0u)};

/* Of the pins that are no outputs what is written has no effect on their level. The firmware writes only
 * those that are, as the tests of its pins see. */
#define LEVELS(letter)                                                              \
    {REG32("GP" letter "DAT", 0x0u, 0xFFFFFFFFu, 0u, HT_READ_ONLY, 0u, 0u, ""),     \
     REG32("GP" letter "SET", 0x2u, 0u, 0xFFFFFFFFu, HT_ONES_SET_AT, 0u, 0x0u, ""), \
     REG32("GP" letter "CLEAR", 0x4u, 0u, 0xFFFFFFFFu, HT_ONES_CLEAR_AT, 0u, 0x0u, "")}
static const ht_register data_a[] = LEVELS("A");
static const ht_register data_b[] = LEVELS("B");

#define SYSTEM(name, offset, reset, writable, what, fields) \
    REG(name, offset, reset, writable, what, HT_EALLOWED, 0u, fields)

static const ht_register sys[] = {
    SYSTEM("PLLSTS", 0x01u, 0x0001u, 0x01F4u, HT_FX_PLLSTS,
           "8-7 DIVSEL, 6 MCLKOFF, 5 OSCOFF, 4 MCLKCLR, 3 MCLKSTS, 2 PLLOFF, 0 PLLLOCKS"),
    SYSTEM("HISPCP", 0x0Au, 0x0001u, 0x0007u, HT_PLAIN, "2-0 HSPCLK"),
    SYSTEM("LOSPCP", 0x0Bu, 0x0002u, 0x0007u, HT_PLAIN, "2-0 LSPCLK"),
    SYSTEM("PCLKCR0", 0x0Cu, 0u, 0xFD3Cu, HT_FX_CLOCKS,
           "15 ECANBENCLK, 14 ECANAENCLK, 13 MCBSPBENCLK, 12 MCBSPAENCLK, 11 SCIBENCLK, "
           "10 SCIAENCLK, 8 SPIAENCLK, 5 SCICENCLK, 4 I2CAENCLK, 3 ADCENCLK, 2 TBCLKSYNC"),
    SYSTEM("PCLKCR1", 0x0Du, 0u, 0xFF3Fu, HT_FX_CLOCKS,
           "15 EQEP2ENCLK, 14 EQEP1ENCLK, 13 ECAP6ENCLK, 12 ECAP5ENCLK, 11 ECAP4ENCLK, "
           "10 ECAP3ENCLK, 9 ECAP2ENCLK, 8 ECAP1ENCLK, 5 EPWM6ENCLK, 4 EPWM5ENCLK, 3 EPWM4ENCLK, "
           "2 EPWM3ENCLK, 1 EPWM2ENCLK, 0 EPWM1ENCLK"),
    SYSTEM("PCLKCR3", 0x10u, 0x2700u, 0x3F00u, HT_FX_CLOCKS,
           "13 GPIOINENCLK, 12 XINTFENCLK, 11 DMAENCLK, 10 CPUTIMER2ENCLK, 9 CPUTIMER1ENCLK, "
           "8 CPUTIMER0ENCLK"),
    SYSTEM("PLLCR", 0x11u, 0u, 0x000Fu, HT_FX_PLLCR, "3-0 DIV"),
    SYSTEM("SCSR", 0x12u, 0x0005u, 0x0002u, HT_PLAIN, "2 WDINTS, 1 WDENINT, 0 WDOVERRIDE"),
    SYSTEM("WDCNTR", 0x13u, 0u, 0u, HT_FX_WDCNTR, ""),
    SYSTEM("WDKEY", 0x15u, 0u, 0x00FFu, HT_FX_WDKEY, ""),
    SYSTEM("WDCR", 0x19u, 0u, 0x00FFu, HT_FX_WDCR, "7 WDFLAG, 6 WDDIS, 5-3 WDCHK, 2-0 WDPS"),
};

static const ht_register flash[] = {
    SYSTEM("FOPT", 0x0u, 0u, 0x0001u, HT_PLAIN, "0 ENPIPE"),
    SYSTEM("FPWR", 0x2u, 0u, 0x0003u, HT_PLAIN, "1-0 PWR"),
    SYSTEM("FSTDBYWAIT", 0x4u, 0x01FFu, 0x01FFu, HT_PLAIN, "8-0 STDBYWAIT"),
    SYSTEM("FACTIVEWAIT", 0x5u, 0x01FFu, 0x01FFu, HT_PLAIN, "8-0 ACTIVEWAIT"),
    SYSTEM("FBANKWAIT", 0x6u, 0x0F0Fu, 0x0F0Fu, HT_PLAIN, "11-8 PAGEWAIT, 3-0 RANDWAIT"),
    SYSTEM("FOTPWAIT", 0x7u, 0x001Fu, 0x001Fu, HT_PLAIN, "4-0 OTPWAIT"),
};

static const ht_module modules[] = {
    {"FLASH", 0x0A80u, 0u, 1u, 1u, 0u, 0u, flash, COUNT(flash)},
    {"TIMER0", 0x0C00u, 0u, 1u, 1u, 0x7020u, 8u, ht_registers_timer, HT_TIMER_REGISTERS},
    {"TIMER", 0x0C08u, 8u, 2u, 1u, 0x7020u, 9u, ht_registers_counter, HT_TIMER_REGISTERS},
    {"PIE", 0x0CE0u, 0u, 1u, 1u, 0u, 0u, ht_registers_pie_8, HT_PIE_REGISTERS},
    {"VECTOR", 0x0D00u, 2u, 128u, 0u, 0u, 0u, ht_register_vector, 1u},
    {"EPWM", 0x6800u, 0x40u, 6u, 1u, 0x701Du, 0u, epwm, COUNT(epwm)},
    {"EQEP", 0x6B00u, 0x40u, 2u, 1u, 0x701Du, 14u, ht_registers_eqep, HT_EQEP_REGISTERS},
    {"GPIO", 0x6F80u, 0u, 1u, 1u, 0u, 0u, gpio_a, COUNT(gpio_a)},
    {"GPIO", 0x6F90u, 0u, 1u, 1u, 0u, 0u, gpio_b, COUNT(gpio_b)},
    {"GPIO", 0x6FC0u, 0u, 1u, 1u, 0u, 0u, data_a, COUNT(data_a)},
    {"GPIO", 0x6FC8u, 0u, 1u, 1u, 0u, 0u, data_b, COUNT(data_b)},
    {"SYS", 0x7010u, 0u, 1u, 1u, 0u, 0u, sys, COUNT(sys)},
    {"SCIA", 0x7050u, 0u, 1u, 1u, 0x701Cu, 10u, ht_registers_sci, HT_SCI_REGISTERS},
    {"ADC", 0x7100u, 0u, 1u, 1u, 0x701Cu, 3u, adc, COUNT(adc)},
};

const ht_chip ht_chip_f28335 = {
    .modules = modules,
    .length = COUNT(modules),
    .sync = 0x701Cu,
    .sync_bit = 2u,
    .epwm = 0x6800u,
    .epwm_stride = 0x40u,
    .tzsel = 0x12u,
    .tzctl = 0x14u,
    .tzeint = 0x15u,
    .tzflg = 0x16u,
    .dbctl = 0x0Fu,
    .dbred = 0x10u,
    .dbfed = 0x11u,
    .etsel = 0x19u,
    .etps = 0x1Au,
    .gpio = 0x6F80u,
    .gpio_stride = 0x10u,
    .gpio_data = 0x6FC0u,
    .adc_flag = 0x7119u,
    .adc_settle_us = 5000u,
    .watchdog_Hz = 30.0e6f / 512.0f,
    .pll_multiplier = 0x7021u,
    .internal_oscillators = 0u,
    .crystal_Hz = 30.0e6f,
    .pin_groups = 0u,
    .pwm_pins = 12u,
    .trip_pin = 12u,
    .trips_without_pin = 0u,
    .sequencer = 1u,
    .sci = 0x7050u,
    .adc_cal = 0x380080u,
};
