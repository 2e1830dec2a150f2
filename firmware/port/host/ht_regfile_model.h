/** @file ht_regfile_model.h
 *  Between the parts of the register model.
 */
#ifndef HT_REGFILE_MODEL_H
#define HT_REGFILE_MODEL_H

#include "ht_regfile.h"

/** Note a violation. */
void ht_model_violation(ht_regfile *rf, uint32_t addr, uint32_t value, uint16_t kind,
                        const char *why);
/** A register's value, past all protection. */
uint32_t ht_model_peek(ht_regfile *rf, uint32_t addr, uint16_t bits);
void ht_model_poke(ht_regfile *rf, uint32_t addr, uint16_t bits, uint32_t value);
/** Is the module behind this address clocked? */
uint16_t ht_model_clocked(const ht_regfile *rf, uint32_t addr);
/** Do the PWM counters run (TBCLKSYNC)? */
uint16_t ht_model_counting(ht_regfile *rf);

/** Effect of a write of `value` to a register that held `old`. Returns what it holds now. */
uint32_t ht_model_written(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t old,
                          uint32_t value);
/** Effect of a read: what the reader gets. */
uint32_t ht_model_read(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t value);
/** Take interrupts that are pending and enabled, until none is left. */
void ht_model_serve(ht_regfile *rf);

#endif
