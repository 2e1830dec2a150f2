#include "ht_regfile.h"

#include <string.h>

#include "../c2000/ht_c2000_map.h"

#define LEGS 6u
#define PERCLKDIVSEL_RESET 0x0051u /* EPWM, EMIF1, EMIF2 halved */
#define TBCTL_RESET 0x0083u /* frozen, HSPCLKDIV = /2 */

static void violation(ht_regfile *rf, uint32_t addr, uint16_t kind)
{
    if (rf->violations == 0u) {
        rf->first_address = addr;
        rf->first_kind = kind;
    }
    rf->violations++;
}

uint16_t *ht_regfile_word(ht_regfile *rf, uint32_t addr)
{
    if (addr < HT_REGFILE_LOW) {
        return &rf->low[addr];
    }
    if ((addr >= HT_REGFILE_SYS) && (addr < (HT_REGFILE_SYS + HT_REGFILE_SYS_WORDS))) {
        return &rf->sys[addr - HT_REGFILE_SYS];
    }
    return 0;
}

void ht_regfile_reset(ht_regfile *rf, const void *map)
{
    const ht_c2000_map *m = map;
    uint32_t leg;
    memset(rf, 0, sizeof *rf);
    rf->map = map;
    for (leg = 0u; leg < LEGS; leg++) {
        rf->low[m->epwm + leg * m->stride + m->tbctl] = TBCTL_RESET;
    }
    if (m->perclkdivsel != 0u) {
        *ht_regfile_word(rf, m->perclkdivsel) = PERCLKDIVSEL_RESET;
    }
}

/* Every access counts; the planted event arrives in between. */
static void count(ht_regfile *rf)
{
    const ht_c2000_map *m = rf->map;
    rf->accesses++;
    if ((rf->event_at != 0u) && (rf->accesses == rf->event_at)) {
        rf->low[m->epwm + m->etflg] |= ET_INT;
        rf->event_at = 0u;
    }
}

/* Offset inside a PWM module, or -1. */
static int32_t epwm_offset(const ht_c2000_map *m, uint32_t addr)
{
    if ((addr < m->epwm) || (addr >= (m->epwm + LEGS * m->stride))) {
        return -1;
    }
    return (int32_t)((addr - m->epwm) % m->stride);
}

/* Writes with a side effect inside a PWM module. Returns 1 if it was one. */
static int epwm_write(ht_regfile *rf, const ht_c2000_map *m, uint32_t addr, uint16_t offset,
                      uint16_t value)
{
    uint32_t base = addr - offset;
    int is_protected = (offset == m->tzsel) || (offset == m->tzctl) || (offset == m->tzeint)
                       || (offset == m->tzclr) || (offset == m->tzfrc);
    if (is_protected && (rf->eallow == 0u)) {
        violation(rf, addr, HT_REG_NO_EALLOW);
        return 1;
    }
    if (offset == m->tzflg) {
        violation(rf, addr, HT_REG_READ_ONLY);
        return 1;
    }
    if (offset == m->tzclr) { /* write 1 to clear; INT last, as on the chip */
        rf->low[base + m->tzflg] = (uint16_t)(rf->low[base + m->tzflg] & (uint16_t)~value);
        return 1;
    }
    if (offset == m->tzfrc) { /* force; reads back 0 */
        rf->low[base + m->tzflg] = (uint16_t)(rf->low[base + m->tzflg] | (value & 0x007Eu) | TZ_INT);
        return 1;
    }
    if (offset == m->etclr) {
        rf->low[base + m->etflg] = (uint16_t)(rf->low[base + m->etflg] & (uint16_t)~value);
        return 1;
    }
    return 0;
}

/* Writes to the eQEP that do not just store. Returns 1 if it was one. */
static int eqep_write(ht_regfile *rf, const ht_c2000_map *m, uint32_t addr, uint16_t value)
{
    uint32_t offset = addr - m->eqep;
    if (offset == EQEP_QEPSTS) { /* write 1 to clear; the other bits are the hardware's */
        uint16_t clear = value & (QEPSTS_UPEVNT | QEPSTS_COEF | QEPSTS_CDEF | QEPSTS_FIMF);
        rf->low[addr] = (uint16_t)(rf->low[addr] & (uint16_t)~clear);
        return 1;
    }
    if ((offset == EQEP_QFLG) || ((offset >= EQEP_QPOSILAT) && (offset < EQEP_QUTMR))
        || ((offset >= EQEP_QCTMR) && (offset <= EQEP_QCPRDLAT))) {
        violation(rf, addr, HT_REG_READ_ONLY);
        return 1;
    }
    return 0;
}

static int is_system_protected(const ht_c2000_map *m, uint32_t addr)
{
    return (addr == m->pclk_epwm) || (addr == m->pclk_eqep) || (addr == m->pclk_tbsync)
           || ((m->perclkdivsel != 0u) && (addr == m->perclkdivsel));
}

uint16_t ht_regfile_read16(ht_regfile *rf, uint32_t addr)
{
    uint16_t *w = ht_regfile_word(rf, addr);
    count(rf);
    if (w == 0) {
        violation(rf, addr, HT_REG_HOLE);
        return 0u;
    }
    return *w;
}

void ht_regfile_write16(ht_regfile *rf, uint32_t addr, uint16_t value)
{
    const ht_c2000_map *m = rf->map;
    uint16_t *w = ht_regfile_word(rf, addr);
    int32_t offset;
    count(rf);
    if (w == 0) {
        violation(rf, addr, HT_REG_HOLE);
        return;
    }
    offset = epwm_offset(m, addr);
    if ((offset >= 0) && (epwm_write(rf, m, addr, (uint16_t)offset, value) != 0)) {
        return;
    }
    if ((addr >= m->eqep) && (addr < (m->eqep + EQEP_WORDS))
        && (eqep_write(rf, m, addr, value) != 0)) {
        return;
    }
    if (is_system_protected(m, addr) && (rf->eallow == 0u)) {
        violation(rf, addr, HT_REG_NO_EALLOW);
        return;
    }
    if (addr == m->pieack) {
        *w = (uint16_t)(*w & (uint16_t)~value);
        return;
    }
    *w = value;
}

uint32_t ht_regfile_read32(ht_regfile *rf, uint32_t addr)
{
    uint32_t low = ht_regfile_read16(rf, addr);
    return low | ((uint32_t)ht_regfile_read16(rf, addr + 1u) << 16);
}

void ht_regfile_write32(ht_regfile *rf, uint32_t addr, uint32_t value)
{
    ht_regfile_write16(rf, addr, (uint16_t)(value & 0xFFFFu));
    ht_regfile_write16(rf, addr + 1u, (uint16_t)(value >> 16));
}

void ht_regfile_eallow(ht_regfile *rf, uint16_t on)
{
    rf->eallow = on;
}
