#include "ht_reset.h"

#include <stddef.h>

#define MARK 0x5A170000u
#define MOST 0xFFFFu /* the count's bits of `word` */

static const ht_reset_info table[] = {
#define HT_RESET(name, number, text, help) {text, help},
#include "ht_resets.def"
#undef HT_RESET
};

const ht_reset_info *ht_reset_describe(uint16_t cause)
{
    return (cause < (uint16_t)HT_RESETS) ? &table[cause] : NULL;
}

ht_reset ht_reset_count(ht_reset_memory *m, uint16_t cause)
{
    ht_reset reset;
    bool kept = ((m->word ^ m->inverse) == 0xFFFFFFFFu) && ((m->word & ~(uint32_t)MOST) == MARK)
                && (cause != (uint16_t)HT_RESET_POWER);
    uint16_t count = kept ? (uint16_t)(m->word & MOST) : 0u;
    bool dog = (cause == (uint16_t)HT_RESET_WATCHDOG) || (cause == (uint16_t)HT_RESET_NMI);
    if (dog && (count < MOST)) {
        count++;
    }
    m->word = MARK | count;
    m->inverse = m->word ^ 0xFFFFFFFFu;
    reset.cause = cause;
    reset.watchdogs = count;
    return reset;
}
