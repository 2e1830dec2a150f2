/** @file ht_regfile_model.h
 *  Between the parts of the register model.
 */
#ifndef HT_REGFILE_MODEL_H
#define HT_REGFILE_MODEL_H

#include "ht_regfile.h"

/** Note a violation. */
void ht_model_violation(ht_regfile *rf, uint32_t addr, uint32_t value, uint16_t kind,
                        const char *why);
/** A register's value, without any protection. */
uint32_t ht_model_peek(ht_regfile *rf, uint32_t addr, uint16_t bits);
void ht_model_poke(ht_regfile *rf, uint32_t addr, uint16_t bits, uint32_t value);
/** Is the module behind this address clocked? */
uint16_t ht_model_clocked(const ht_regfile *rf, uint32_t addr);
/** Do the PWM counters run (TBCLKSYNC)? */
uint16_t ht_model_counting(ht_regfile *rf);

/* ht_regfile_pwm.c: what the PWM's outputs may do to the switches */

/** ePWM module (0 = ePWM1) that drives a pin at this position of its multiplexer, or -1. */
int32_t ht_model_module_of(const ht_regfile *rf, uint32_t pin, uint32_t mux);
/** A pin is handed to a module. This is a violation unless everything is in place. */
void ht_model_check_pin(ht_regfile *rf, uint32_t addr, uint32_t value, int32_t module);
/** A register of eCAP1 has been written. */
void ht_model_ecap_written(ht_regfile *rf);
/** eCAP1's output goes to the trip zones; they have been set up, or it has changed. */
void ht_model_ecap_out(ht_regfile *rf);
/** No gate may be on now: a violation if a module that has a pin is not tripped. */
void ht_model_check_off(ht_regfile *rf, uint32_t addr, uint32_t value, const char *why);
/** TZCLR of the module at `base` is about to be written. */
void ht_model_check_clear(ht_regfile *rf, uint32_t base, uint32_t addr, uint32_t value);
/** TZCTL of the module at `base` is about to be written while the counters run. */
void ht_model_check_action(ht_regfile *rf, uint32_t base, uint32_t addr, uint32_t value);
/** A set-up register of the module at `base` has been written. */
void ht_model_check_dead_time(ht_regfile *rf, uint32_t base, uint32_t addr, uint32_t value);

/** Effect of a write of `value` to a register that held `old`. Returns what it holds now. */
uint32_t ht_model_written(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t old,
                          uint32_t value);
/** Effect of a read: what the reader gets. */
uint32_t ht_model_read(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t value);
/** Take interrupts that are pending and enabled, until none is left. */
void ht_model_serve(ht_regfile *rf);

#endif
