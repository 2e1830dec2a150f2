/* Two areas in plain memory. */
#include <stdlib.h>
#include <string.h>

#include "store_bench.h"

#define BLOCKS 64u

bench_state bench;
ht_port bench_chip;
const ht_board *const bench_board = &ht_board_f28377s;
static ht_regfile registers;
static uint16_t memory[HT_STORE_AREAS][BLOCKS * HT_STORE_WORDS];

/* The contents of `n` words that should have become `wanted` (NULL: erased). */
static void torn(uint16_t *at, const uint16_t *wanted, unsigned n)
{
    unsigned k;
    for (k = 0; k < n; k++) {
        uint16_t to = (wanted == NULL) ? HT_STORE_ERASED : wanted[k];
        at[k] = bench_torn(at[k], to, k < n / 2);
    }
    longjmp(bench.off, 1);
}

static bool read_block(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    (void)at;
    memcpy(words, &memory[area][block * HT_STORE_WORDS], HT_STORE_WORDS * sizeof *words);
    return block < BLOCKS;
}

static bool write_block(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    uint16_t *to = &memory[area][(words == NULL) ? 0u : block * HT_STORE_WORDS];
    unsigned n = (words == NULL) ? BLOCKS * HT_STORE_WORDS : HT_STORE_WORDS;
    unsigned k;
    (void)at;
    bench.operations++;
    if (bench.operations == bench.cut_at) {
        torn(to, words, n);
    }
    if (bench.operations == bench.fail_at) {
        return false;
    }
    for (k = 0; k < n; k++) {
        to[k] = (words == NULL) ? HT_STORE_ERASED : (uint16_t)(to[k] & words[k]);
    }
    return true;
}

void bench_power_on(void)
{
    ht_regfile_reset(&registers, bench_board->map);
    ht_port_bind(&bench_chip, &registers, bench_board);
    (void)ht_board_start(&bench_chip);
    bench.operations = 0;
    bench.cut_at = 0;
    bench.fail_at = 0;
}

ht_store_port bench_store(void)
{
    ht_store_port port = {read_block, write_block, NULL, BLOCKS};
    return port;
}

void bench_erase(void)
{
    memset(memory, 0xFF, sizeof memory);
}

uint16_t *bench_word(unsigned area, unsigned word)
{
    return &memory[area][word];
}
