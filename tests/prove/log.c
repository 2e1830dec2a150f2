/* The log's memory, which may hold anything, and fail at any access: what one turn may do. */
#include "ht_contracts.h"
#include "ht_log_ring.c"
#include "prove.h"

#define BLOCKS ((uint16_t)(HT_LOG_SLOTS * HT_LOG_BLOCKS))

static bool writes;       /* may it? */
static bool erases;       /* may it? */
static uint16_t in_use;   /* the area before the turn */
static uint16_t to_write; /* the slot to be written before the turn */
static uint16_t phase;

static uint32_t promise_sum(const uint16_t *words)
{
    return nondet_uint32();
}

static bool promise_is_blank(const uint16_t *words)
{
    return nondet_bool();
}

/* The lists of slots: what they hold is within the area (tests/c/test_log.c). */
static void promise_note(ht_log_ring *r, uint16_t word, uint16_t slot)
{
    MUST(slot < r->slots);
}

static uint16_t any_slot(void)
{
    uint16_t slot = nondet_uint16();
    GIVEN(slot < HT_LOG_SLOTS);
    return slot;
}

static uint16_t promise_kept_slot(const ht_log_ring *r, uint16_t at)
{
    MUST(at < (r->events + HT_LOG_VALUES));
    return any_slot();
}

static uint16_t promise_place(const ht_log_ring *r, uint16_t at)
{
    return any_slot();
}

static void promise_drop(ht_log_ring *r, uint16_t at)
{
    MUST(at < (r->events + HT_LOG_VALUES));
    r->events = ((r->events > 0u) && (at < r->events)) ? (uint16_t)(r->events - 1u) : r->events;
}

static void promise_change(ht_log_ring *r)
{
    r->area = other(r);
    r->next = any_slot();
    r->phase = (uint16_t)PHASE_READY;
}

static bool read_block(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    uint16_t k;
    MUST((area < HT_STORE_AREAS) && (block < BLOCKS));
    for (k = 0u; k < HT_STORE_WORDS; k++) {
        words[k] = nondet_uint16();
    }
    return nondet_bool();
}

/* Nothing that is whole is lost: what is in use is never erased, and written from its end on only. */
static bool write_block(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    MUST(writes);
    MUST((area < HT_STORE_AREAS) && (block < BLOCKS));
    if (words == NULL) {
        MUST(erases && (area != in_use));
    } else if (area == in_use) {
        MUST((phase == (uint16_t)PHASE_READY) && ((block / HT_LOG_BLOCKS) == to_write));
    } else {
        MUST(phase == (uint16_t)PHASE_COPY);
    }
    return nondet_bool();
}

static bool sound(const ht_log_ring *r)
{
    bool good = (r->area < HT_STORE_AREAS) && (r->next <= r->slots) && (r->at <= r->slots)
                && (r->block < HT_LOG_BLOCKS) && (r->events <= HT_LOG_EVENTS)
                && ((r->failed < TRIES) || (r->phase == (uint16_t)PHASE_NONE));
    good = good && ((r->phase != (uint16_t)PHASE_COPY) || (r->at <= (r->events + HT_LOG_VALUES)));
    return good && (!r->writing || ((r->phase == (uint16_t)PHASE_READY) && (r->next < r->slots)));
}

void prove_log_turn(void)
{
    ht_log_ring r;
    uint16_t k;
    r.port.read = read_block;
    r.port.write = write_block;
    r.port.at = NULL;
    r.port.blocks = BLOCKS;
    r.slots = HT_LOG_SLOTS;
    r.phase = nondet_uint16();
    r.area = nondet_uint16();
    r.next = nondet_uint16();
    r.at = nondet_uint16();
    r.block = nondet_uint16();
    r.failed = nondet_uint16();
    r.generation = nondet_uint32();
    r.events = nondet_uint16();
    for (k = 0u; k < HT_LOG_WORDS; k++) {
        r.slot[k] = nondet_uint16();
    }
    r.damaged = nondet_uint16();
    r.writing = nondet_bool();
    r.kept = nondet_bool();
    GIVEN(sound(&r));
    writes = nondet_bool();
    erases = nondet_bool();
    in_use = r.area;
    to_write = r.next;
    phase = r.phase;
    (void)ht_log_ring_turn(&r, writes, erases);
    MUST(sound(&r));
    MUST(IMPLIES(r.writing, r.area == in_use));
}
