/** @file ht_c2000_map.h
 *  The registers we use, as word addresses, for both devices. Names are TI's.
 *  Sources: TMS320x2833x and TMS320F2837xS technical reference manuals (ePWM,
 *  ADC, eQEP, PIE, system control chapters).
 */
#ifndef HT_C2000_MAP_H
#define HT_C2000_MAP_H

#include <stdbool.h>
#include <stdint.h>

/** Where one device keeps things. `epwm` + leg * `stride` + offset addresses a
 *  PWM register of a leg (leg 0 = ePWM1). An offset of 0xFFFF = not present. */
typedef struct {
    uint32_t epwm;
    uint16_t stride;
    uint16_t tbctl;
    uint16_t tbctr;
    uint16_t tbprd;
    uint16_t tbphs;
    uint16_t cmpctl;
    uint16_t cmpa;
    uint16_t cmpb;
    uint16_t aqctl;
    uint16_t aqctla;
    uint16_t aqsfrc;
    uint16_t aqcsfrc;
    uint16_t dbctl;
    uint16_t dbred;
    uint16_t dbfed;
    uint16_t tzsel;
    uint16_t tzctl;
    uint16_t tzeint;
    uint16_t tzflg;
    uint16_t tzclr;
    uint16_t tzfrc;
    uint16_t etsel;
    uint16_t etps;
    uint16_t etflg;
    uint16_t etclr;
    uint32_t adc_result;      /**< seven consecutive results */
    uint16_t adc_shift;       /**< right shift to 12-bit counts */
    uint32_t eqep;            /**< eQEP1; EQEP_... are offsets from here */
    uint32_t pieack;
    uint32_t pclk_epwm;       /**< clock enables of ePWM1..6, bits 0..5 */
    uint32_t pclk_eqep;
    uint16_t eqep_bit;        /**< clock enable of eQEP1 in the word at pclk_eqep */
    uint32_t pclk_tbsync;
    uint16_t tbsync_bit;      /**< within the word at pclk_tbsync */
    uint32_t perclkdivsel;    /**< 0 = not present */
    uint16_t dead_max_counts;
    float pwm_clock_Hz;
    float system_clock_Hz;    /**< SYSCLKOUT, clocks the eQEP */
} ht_c2000_map;

extern const ht_c2000_map ht_f28335;
extern const ht_c2000_map ht_f28377s;

/* TBCTL */
#define TBCTL_FREE_RUN 0x8000u
#define TBCTL_SYNCOSEL_CTR0 0x0010u
#define TBCTL_PHSEN 0x0004u
/* CMPCTL: load on counter = 0 is the reset state */
#define CMPCTL_SHDWAMODE_IMMEDIATE 0x0010u
#define CMPCTL_SHDWBMODE_IMMEDIATE 0x0040u
/* AQCTL (type 4): shadow AQCTLA, load on counter = period */
#define AQCTL_SHDWAQAMODE 0x0010u
#define AQCTL_LDAQAMODE_PRD 0x0001u
/* AQCTLA fields: 0 nothing, 1 clear, 2 set, 3 toggle */
#define AQ_ZRO_CLEAR 0x0001u
#define AQ_ZRO_SET 0x0002u
#define AQ_CAU_TOGGLE 0x0030u
#define AQ_CBU_TOGGLE 0x0300u
/* AQSFRC: one-shot force of output A */
#define AQSFRC_OTSFA 0x0004u
#define AQSFRC_ACTSFA_CLEAR 0x0001u
#define AQSFRC_ACTSFA_SET 0x0002u
/* DBCTL: A source for both, B inverted, both delays on */
#define DBCTL_COMPLEMENTARY 0x000Bu
/* TZ */
#define TZSEL_OSHT1 0x0100u
#define TZCTL_BOTH_LOW 0x000Au
#define TZ_OST 0x0004u
#define TZ_INT 0x0001u
/* ET */
#define ETSEL_INT_CTR0 0x0009u  /* INTEN, INTSEL = counter 0 */
#define ETSEL_SOCA_CTR0 0x0900u /* SOCAEN, SOCASEL = counter 0 */
#define ETPS_EVERY 0x0101u
#define ET_INT 0x0001u
#define PIEACK_GROUP3 0x0004u
/* eQEP: the same offsets on both devices */
#define EQEP_QPOSCNT 0x00u /* 32 bits */
#define EQEP_QPOSMAX 0x04u /* 32 bits */
#define EQEP_QPOSILAT 0x08u /* three 32-bit latches from here */
#define EQEP_QUTMR 0x0Eu
#define EQEP_QDECCTL 0x14u
#define EQEP_QEPCTL 0x15u
#define EQEP_QCAPCTL 0x16u
#define EQEP_QFLG 0x19u
#define EQEP_QEPSTS 0x1Cu
#define EQEP_QCTMR 0x1Du
#define EQEP_QCPRD 0x1Eu
#define EQEP_QCTMRLAT 0x1Fu
#define EQEP_QCPRDLAT 0x20u
#define EQEP_WORDS 0x21u
/* QEPCTL: run on under the debugger, reset at QPOSMAX, counter enabled */
#define QEPCTL_FREE_RUN 0x8000u
#define QEPCTL_PCRM_MAX 0x1000u
#define QEPCTL_QPEN 0x0008u
/* QCAPCTL: CCPS divides SYSCLKOUT by 2^CCPS, UPPS makes every 2^UPPS-th edge a unit event */
#define QCAPCTL_CEN 0x8000u
#define QCAPCTL_CCPS_128 0x0070u
#define QCAPCTL_UPPS_4 0x0002u
#define CAPTURE_CLOCK_DIVIDER 128.0f
/* QEPSTS */
#define QEPSTS_UPEVNT 0x0080u
#define QEPSTS_QDF 0x0020u  /* 1 = forward */
#define QEPSTS_COEF 0x0008u
#define QEPSTS_CDEF 0x0004u
#define QEPSTS_FIMF 0x0002u
/* PERCLKDIVSEL.EPWMCLKDIV: 1 = /2 */
#define PERCLKDIVSEL_EPWM_DIV2 0x0001u
#define PERCLKDIVSEL_EPWM_MASK 0x0003u

#endif
