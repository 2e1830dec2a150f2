/* Registers that both chips have at the same offsets. */
#include "ht_registers.h"

const ht_register ht_registers_eqep[HT_EQEP_REGISTERS] = {
    REG32("QPOSCNT", 0x00u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("QPOSINIT", 0x02u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("QPOSMAX", 0x04u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("QPOSCMP", 0x06u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("QPOSILAT", 0x08u, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG32("QPOSSLAT", 0x0Au, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG32("QPOSLAT", 0x0Cu, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG32("QUTMR", 0x0Eu, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("QUPRD", 0x10u, 0u, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG("QWDTMR", 0x12u, 0u, 0xFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG("QWDPRD", 0x13u, 0u, 0xFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG("QDECCTL", 0x14u, 0u, 0xFFE0u, HT_PLAIN, 0u, 0u,
        "15-14 QSRC, 13 SOEN, 12 SPSEL, 11 XCR, 10 SWAP, 9 IGATE, 8 QAP, 7 QBP, 6 QIP, 5 QSP"),
    REG("QEPCTL", 0x15u, 0u, 0xFFFFu, HT_PLAIN, 0u, 0u,
        "15-14 FREE_SOFT, 13-12 PCRM, 11-10 SEI, 9-8 IEI, 7 SWI, 6 SEL, 5-4 IEL, 3 QPEN, 2 QCLM, "
        "1 UTE, 0 WDE"),
    REG("QCAPCTL", 0x16u, 0u, 0x807Fu, HT_FX_QCAPCTL, 0u, 0u, "15 CEN, 6-4 CCPS, 3-0 UPPS"),
    REG("QPOSCTL", 0x17u, 0u, 0xFFFFu, HT_PLAIN, 0u, 0u, "15 PCSHDW, 14 PCLOAD, 13 PCPOL, 12 PCE"),
    REG("QEINT", 0x18u, 0u, 0x0FFEu, HT_PLAIN, 0u, 0u, ""),
    REG("QFLG", 0x19u, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("QCLR", 0x1Au, 0u, 0x0FFFu, HT_ONES_CLEAR_AT, 0u, 0x19u, ""),
    REG("QFRC", 0x1Bu, 0u, 0x0FFEu, HT_ONES_SET_AT, 0u, 0x19u, ""),
    REG("QEPSTS", 0x1Cu, 0u, 0x008Eu, HT_ONES_CLEAR, 0u, 0u,
        "7 UPEVNT, 6 FIDF, 5 QDF, 4 QDLF, 3 COEF, 2 CDEF, 1 FIMF, 0 PCEF"),
    REG("QCTMR", 0x1Du, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("QCPRD", 0x1Eu, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("QCTMRLAT", 0x1Fu, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("QCPRDLAT", 0x20u, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
};

const ht_register ht_registers_sci[HT_SCI_REGISTERS] = {
    REG("SCICCR", 0x0u, 0u, 0x00FFu, HT_FX_SCIFORMAT, 0u, 0u,
        "7 STOPBITS, 6 PARITY, 5 PARITYENA, 4 LOOPBKENA, 3 ADDRIDLE_MODE, 2-0 SCICHAR"),
    REG("SCICTL1", 0x1u, 0u, 0x006Fu, HT_FX_SCICTL1, 0u, 0u,
        "6 RXERRINTENA, 5 SWRESET, 3 TXWAKE, 2 SLEEP, 1 TXENA, 0 RXENA"),
    REG("SCIHBAUD", 0x2u, 0u, 0x00FFu, HT_FX_SCIFORMAT, 0u, 0u, "7-0 BAUD_HIGH"),
    REG("SCILBAUD", 0x3u, 0u, 0x00FFu, HT_FX_SCIFORMAT, 0u, 0u, "7-0 BAUD_LOW"),
    REG("SCICTL2", 0x4u, 0x00C0u, 0x0003u, HT_PLAIN, 0u, 0u,
        "7 TXRDY, 6 TXEMPTY, 1 RXBKINTENA, 0 TXINTENA"),
    REG("SCIRXST", 0x5u, 0u, 0u, HT_READ_ONLY, 0u, 0u,
        "7 RXERROR, 6 RXRDY, 5 BRKDT, 4 FE, 3 OE, 2 PE, 1 RXWAKE"),
    REG("SCIRXEMU", 0x6u, 0u, 0u, HT_READ_ONLY, 0u, 0u, ""),
    REG("SCIRXBUF", 0x7u, 0u, 0u, HT_FX_SCIRXBUF, 0u, 0u, ""),
    REG("SCITXBUF", 0x9u, 0u, 0x00FFu, HT_FX_SCITXBUF, 0u, 0u, ""),
    REG("SCIFFTX", 0xAu, 0xA000u, 0xE07Fu, HT_FX_SCIFFTX, 0u, 0u,
        "15 SCIRST, 14 SCIFFENA, 13 TXFIFORESET, 12-8 TXFFST, 7 TXFFINT, 5 TXFFIENA, 4-0 TXFFIL"),
    REG("SCIFFRX", 0xBu, 0x201Fu, 0x607Fu, HT_FX_SCIFFRX, 0u, 0u,
        "15 RXFFOVF, 13 RXFIFORESET, 12-8 RXFFST, 7 RXFFINT, 5 RXFFIENA, 4-0 RXFFIL"),
    REG("SCIFFCT", 0xCu, 0u, 0x60FFu, HT_PLAIN, 0u, 0u, "15 ABD, 13 CDC, 7-0 FFTXDLY"),
    REG("SCIPRI", 0xFu, 0u, 0x0018u, HT_PLAIN, 0u, 0u, "4-3 FREESOFT"),
};

const ht_register ht_registers_timer[HT_TIMER_REGISTERS] = {
    REG32("TIM", 0x0u, 0x0000FFFFu, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG32("PRD", 0x2u, 0x0000FFFFu, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG("TCR", 0x4u, 0u, 0xCC30u, HT_FX_TCR, 0u, 0u,
        "15 TIF, 14 TIE, 11 FREE, 10 SOFT, 5 TRB, 4 TSS"),
    REG("TPR", 0x6u, 0u, 0x00FFu, HT_PLAIN, 0u, 0u, "15-8 PSC, 7-0 TDDR"),
    REG("TPRH", 0x7u, 0u, 0x00FFu, HT_PLAIN, 0u, 0u, "15-8 PSCH, 7-0 TDDRH"),
};

const ht_register ht_registers_counter[HT_TIMER_REGISTERS] = {
    REG32("TIM", 0x0u, 0x0000FFFFu, 0xFFFFFFFFu, HT_FX_COUNT, 0u, 0u, ""),
    REG32("PRD", 0x2u, 0x0000FFFFu, 0xFFFFFFFFu, HT_PLAIN, 0u, 0u, ""),
    REG("TCR", 0x4u, 0u, 0xCC30u, HT_FX_COUNTING, 0u, 0u,
        "15 TIF, 14 TIE, 11 FREE, 10 SOFT, 5 TRB, 4 TSS"),
    REG("TPR", 0x6u, 0u, 0x00FFu, HT_PLAIN, 0u, 0u, "15-8 PSC, 7-0 TDDR"),
    REG("TPRH", 0x7u, 0u, 0x00FFu, HT_PLAIN, 0u, 0u, "15-8 PSCH, 7-0 TDDRH"),
};

#define GROUP(n, offset, bits)                                                \
    REG("PIEIER" n, offset, 0u, bits, HT_FX_PIE, 0u, 0u, "6 INTx7, 0 INTx1"), \
        REG("PIEIFR" n, (offset) + 1u, 0u, bits, HT_FX_PIE, 0u, 0u, "6 INTx7, 0 INTx1")
#define PIE(bits)                                                                             \
    REG("PIECTRL", 0x00u, 0u, 0x0001u, HT_FX_PIE, 0u, 0u, "15-1 PIEVECT, 0 ENPIE"),           \
        REG("PIEACK", 0x01u, 0u, 0x0FFFu, HT_FX_PIEACK, 0u, 0u, ""), GROUP("1", 0x02u, bits), \
        GROUP("2", 0x04u, bits), GROUP("3", 0x06u, bits), GROUP("4", 0x08u, bits),            \
        GROUP("5", 0x0Au, bits), GROUP("6", 0x0Cu, bits), GROUP("7", 0x0Eu, bits),            \
        GROUP("8", 0x10u, bits), GROUP("9", 0x12u, bits), GROUP("10", 0x14u, bits),           \
        GROUP("11", 0x16u, bits), GROUP("12", 0x18u, bits)

const ht_register ht_registers_pie_8[HT_PIE_REGISTERS] = {PIE(0x00FFu)};
const ht_register ht_registers_pie_16[HT_PIE_REGISTERS] = {PIE(0xFFFFu)};

const ht_register ht_register_vector[1] = {
    REG32("", 0x0u, 0u, 0xFFFFFFFFu, HT_PLAIN, HT_EALLOWED, 0u, ""),
};
