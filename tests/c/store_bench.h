/* A memory for parameters whose power can be cut, and that can be damaged: plain memory
 * (store_memory.c), or a chip's flash behind a fake of TI's API (flash/fake_flash.c). */
#ifndef STORE_BENCH_H
#define STORE_BENCH_H

#include <setjmp.h>
#include <stdlib.h>

#include "ht_port_c2000.h"
#include "ht_store_port.h"

/* The result of an operation during which the power failed. */
enum { CUT_NOTHING, CUT_HALF, CUT_RANDOM, CUT_ZEROS, CUT_COMPLETE, CUT_STYLES };

typedef struct {
    unsigned operations; /* erases and programs since `bench_power` */
    unsigned cut_at;     /* power fails in this one, counted from 1; 0: never */
    unsigned style;      /* how */
    unsigned fail_at;    /* this one fails, and says so; 0: none */
    jmp_buf off;         /* where to continue when it does */
} bench_state;

extern bench_state bench;
extern ht_port bench_chip;
extern const ht_board *const bench_board;

/* The chip after power-on; the memory keeps what it has. */
void bench_power_on(void);
ht_store_port bench_store(void);
/* Everything is erased, as in a new chip. */
void bench_erase(void);
/* A word of an area, to look at and to damage. */
uint16_t *bench_word(unsigned area, unsigned word);

/* The contents, in the style that is in force, of a word that was `was` and should have become `to`.
 * half: it is in the first half of what was written. */
static inline uint16_t bench_torn(uint16_t was, uint16_t to, bool half)
{
    uint16_t mask = (uint16_t)rand();
    switch (bench.style) {
    case CUT_HALF:
        return half ? to : was;
    case CUT_RANDOM:
        return (uint16_t)((was & ~mask) | (to & mask));
    case CUT_ZEROS: /* an erase begins with zeros on the F28335 */
        return 0;
    case CUT_COMPLETE:
        return to;
    default:
        return was;
    }
}

#endif
