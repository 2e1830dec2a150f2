/** @file ht_regfile.h
 *  Model of a C2000 register file, one per simulated drive: what a driver's
 *  accesses do on the chip, with their traps.
 *
 *  Modelled: EALLOW protection, write-1-to-clear and force registers of the trip
 *  zone and event trigger, of the eQEP's status, PIE acknowledge, read-only registers
 *  (the capture timer, period and latches among them), addresses where nothing is. A forbidden access has the effect it has on the chip (none) and
 *  is counted, with the first offender kept, so that tests can insist on zero.
 *  What the PWM makes of the values is the plant's business, not this file's; only
 *  an event that overtakes the running interrupt can be planted here (`event_at`).
 */
#ifndef HT_REGFILE_H
#define HT_REGFILE_H

#include <stdint.h>

#define HT_REGFILE_LOW 0x8000u    /* words 0x0000..0x7FFF */
#define HT_REGFILE_SYS 0x5D000u   /* words 0x5D000..0x5D7FF */
#define HT_REGFILE_SYS_WORDS 0x800u

/** Kinds of forbidden access. */
enum {
    HT_REG_OK = 0,
    HT_REG_NO_EALLOW = 1,
    HT_REG_HOLE = 2,
    HT_REG_READ_ONLY = 3
};

typedef struct ht_regfile {
    uint16_t low[HT_REGFILE_LOW];
    uint16_t sys[HT_REGFILE_SYS_WORDS];
    const void *map;          /* ht_c2000_map of the device */
    uint16_t eallow;          /* 1 while protected writes are allowed */
    uint32_t accesses;        /* all reads and writes */
    uint32_t event_at;        /* the next fast event comes before this access; 0 = never */
    uint32_t violations;      /* forbidden ones */
    uint32_t first_address;   /* of the first violation */
    uint16_t first_kind;
} ht_regfile;

/** Reset state of a device; `map` is ht_f28335 or ht_f28377s. */
void ht_regfile_reset(ht_regfile *rf, const void *map);

uint16_t ht_regfile_read16(ht_regfile *rf, uint32_t addr);
void ht_regfile_write16(ht_regfile *rf, uint32_t addr, uint16_t value);
uint32_t ht_regfile_read32(ht_regfile *rf, uint32_t addr);
void ht_regfile_write32(ht_regfile *rf, uint32_t addr, uint32_t value);
/** The storage of an address, or NULL where nothing is: the hardware's side of it. */
uint16_t *ht_regfile_word(ht_regfile *rf, uint32_t addr);
void ht_regfile_eallow(ht_regfile *rf, uint16_t on);

#endif
