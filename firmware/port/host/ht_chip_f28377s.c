/* Registers of the F28377S (TMS320F2837xS manual, SPRS881). */
#include "ht_regfile.h"

#define COUNT(table) ((uint16_t)(sizeof(table) / sizeof((table)[0])))
#define PLAIN(name, offset, writable, fields) \
    REG(name, offset, 0u, writable, HT_PLAIN, 0u, 0u, fields)

static const ht_register epwm[] = {
    REG("TBCTL", 0x00u, 0x0083u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u,
        "15-14 FREE_SOFT, 13 PHSDIR, 12-10 CLKDIV, 9-7 HSPCLKDIV, 6 SWFSYNC, 5-4 SYNCOSEL, "
        "3 PRDLD, 2 PHSEN, 1-0 CTRMODE"),
    PLAIN("TBCTL2", 0x01u, 0xF0C0u, "15-14 PRDLDSYNC, 13-12 SYNCOSELX, 7 OSHTSYNC, 6 OSHTSYNCMODE"),
    REG("TBCTR", 0x04u, 0u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    REG("TBSTS", 0x05u, 0x0001u, 0x0006u, HT_ONES_CLEAR, 0u, 0u, "2 CTRMAX, 1 SYNCI, 0 CTRDIR"),
    REG("CMPCTL", 0x08u, 0u, 0x3C5Fu, HT_PLAIN, HT_SET_UP, 0u,
        "13-12 LOADBSYNC, 11-10 LOADASYNC, 9 SHDWBFULL, 8 SHDWAFULL, 6 SHDWBMODE, 4 SHDWAMODE, "
        "3-2 LOADBMODE, 1-0 LOADAMODE"),
    REG("CMPCTL2", 0x09u, 0u, 0x3C5Fu, HT_PLAIN, HT_SET_UP, 0u, ""),
    REG("DBCTL", 0x0Cu, 0u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u,
        "15 HALFCYCLE, 14 DEDB_MODE, 13-12 OUTSWAP, 11 SHDWDBFEDMODE, 10 SHDWDBREDMODE, "
        "9-8 LOADFEDMODE, 7-6 LOADREDMODE, 5-4 IN_MODE, 3-2 POLSEL, 1-0 OUT_MODE"),
    REG("DBCTL2", 0x0Du, 0u, 0x0007u, HT_PLAIN, HT_SET_UP, 0u,
        "2 SHDWDBCTLMODE, 1-0 LOADDBCTLMODE"),
    REG("AQCTL", 0x10u, 0u, 0x0F5Fu, HT_PLAIN, HT_SET_UP, 0u,
        "11-10 LDAQBSYNC, 9-8 LDAQASYNC, 6 SHDWAQBMODE, 4 SHDWAQAMODE, 3-2 LDAQBMODE, 1-0 "
        "LDAQAMODE"),
    PLAIN("AQTSRCSEL", 0x11u, 0x00FFu, ""),
    REG("PCCTL", 0x14u, 0u, 0x07FFu, HT_PLAIN, HT_SET_UP, 0u,
        "10-8 CHPDUTY, 7-5 CHPFREQ, 4-1 OSHTWTH, 0 CHPEN"),
    REG("HRCNFG", 0x20u, 0u, 0x1F1Fu, HT_PLAIN, HT_EALLOWED, 0u, ""),
    REG("GLDCTL", 0x34u, 0u, 0x03BFu, HT_PLAIN, HT_EALLOWED, 0u,
        "12-10 GLDCNT, 9-7 GLDPRD, 5 OSHTMODE, 4-1 GLDMODE, 0 GLD"),
    PLAIN("AQCTLA", 0x40u, 0x0FFFu, "11-10 CBD, 9-8 CBU, 7-6 CAD, 5-4 CAU, 3-2 PRD, 1-0 ZRO"),
    PLAIN("AQCTLA2", 0x41u, 0x00FFu, ""),
    PLAIN("AQCTLB", 0x42u, 0x0FFFu, "11-10 CBD, 9-8 CBU, 7-6 CAD, 5-4 CAU, 3-2 PRD, 1-0 ZRO"),
    PLAIN("AQCTLB2", 0x43u, 0x00FFu, ""),
    PLAIN("AQSFRC", 0x47u, 0x00FFu, "7-6 RLDCSF, 5 OTSFB, 4-3 ACTSFB, 2 OTSFA, 1-0 ACTSFA"),
    PLAIN("AQCSFRC", 0x49u, 0x000Fu, "3-2 CSFB, 1-0 CSFA"),
    PLAIN("DBREDHR", 0x50u, 0xFE00u, ""),
    REG("DBRED", 0x51u, 0u, 0x3FFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    PLAIN("DBFEDHR", 0x52u, 0xFE00u, ""),
    REG("DBFED", 0x53u, 0u, 0x3FFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    PLAIN("TBPHSHR", 0x60u, 0xFFFFu, ""),
    REG("TBPHS", 0x61u, 0u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    PLAIN("TBPRDHR", 0x62u, 0xFFFFu, ""),
    REG("TBPRD", 0x63u, 0u, 0xFFFFu, HT_PLAIN, HT_SET_UP, 0u, ""),
    PLAIN("CMPAHR", 0x6Au, 0xFFFFu, ""),
    PLAIN("CMPA", 0x6Bu, 0xFFFFu, ""),
    PLAIN("CMPBHR", 0x6Cu, 0xFFFFu, ""),
    PLAIN("CMPB", 0x6Du, 0xFFFFu, ""),
    PLAIN("CMPC", 0x6Fu, 0xFFFFu, ""),
    PLAIN("CMPD", 0x71u, 0xFFFFu, ""),
    REG("TZSEL", 0x80u, 0u, 0xFFFFu, HT_PLAIN, HT_EALLOWED | HT_SET_UP, 0u,
        "15 DCBEVT1, 14 DCAEVT1, 13 OSHT6, 12 OSHT5, 11 OSHT4, 10 OSHT3, 9 OSHT2, 8 OSHT1, "
        "7 DCBEVT2, 6 DCAEVT2, 5 CBC6, 4 CBC5, 3 CBC4, 2 CBC3, 1 CBC2, 0 CBC1"),
    REG("TZDCSEL", 0x82u, 0u, 0x0FFFu, HT_PLAIN, HT_EALLOWED, 0u,
        "11-9 DCBEVT2, 8-6 DCBEVT1, 5-3 DCAEVT2, 2-0 DCAEVT1"),
    REG("TZCTL", 0x84u, 0u, 0x0FFFu, HT_PLAIN, HT_EALLOWED | HT_TRIP_ACTION, 0u,
        "11-10 DCBEVT2, 9-8 DCBEVT1, 7-6 DCAEVT2, 5-4 DCAEVT1, 3-2 TZB, 1-0 TZA"),
    REG("TZCTL2", 0x85u, 0u, 0x8FFFu, HT_PLAIN, HT_EALLOWED | HT_TRIP_SET_UP, 0u, ""),
    REG("TZEINT", 0x8Du, 0u, 0x007Eu, HT_PLAIN, HT_EALLOWED, 0u,
        "6 DCBEVT2, 5 DCBEVT1, 4 DCAEVT2, 3 DCAEVT1, 2 OST, 1 CBC"),
    REG("TZFLG", 0x93u, 0u, 0u, HT_READ_ONLY, 0u, 0u,
        "6 DCBEVT2, 5 DCBEVT1, 4 DCAEVT2, 3 DCAEVT1, 2 OST, 1 CBC, 0 INT"),
    REG("TZCBCFLG", 0x94u, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("TZOSTFLG", 0x95u, 0u, 0u, HT_READ_ONLY, 0u, 0u,
        "7 DCBEVT1, 6 DCAEVT1, 5 OST6, 4 OST5, 0 OST1"),
    REG("TZCLR", 0x97u, 0u, 0x007Fu, HT_ONES_CLEAR_AT, HT_EALLOWED, 0x93u, ""),
    REG("TZCBCCLR", 0x98u, 0u, 0x00FFu, HT_ONES_CLEAR_AT, HT_EALLOWED, 0x94u, ""),
    REG("TZOSTCLR", 0x99u, 0u, 0x00FFu, HT_ONES_CLEAR_AT, HT_EALLOWED, 0x95u, ""),
    REG("TZFRC", 0x9Bu, 0u, 0x007Eu, HT_ONES_SET_AT, HT_EALLOWED, 0x93u, ""),
    PLAIN("ETSEL", 0xA4u, 0xFF7Fu,
          "15 SOCBEN, 14-12 SOCBSEL, 11 SOCAEN, 10-8 SOCASEL, 6 INTSELCMP, 5 SOCBSELCMP, "
          "4 SOCASELCMP, 3 INTEN, 2-0 INTSEL"),
    PLAIN("ETPS", 0xA6u, 0x3333u,
          "15-14 SOCBCNT, 13-12 SOCBPRD, 11-10 SOCACNT, 9-8 SOCAPRD, 5 SOCPSSEL, 4 INTPSSEL, "
          "3-2 INTCNT, 1-0 INTPRD"),
    REG("ETFLG", 0xA8u, 0u, 0u, HT_READ_ONLY, 0u, 0u, "3 SOCB, 2 SOCA, 0 INT"),
    REG("ETCLR", 0xAAu, 0u, 0x000Du, HT_ONES_CLEAR_AT, 0u, 0xA8u, ""),
    REG("ETFRC", 0xACu, 0u, 0x000Du, HT_ONES_SET_AT, 0u, 0xA8u, ""),
    PLAIN("ETINTPS", 0xAEu, 0x000Fu, ""),
    PLAIN("ETSOCPS", 0xB0u, 0x0F0Fu, ""),
    REG("DCTRIPSEL", 0xC0u, 0u, 0xFFFFu, HT_PLAIN, HT_EALLOWED, 0u,
        "15-12 DCBLCOMPSEL, 11-8 DCBHCOMPSEL, 7-4 DCALCOMPSEL, 3-0 DCAHCOMPSEL"),
    REG("DCACTL", 0xC3u, 0u, 0x030Fu, HT_PLAIN, HT_EALLOWED, 0u,
        "9 EVT2FRCSYNCSEL, 8 EVT2SRCSEL, 3 EVT1SYNCE, 2 EVT1SOCE, 1 EVT1FRCSYNCSEL, 0 EVT1SRCSEL"),
    REG("DCBCTL", 0xC4u, 0u, 0x030Fu, HT_PLAIN, HT_EALLOWED, 0u,
        "9 EVT2FRCSYNCSEL, 8 EVT2SRCSEL, 3 EVT1SYNCE, 2 EVT1SOCE, 1 EVT1FRCSYNCSEL, 0 EVT1SRCSEL"),
};

#define PROTECTED(name, offset, writable, fields) \
    REG(name, offset, 0u, writable, HT_PLAIN, HT_EALLOWED, 0u, fields)
#define SOC(n, offset)                                                          \
    REG32("ADCSOC" n "CTL", offset, 0u, 0x01F781FFu, HT_PLAIN, HT_EALLOWED, 0u, \
          "24-20 TRIGSEL, 18-15 CHSEL, 8-0 ACQPS")
#define TRIM(n, offset) \
    REG32("ADCINLTRIM" n, offset, 0u, 0xFFFFFFFFu, HT_PLAIN, HT_EALLOWED, 0u, "")

static const ht_register adc[] = {
    REG("ADCCTL1", 0x00u, 0u, 0x0084u, HT_FX_ADCCTL1, HT_EALLOWED, 0u,
        "13 ADCBSY, 11-8 ADCBSYCHN, 7 ADCPWDNZ, 2 INTPULSEPOS"),
    PROTECTED("ADCCTL2", 0x01u, 0x00CFu, "7 SIGNALMODE, 6 RESOLUTION, 3-0 PRESCALE"),
    PROTECTED("ADCBURSTCTL", 0x02u, 0x8F3Fu, ""),
    REG("ADCINTFLG", 0x03u, 0u, 0u, HT_READ_ONLY, 0u, 0u,
        "3 ADCINT4, 2 ADCINT3, 1 ADCINT2, 0 ADCINT1"),
    REG("ADCINTFLGCLR", 0x04u, 0u, 0x000Fu, HT_FX_ADCINTFLGCLR, 0u, 0x03u, ""),
    REG("ADCINTOVF", 0x05u, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("ADCINTOVFCLR", 0x06u, 0u, 0x000Fu, HT_ONES_CLEAR_AT, 0u, 0x05u, ""),
    PROTECTED("ADCINTSEL1N2", 0x07u, 0x6F6Fu,
              "14 INT2CONT, 13 INT2E, 11-8 INT2SEL, 6 INT1CONT, 5 INT1E, 3-0 INT1SEL"),
    PROTECTED("ADCINTSEL3N4", 0x08u, 0x6F6Fu, ""),
    REG("ADCSOCPRICTL", 0x09u, 0x0200u, 0x001Fu, HT_PLAIN, HT_EALLOWED, 0u,
        "9-5 RRPOINTER, 4-0 SOCPRIORITY"),
    PROTECTED("ADCINTSOCSEL1", 0x0Au, 0xFFFFu, ""),
    PROTECTED("ADCINTSOCSEL2", 0x0Bu, 0xFFFFu, ""),
    SOC("0", 0x10u),
    SOC("1", 0x12u),
    SOC("2", 0x14u),
    SOC("3", 0x16u),
    SOC("4", 0x18u),
    SOC("5", 0x1Au),
    SOC("6", 0x1Cu),
    SOC("7", 0x1Eu),
    PROTECTED("ADCOFFTRIM", 0x3Bu, 0x00FFu, "7-0 OFFTRIM"),
    TRIM("1", 0x70u),
    TRIM("2", 0x72u),
    TRIM("3", 0x74u),
    TRIM("4", 0x76u),
    TRIM("5", 0x78u),
    TRIM("6", 0x7Au),
};

#define RESULT(n, offset) REG("ADCRESULT" n, offset, 0u, 0u, HT_READ_ONLY, 0u, 0u, "")

static const ht_register adc_result[] = {
    RESULT("0", 0x0u), RESULT("1", 0x1u), RESULT("2", 0x2u), RESULT("3", 0x3u),
    RESULT("4", 0x4u), RESULT("5", 0x5u), RESULT("6", 0x6u), RESULT("7", 0x7u),
};

/* The word that tells whether a function of TI's has been programmed. */
static const ht_register otp[] = {
    REG("OFFSET_TRIM", 0x0u, 0x7632u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("INL_TRIM_B", 0x6u, 0x7632u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("INL_TRIM_A", 0x8u, 0x7632u, 0u, HT_READ_ONLY, 0u, 0u, ""),
};

static const ht_register xbar[] = {
    PROTECTED("INPUT1SELECT", 0x0u, 0xFFFFu, ""), PROTECTED("INPUT2SELECT", 0x1u, 0xFFFFu, ""),
    PROTECTED("INPUT3SELECT", 0x2u, 0xFFFFu, ""), PROTECTED("INPUT4SELECT", 0x3u, 0xFFFFu, ""),
    PROTECTED("INPUT5SELECT", 0x4u, 0xFFFFu, ""), PROTECTED("INPUT6SELECT", 0x5u, 0xFFFFu, ""),
};

/* The multiplexers of TRIP4, 5, 7 ... 12 that feed the digital compare of all ePWM modules. */
#define TRIP(n, offset)                                                                            \
    REG32("TRIP" n "MUX0TO15CFG", offset, 0u, 0xFFFFFFFFu, HT_PLAIN, HT_EALLOWED, 0u, "1-0 MUX0"), \
        REG32("TRIP" n "MUX16TO31CFG", (offset) + 2u, 0u, 0xFFFFFFFFu, HT_PLAIN, HT_EALLOWED, 0u,  \
              "")

static const ht_register epwm_xbar[] = {
    TRIP("4", 0x00u),
    TRIP("5", 0x04u),
    REG32("TRIP4MUXENABLE", 0x20u, 0u, 0xFFFFFFFFu, HT_PLAIN, HT_EALLOWED, 0u, "0 MUX0"),
    REG32("TRIP5MUXENABLE", 0x22u, 0u, 0xFFFFFFFFu, HT_PLAIN, HT_EALLOWED, 0u, "0 MUX0"),
    REG32("TRIPOUTINV", 0x38u, 0u, 0x000000FFu, HT_PLAIN, HT_EALLOWED, 0u, ""),
};

static const ht_register ecap[] = {
    REG32("TSCTR", 0x00u, 0u, 0xFFFFFFFFu, HT_FX_TSCTR, 0u, 0u, ""),
    REG32("CTRPHS", 0x02u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("CAP1", 0x04u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("CAP2", 0x06u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("CAP3", 0x08u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("CAP4", 0x0Au, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    PLAIN("ECCTL1", 0x14u, 0xFFFFu, "15-14 FREE_SOFT, 13-9 PRESCALE, 8 CAPLDEN"),
    REG("ECCTL2", 0x15u, 0x0006u, 0x07FFu, HT_FX_TSCTR, 0u, 0u,
        "10 APWMPOL, 9 CAP_APWM, 8 SWSYNC, 7-6 SYNCO_SEL, 5 SYNCI_EN, 4 TSCTRSTOP, 3 REARM, "
        "2-1 STOP_WRAP, 0 CONT_ONESHT"),
    PLAIN("ECEINT", 0x16u, 0x00FEu, ""),
    REG("ECFLG", 0x17u, 0u, 0u, HT_READ_ONLY, 0u, 0u, "7 CTR_CMP, 6 CTR_PRD, 5 CTROVF, 0 INT"),
    REG("ECCLR", 0x18u, 0u, 0x00FFu, HT_ONES_CLEAR_AT, 0u, 0x17u, ""),
    REG("ECFRC", 0x19u, 0u, 0x00FEu, HT_ONES_SET_AT, 0u, 0x17u, ""),
};

static const ht_register cmpss[] = {
    PROTECTED("COMPCTL", 0x00u, 0xFF7Fu,
              "15 COMPDACE, 14 ASYNCLEN, 13-12 CTRIPOUTLSEL, 11-10 CTRIPLSEL, 9 COMPLINV, "
              "8 COMPLSOURCE, 6 ASYNCHEN, 5-4 CTRIPOUTHSEL, 3-2 CTRIPHSEL, 1 COMPHINV, "
              "0 COMPHSOURCE"),
    PROTECTED("COMPHYSCTL", 0x01u, 0x000Fu, "3-0 COMPHYS"),
    REG("COMPSTS", 0x02u, 0u, 0u, HT_READ_ONLY, 0u, 0u,
        "9 COMPLLATCH, 8 COMPLSTS, 1 COMPHLATCH, 0 COMPHSTS"),
    REG("COMPSTSCLR", 0x03u, 0u, 0x0202u, HT_ONES_CLEAR_AT, HT_EALLOWED, 0x02u, ""),
    PROTECTED("COMPDACCTL", 0x04u, 0xC0FFu,
              "15-14 FREESOFT, 7 SWLOADSEL, 6 RAMPLOADSEL, 5 SELREF, 4-1 RAMPSOURCE, 0 DACSOURCE"),
    PLAIN("DACHVALS", 0x06u, 0x0FFFu, ""),
    PLAIN("DACLVALS", 0x12u, 0x0FFFu, ""),
    PROTECTED("CTRIPLFILCTL", 0x16u, 0xBFF0u, "15 FILINIT, 13-9 THRESH, 8-4 SAMPWIN"),
    PROTECTED("CTRIPLFILCLKCTL", 0x17u, 0x03FFu, "9-0 CLKPRESCALE"),
    PROTECTED("CTRIPHFILCTL", 0x18u, 0xBFF0u, "15 FILINIT, 13-9 THRESH, 8-4 SAMPWIN"),
    PROTECTED("CTRIPHFILCLKCTL", 0x19u, 0x03FFu, "9-0 CLKPRESCALE"),
};

static const ht_register sync[] = {
    REG32("SYNCSELECT", 0x0u, 0u, 0x18007FFFu, HT_PLAIN, HT_EALLOWED, 0u,
          "28-27 SYNCOUT, 8-6 EPWM10SYNCIN, 5-3 EPWM7SYNCIN, 2-0 EPWM4SYNCIN"),
};

#define GPIO32(name, offset, reset, what) \
    REG32(name, offset, reset, 0xFFFFFFFFu, what, HT_EALLOWED, 0u, "")
#define PORT(letter)                                             \
    GPIO32("GP" letter "CTRL", 0x00u, 0u, HT_PLAIN),             \
        GPIO32("GP" letter "QSEL1", 0x02u, 0u, HT_PLAIN),        \
        GPIO32("GP" letter "QSEL2", 0x04u, 0u, HT_PLAIN),        \
        GPIO32("GP" letter "MUX1", 0x06u, 0u, HT_FX_MUX),        \
        GPIO32("GP" letter "MUX2", 0x08u, 0u, HT_FX_MUX),        \
        GPIO32("GP" letter "DIR", 0x0Au, 0u, HT_PLAIN),          \
        GPIO32("GP" letter "PUD", 0x0Cu, 0xFFFFFFFFu, HT_PLAIN), \
        GPIO32("GP" letter "INV", 0x10u, 0u, HT_PLAIN),          \
        GPIO32("GP" letter "ODR", 0x12u, 0u, HT_PLAIN),          \
        GPIO32("GP" letter "GMUX1", 0x20u, 0u, HT_FX_GMUX),      \
        GPIO32("GP" letter "GMUX2", 0x22u, 0u, HT_FX_GMUX)

static const ht_register gpio_a[] = {PORT("A")};
static const ht_register gpio_b[] = {PORT("B")};
static const ht_register gpio_c[] = {PORT("C")};
static const ht_register gpio_d[] = {PORT("D")};
static const ht_register gpio_e[] = {PORT("E")};
static const ht_register gpio_f[] = {PORT("F")};

/* Of the pins that are no outputs what is written has no effect on their level. The firmware writes only
 * those that are, as the tests of its pins see. */
#define LEVELS(letter)                                                              \
    {REG32("GP" letter "DAT", 0x0u, 0xFFFFFFFFu, 0u, HT_READ_ONLY, 0u, 0u, ""),     \
     REG32("GP" letter "SET", 0x2u, 0u, 0xFFFFFFFFu, HT_ONES_SET_AT, 0u, 0x0u, ""), \
     REG32("GP" letter "CLEAR", 0x4u, 0u, 0xFFFFFFFFu, HT_ONES_CLEAR_AT, 0u, 0x0u, "")}
static const ht_register data_a[] = LEVELS("A");
static const ht_register data_b[] = LEVELS("B");
static const ht_register data_c[] = LEVELS("C");

static const ht_register wd[] = {
    REG("SCSR", 0x22u, 0x0005u, 0x0002u, HT_PLAIN, HT_EALLOWED, 0u,
        "2 WDINTS, 1 WDENINT, 0 WDOVERRIDE"),
    REG("WDCNTR", 0x23u, 0u, 0u, HT_FX_WDCNTR, HT_EALLOWED, 0u, ""),
    REG("WDKEY", 0x25u, 0u, 0x00FFu, HT_FX_WDKEY, HT_EALLOWED, 0u, ""),
    REG("WDCR", 0x29u, 0u, 0x007Fu, HT_FX_WDCR, HT_EALLOWED, 0u, "6 WDDIS, 5-3 WDCHK, 2-0 WDPS"),
    REG("WDWCR", 0x2Au, 0u, 0x00FFu, HT_PLAIN, HT_EALLOWED, 0u, "8 FIRSTKEY, 7-0 MIN"),
};

#define CLOCK(name, offset, reset, writable, what, fields) \
    REG32(name, offset, reset, writable, what, HT_EALLOWED, 0u, fields)

static const ht_register clkcfg[] = {
    CLOCK("CLKSRCCTL1", 0x08u, 0u, 0x0000003Bu, HT_FX_OSCSEL,
          "5 WDHALTI, 4 XTALOFF, 3 INTOSC2OFF, 1-0 OSCCLKSRCSEL"),
    CLOCK("SYSPLLCTL1", 0x0Eu, 0u, 0x00000003u, HT_FX_PLLCTL, "1 PLLCLKEN, 0 PLLEN"),
    CLOCK("SYSPLLMULT", 0x14u, 0u, 0x0000037Fu, HT_FX_PLLMULT, "9-8 FMULT, 6-0 IMULT"),
    CLOCK("SYSPLLSTS", 0x16u, 0u, 0u, HT_FX_PLLLOCK, "1 SLIPS, 0 LOCKS"),
    CLOCK("SYSCLKDIVSEL", 0x22u, 0u, 0x0000003Fu, HT_PLAIN, "5-0 PLLSYSCLKDIV"),
    CLOCK("PERCLKDIVSEL", 0x26u, 0x00000051u, 0x00000053u, HT_PLAIN,
          "6 EMIF2CLKDIV, 4 EMIF1CLKDIV, 1-0 EPWMCLKDIV"),
    CLOCK("LOSPCP", 0x2Cu, 0x00000002u, 0x00000007u, HT_PLAIN, "2-0 LSPCLKDIV"),
    CLOCK("MCDCR", 0x2Eu, 0u, 0x0000000Eu, HT_FX_MCDCR,
          "3 OSCOFF, 2 MCLKOFF, 1 MCLKCLR, 0 MCLKSTS"),
};

static const ht_register cpusys[] = {
    CLOCK("PCLKCR0", 0x22u, 0x00000038u, 0x0005003Du, HT_FX_CLOCKS,
          "18 TBCLKSYNC, 16 HRPWM, 5 CPUTIMER2, 4 CPUTIMER1, 3 CPUTIMER0, 2 DMA, 0 CLA1"),
    CLOCK("PCLKCR1", 0x24u, 0u, 0x00000003u, HT_FX_CLOCKS, "1 EMIF2, 0 EMIF1"),
    CLOCK("PCLKCR2", 0x26u, 0u, 0x00000FFFu, HT_FX_CLOCKS,
          "11 EPWM12, 10 EPWM11, 9 EPWM10, 8 EPWM9, 7 EPWM8, 6 EPWM7, 5 EPWM6, 4 EPWM5, 3 EPWM4, "
          "2 EPWM3, 1 EPWM2, 0 EPWM1"),
    CLOCK("PCLKCR3", 0x28u, 0u, 0x0000003Fu, HT_FX_CLOCKS,
          "5 ECAP6, 4 ECAP5, 3 ECAP4, 2 ECAP3, 1 ECAP2, 0 ECAP1"),
    CLOCK("PCLKCR4", 0x2Au, 0u, 0x00000007u, HT_FX_CLOCKS, "2 EQEP3, 1 EQEP2, 0 EQEP1"),
    CLOCK("PCLKCR7", 0x30u, 0u, 0x0000000Fu, HT_FX_CLOCKS, "3 SCI_D, 2 SCI_C, 1 SCI_B, 0 SCI_A"),
    CLOCK("PCLKCR13", 0x3Cu, 0u, 0x0000000Fu, HT_FX_CLOCKS, "3 ADC_D, 2 ADC_C, 1 ADC_B, 0 ADC_A"),
    CLOCK("PCLKCR14", 0x3Eu, 0u, 0x000000FFu, HT_FX_CLOCKS,
          "7 CMPSS8, 6 CMPSS7, 5 CMPSS6, 4 CMPSS5, 3 CMPSS4, 2 CMPSS3, 1 CMPSS2, 0 CMPSS1"),
    CLOCK("TMR2CLKCTL", 0x7Cu, 0u, 0x0000003Fu, HT_PLAIN, "5-3 TMR2CLKPRESCALE, 2-0 TMR2CLKSRCSEL"),
    CLOCK("RESC", 0x80u, 0x00000003u, 0x0000016Fu, HT_ONES_CLEAR,
          "8 SCCRESETN, 6 HIBRESETN, 5 HWBISTN, 3 NMIWDRSN, 2 WDRSN, 1 XRSN, 0 POR"),
};

static const ht_register flash[] = {
    CLOCK("FRDCNTL", 0x000u, 0x00000F00u, 0x00000F00u, HT_FX_RWAIT, "11-8 RWAIT"),
    CLOCK("FBAC", 0x01Eu, 0x0000000Fu, 0x000000FFu, HT_FX_FLASH, "7-0 VREADST"),
    CLOCK("FBFALLBACK", 0x020u, 0u, 0x00000003u, HT_FX_FLASH, "1-0 BNKPWR0"),
    CLOCK("FPAC1", 0x024u, 0x00C80000u, 0x0FFF0001u, HT_FX_FLASH, "27-16 PSLEEP, 0 PMPPWR"),
    CLOCK("FRD_INTF_CTRL", 0x180u, 0u, 0x00000003u, HT_FX_FLASH, "1 DATA_CACHE_EN, 0 PREFETCH_EN"),
};

static const ht_register ecc[] = {
    CLOCK("ECC_ENABLE", 0x0u, 0x0000000Au, 0x0000000Fu, HT_FX_FLASH, "3-0 ENABLE"),
};

static const ht_register pump[] = {
    CLOCK("PUMPREQUEST", 0x0u, 0u, 0xFFFF0003u, HT_FX_PUMP, "1-0 PUMP_OWNERSHIP"),
};

static const ht_module modules[] = {
    {"ADCA", 0x0B00u, 0u, 1u, 1u, 0x5D33Cu, 0u, adc_result, COUNT(adc_result)},
    {"ADCB", 0x0B20u, 0u, 1u, 1u, 0x5D33Cu, 1u, adc_result, COUNT(adc_result)},
    {"TIMER0", 0x0C00u, 0u, 1u, 1u, 0x5D322u, 3u, ht_registers_timer, HT_TIMER_REGISTERS},
    {"TIMER", 0x0C08u, 8u, 2u, 1u, 0x5D322u, 4u, ht_registers_counter, HT_TIMER_REGISTERS},
    {"PIE", 0x0CE0u, 0u, 1u, 1u, 0u, 0u, ht_registers_pie_16, HT_PIE_REGISTERS},
    {"VECTOR", 0x0D00u, 2u, 224u, 0u, 0u, 0u, ht_register_vector, 1u},
    {"EPWM", 0x4000u, 0x100u, 12u, 1u, 0x5D326u, 0u, epwm, COUNT(epwm)},
    {"ECAP1", 0x5000u, 0u, 1u, 1u, 0x5D328u, 0u, ecap, COUNT(ecap)},
    {"EQEP", 0x5100u, 0x40u, 3u, 1u, 0x5D32Au, 0u, ht_registers_eqep, HT_EQEP_REGISTERS},
    {"CMPSS", 0x5C80u, 0x20u, 8u, 1u, 0x5D33Eu, 0u, cmpss, COUNT(cmpss)},
    {"WD", 0x7000u, 0u, 1u, 1u, 0u, 0u, wd, COUNT(wd)},
    {"SCIA", 0x7200u, 0u, 1u, 1u, 0x5D330u, 0u, ht_registers_sci, HT_SCI_REGISTERS},
    {"ADCA", 0x7400u, 0u, 1u, 1u, 0x5D33Cu, 0u, adc, COUNT(adc)},
    {"ADCB", 0x7480u, 0u, 1u, 1u, 0x5D33Cu, 1u, adc, COUNT(adc)},
    {"INPUTXBAR", 0x7900u, 0u, 1u, 1u, 0u, 0u, xbar, COUNT(xbar)},
    {"SYNCSOC", 0x7940u, 0u, 1u, 1u, 0u, 0u, sync, COUNT(sync)},
    {"EPWMXBAR", 0x7A00u, 0u, 1u, 1u, 0u, 0u, epwm_xbar, COUNT(epwm_xbar)},
    {"GPIO", 0x7C00u, 0u, 1u, 1u, 0u, 0u, gpio_a, COUNT(gpio_a)},
    {"GPIO", 0x7C40u, 0u, 1u, 1u, 0u, 0u, gpio_b, COUNT(gpio_b)},
    {"GPIO", 0x7C80u, 0u, 1u, 1u, 0u, 0u, gpio_c, COUNT(gpio_c)},
    {"GPIO", 0x7CC0u, 0u, 1u, 1u, 0u, 0u, gpio_d, COUNT(gpio_d)},
    {"GPIO", 0x7D00u, 0u, 1u, 1u, 0u, 0u, gpio_e, COUNT(gpio_e)},
    {"GPIO", 0x7D40u, 0u, 1u, 1u, 0u, 0u, gpio_f, COUNT(gpio_f)},
    {"GPIO", 0x7F00u, 0u, 1u, 1u, 0u, 0u, data_a, COUNT(data_a)},
    {"GPIO", 0x7F08u, 0u, 1u, 1u, 0u, 0u, data_b, COUNT(data_b)},
    {"GPIO", 0x7F10u, 0u, 1u, 1u, 0u, 0u, data_c, COUNT(data_c)},
    {"PUMP", 0x50024u, 0u, 1u, 1u, 0u, 0u, pump, COUNT(pump)},
    {"CLKCFG", 0x5D200u, 0u, 1u, 1u, 0u, 0u, clkcfg, COUNT(clkcfg)},
    {"CPUSYS", 0x5D300u, 0u, 1u, 1u, 0u, 0u, cpusys, COUNT(cpusys)},
    {"FLASH0", 0x5F800u, 0u, 1u, 1u, 0u, 0u, flash, COUNT(flash)},
    {"FLASH0", 0x5FB00u, 0u, 1u, 1u, 0u, 0u, ecc, COUNT(ecc)},
    {"OTP", 0x703ACu, 0u, 1u, 1u, 0u, 0u, otp, COUNT(otp)},
};

const ht_chip ht_chip_f28377s = {
    .modules = modules,
    .length = COUNT(modules),
    .sync = 0x5D322u,
    .sync_bit = 18u,
    .epwm = 0x4000u,
    .epwm_stride = 0x100u,
    .tzsel = 0x80u,
    .tzctl = 0x84u,
    .tzeint = 0x8Du,
    .tzflg = 0x93u,
    .dbctl = 0x0Cu,
    .dbred = 0x51u,
    .dbfed = 0x53u,
    .etsel = 0xA4u,
    .etps = 0xA6u,
    .gpio = 0x7C00u,
    .gpio_stride = 0x40u,
    .gpio_data = 0x7F00u,
    .adc_flag = 0x7403u,
    .adc_settle_us = 500u,
    .watchdog_Hz = 10.0e6f / 512.0f,
    .pll_multiplier = 0x5D214u,
    .internal_oscillators = 1u,
    .crystal_pll_Hz = 400.0e6f,
    .first_crystal_Hz = 20.0e6f,
    .pin_groups = 1u,
    .pwm_pins = 16u,
    .pwm_pins_group = 22u,
    .trip_select = 0x7900u,
    .trips_without_pin = 1u,
    .sequencer = 0u,
    .ecap = 0x5000u,
    .cmpss = 0x5C80u,
    .sci = 0x7200u,
    .device_cal = HT_REGFILE_DEVICE_CAL,
    .linearity_trim = {0x0703B4u, 0x0703B2u},
    .offset_trim = 0x0703ACu,
};
