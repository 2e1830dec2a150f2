/* The log (ht_log_ring.h) on a memory whose power fails at any word, that gets damaged, that refuses
 * writes. What was written stays, and power that fails costs the record under way at most. */
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ht_log_ring.h"
#include "ht_octets.h"

#define BLOCKS (HT_LOG_SLOTS * HT_LOG_BLOCKS)
#define AREA_WORDS (BLOCKS * HT_STORE_WORDS)
#define VALUE_A HT_LOG_VALUE_FIRST
#define MOST_PUT 4000u
/* Under the address sanitizer each step takes longer. */
#ifdef __SANITIZE_ADDRESS__
#define STRIDE 97u
#else
#define STRIDE 1u
#endif

static int failures;

#define CHECK(condition)                                                  \
    do {                                                                  \
        if (!(condition)) {                                               \
            printf("%s:%d: FAILED %s\n", __FILE__, __LINE__, #condition); \
            failures++;                                                   \
        }                                                                 \
    } while (0)

/* --- the memory ------------------------------------------------------------------------------ */

typedef struct {
    uint16_t word[HT_STORE_AREAS][AREA_WORDS];
    bool programmed[HT_STORE_AREAS][BLOCKS]; /* since the erase */
    unsigned erases[HT_STORE_AREAS];
    unsigned blocks; /* programmed */
} memory_state;

static memory_state memory;
static unsigned words_written; /* since power-on: each word of a block, each of an erase */
static unsigned cut_at;        /* power fails before this word; 0: never */
static unsigned operations;
static unsigned fail_at; /* this one fails, and says so; 0: none */
static unsigned fail_every;
static unsigned stuck_every; /* of these blocks one bit stays as it was, and nothing is said */
static unsigned unreadable;  /* bit of each area that cannot be read */
static jmp_buf off;

static void one_word(uint16_t *at, uint16_t to)
{
    words_written++;
    if (words_written == cut_at) {
        *at = (uint16_t)(*at & (to | (uint16_t)rand())); /* some of its bits are on their way */
        longjmp(off, 1);
    }
    *at = to;
}

static bool read_block(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    (void)at;
    CHECK((area < HT_STORE_AREAS) && (block < BLOCKS));
    memcpy(words, &memory.word[area][block * HT_STORE_WORDS], HT_STORE_WORDS * sizeof *words);
    return ((unreadable >> area) & 1u) == 0u;
}

static bool write_block(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    unsigned k;
    (void)at;
    CHECK((area < HT_STORE_AREAS) && (block < BLOCKS));
    operations++;
    if ((operations == fail_at) || ((fail_every != 0u) && (operations % fail_every == 0u))) {
        return false;
    }
    if (words == NULL) {
        memory.erases[area]++;
        for (k = 0; k < AREA_WORDS; k++) {
            if (words_written + 1u == cut_at) { /* no word of it can be trusted */
                memory.word[area][rand() % (int)AREA_WORDS] = (uint16_t)rand();
            }
            one_word(&memory.word[area][k], HT_STORE_ERASED);
        }
        memset(memory.programmed[area], 0, sizeof memory.programmed[area]);
        return true;
    }
    CHECK(!memory.programmed[area][block]); /* once after an erase */
    for (k = 0; k < HT_STORE_WORDS; k++) {
        uint16_t *to = &memory.word[area][block * HT_STORE_WORDS + k];
        uint16_t wanted = (uint16_t)(*to & words[k]);
        memory.programmed[area][block] = true;
        one_word(to, wanted);
    }
    if ((stuck_every != 0u) && (operations % stuck_every == 0u)) {
        memory.word[area][block * HT_STORE_WORDS + operations % HT_STORE_WORDS] ^= 0x40u;
    }
    memory.blocks++;
    return true;
}

static void erase_all(void)
{
    memset(&memory, 0, sizeof memory);
    memset(memory.word, 0xFF, sizeof memory.word);
}

/* --- a log beside a list of what must be in it ------------------------------------------------- */

static ht_log_ring ring;
static unsigned put_events;   /* that were put; the contents of event n follow from n */
static unsigned kept_events;  /* of which the ring said that they are kept */
static unsigned put_value[2]; /* the latest of each value, and that is kept */
static unsigned kept_value[2];

static void record(uint16_t kind, unsigned n, uint16_t *words)
{
    unsigned k;
    uint32_t state = n * 2654435761u + kind;
    for (k = 0; k < HT_LOG_PAYLOAD; k++) {
        state = state * 1664525u + 1013904223u;
        words[k] = (uint16_t)(state >> 16);
    }
    words[0] = kind;
    words[1] = (uint16_t)n;
}

static void power_on(void)
{
    memset(&ring, 0xA5, sizeof ring);
    ht_log_ring_none(&ring);
    ring.port.read = read_block;
    ring.port.write = write_block;
    ring.port.blocks = BLOCKS;
    words_written = 0;
    operations = 0;
    cut_at = 0;
    fail_at = 0;
    fail_every = 0;
    stuck_every = 0;
    ht_log_ring_start(&ring);
}

/* Turn until a record may be put. False: that never comes. */
static bool turn(bool may_erase)
{
    unsigned n;
    for (n = 0; n < 20u * BLOCKS; n++) {
        ht_log_turned turned = ht_log_ring_turn(&ring, true, may_erase);
        if (turned == HT_LOG_FREE) {
            return true;
        }
        if (turned == HT_LOG_NO_MEMORY) {
            return false;
        }
    }
    return false;
}

/* Put a record, again if the memory refuses it. */
static bool put(uint16_t kind, unsigned n)
{
    uint16_t words[HT_LOG_PAYLOAD];
    unsigned tries;
    record(kind, n, words);
    for (tries = 0; tries < 200u; tries++) {
        if (!turn(true)) {
            return false;
        }
        ht_log_ring_put(&ring, words);
        while (ring.writing) {
            (void)ht_log_ring_turn(&ring, true, true);
        }
        if (ring.kept) {
            return true;
        }
    }
    return false;
}

static void put_event(void)
{
    put_events++;
    if (put(1u, put_events)) {
        kept_events = put_events;
    }
}

static void put_a_value(unsigned which)
{
    put_value[which]++;
    if (put((uint16_t)(VALUE_A + which), put_value[which])) {
        kept_value[which] = put_value[which];
    }
}

static void forget_all(void)
{
    erase_all();
    put_events = kept_events = 0;
    put_value[0] = put_value[1] = kept_value[0] = kept_value[1] = 0;
}

/* What the present turn reads: values are noted as they are found. */
static unsigned found_value[2];

static bool same(uint16_t kind, unsigned n, const uint16_t *words)
{
    uint16_t wanted[HT_LOG_PAYLOAD];
    record(kind, n, wanted);
    return memcmp(wanted, words, sizeof wanted) == 0;
}

/* Power on, and look at everything. `lost`: damaged events that may be missing. Returns the latest event. */
static unsigned look(unsigned lost)
{
    uint16_t words[HT_LOG_WORDS];
    unsigned latest = 0;
    unsigned missing = 0;
    unsigned n;
    unsigned row;
    power_on();
    found_value[0] = found_value[1] = 0;
    for (n = 0; n < 4u * HT_LOG_SLOTS; n++) {
        ht_log_turned turned = ht_log_ring_turn(&ring, false, false);
        if ((turned == HT_LOG_FOUND) && (ring.slot[0] >= VALUE_A)) {
            unsigned which = ring.slot[0] - VALUE_A;
            CHECK(same(ring.slot[0], ring.slot[1], ring.slot));
            CHECK(ring.slot[1] >= found_value[which]);
            found_value[which] = ring.slot[1];
        }
    }
    for (row = 0; row < ring.events; row++) {
        CHECK(ht_log_ring_read(&ring, (uint16_t)row, words));
        CHECK(same(1u, words[1], words));
        if (row > 0) {
            CHECK(words[1] > latest); /* in their order, none twice */
            missing += words[1] - latest - 1u;
        }
        latest = words[1];
    }
    CHECK(!ht_log_ring_read(&ring, ring.events, words));
    CHECK(missing <= lost);
    CHECK(ring.events + lost >= ((kept_events < HT_LOG_EVENTS) ? kept_events : HT_LOG_EVENTS));
    return latest;
}

static void everything_is_there(void)
{
    unsigned latest = look(0);
    unsigned which;
    CHECK((latest == kept_events) || (latest == put_events)); /* the one under way may be whole */
    for (which = 0; which < 2; which++) {
        CHECK((found_value[which] == kept_value[which])
              || (found_value[which] == put_value[which]));
    }
}

/* --- tests ----------------------------------------------------------------------------------- */

static void fill(unsigned events)
{
    unsigned n;
    power_on();
    for (n = 0; n < events; n++) {
        put_event();
        if (n % 7u == 3u) {
            put_a_value(n % 2u);
        }
    }
}

static void it_keeps_the_latest(void)
{
    unsigned n;
    forget_all();
    CHECK(look(0) == 0);
    CHECK(!turn(false) || (ring.events == 0)); /* a new chip needs no erase */
    CHECK(memory.erases[0] + memory.erases[1] == 0);
    for (n = 1; n < 3u * HT_LOG_SLOTS; n += 5) { /* several times round */
        forget_all();
        fill(n);
        everything_is_there();
        CHECK(ring.damaged == 0);
    }
}

/* From a log that is about to change its area: every word of what comes. */
static void power_fails(unsigned style)
{
    static memory_state before;
    volatile unsigned at;
    volatile bool cut = true;
    unsigned was[6];
    forget_all();
    fill(style == 0 ? 30u : 95u);
    while ((unsigned)(ring.slots - ring.next) > HT_LOG_SLOTS / 8u + 1u && (put_events < MOST_PUT)) {
        put_event();
    }
    before = memory;
    was[0] = put_events, was[1] = kept_events, was[2] = put_value[0], was[3] = kept_value[0],
    was[4] = put_value[1], was[5] = kept_value[1];
    for (at = 1; cut; at += STRIDE) {
        memory = before;
        put_events = was[0], kept_events = was[1], put_value[0] = was[2], kept_value[0] = was[3],
        put_value[1] = was[4], kept_value[1] = was[5];
        power_on();
        cut_at = at;
        cut = true;
        if (setjmp(off) == 0) {
            unsigned n;
            for (n = 0; n < 4; n++) {
                put_event();
                put_a_value(n % 2u);
            }
            cut = false;
        }
        memset(memory.programmed, 0, sizeof memory.programmed); /* what is torn looks as it does */
        everything_is_there();
        /* And it goes on, as if nothing had been. */
        kept_events = put_events = look(0);
        kept_value[0] = put_value[0] = found_value[0];
        kept_value[1] = put_value[1] = found_value[1];
        if ((at % (7u * STRIDE) == 1u) || !cut) {
            power_on();
            put_event();
            put_a_value(0);
            everything_is_there();
        }
    }
    CHECK(at > 4u * HT_LOG_WORDS + HT_LOG_EVENTS * HT_LOG_WORDS); /* the change was in it */
    CHECK(memory.erases[0] + memory.erases[1] > before.erases[0] + before.erases[1]);
}

/* A bit flips in any word of any record: that one is gone, and told. */
static void a_damaged_record(void)
{
    unsigned slot;
    forget_all();
    fill(50);
    for (slot = 1; slot < ring.next; slot++) {
        unsigned area = ring.area;
        unsigned word = slot * HT_LOG_WORDS + (slot * 11u) % HT_LOG_WORDS;
        uint16_t bit = (uint16_t)(1u << (slot % 16u));
        bool event = memory.word[area][slot * HT_LOG_WORDS] == 1u;
        memory.word[area][word] ^= bit;
        (void)look(1);
        CHECK(ring.damaged == 1u);
        CHECK(ring.events == (event ? 49u : 50u));
        memory.word[area][word] ^= bit;
    }
    everything_is_there();
    CHECK(ring.damaged == 0u);
}

/* It cannot be read when the area changes: the others go on. */
static void damaged_before_a_change(void)
{
    uint16_t words[HT_LOG_WORDS];
    unsigned changes;
    forget_all();
    fill(70);
    memory.word[ring.area][ring.index[40] * HT_LOG_WORDS + 5u] ^= 4u;
    changes = ring.generation;
    while ((ring.generation == changes) && (put_events < MOST_PUT)) {
        put_event();
    }
    CHECK(ring.damaged >= 1u);
    (void)look(1);
    CHECK(ring.damaged == 0u); /* it was left behind */
    CHECK(ht_log_ring_read(&ring, (uint16_t)(ring.events - 1u), words)
          && same(1u, kept_events, words));
}

/* A write that fails costs a slot and no record; the wear of both areas is the same, and bounded. */
static void writes_fail(void)
{
    unsigned n;
    unsigned every;
    forget_all();
    for (every = 511; every < 800u; every += 37u) { /* a change takes 269 of them */
        power_on();
        fail_every = every;
        for (n = 0; n < 300; n++) {
            put_event();
            CHECK(kept_events == put_events);
        }
        everything_is_there();
        power_on();
        stuck_every = every;
        for (n = 0; n < 300; n++) {
            put_event();
            CHECK(kept_events == put_events);
        }
        everything_is_there();
    }
    /* A memory that takes nothing any more is none, and says so. */
    power_on();
    fail_every = 1;
    CHECK(!put(1u, put_events + 1u));
    CHECK(!ht_log_ring_works(&ring));
    everything_is_there();
    for (unreadable = 3; unreadable != 0; unreadable--) { /* what may be there is not erased */
        power_on();
        CHECK(!turn(true) && !ht_log_ring_works(&ring));
        CHECK(operations == 0);
    }
    everything_is_there();
}

static void wear(void)
{
    const unsigned records = 3000;
    unsigned least = HT_LOG_SLOTS - HT_LOG_SLOTS / 8u - 1u - HT_LOG_EVENTS - 2u; /* of a change */
    unsigned n;
    unsigned erases;
    forget_all();
    power_on();
    for (n = 0; n < records; n++) {
        put_event();
    }
    erases = memory.erases[0] + memory.erases[1];
    CHECK(erases <= records / least + 1u);
    CHECK((memory.erases[0] + 1u >= memory.erases[1])
          && (memory.erases[1] + 1u >= memory.erases[0]));
    CHECK(memory.blocks < HT_LOG_BLOCKS * (records + (erases + 1u) * (HT_LOG_EVENTS + 3u)));
}

/* Without leave nothing is written or erased, and what waits is not lost. */
static void only_with_leave(void)
{
    uint16_t words[HT_LOG_PAYLOAD];
    unsigned n;
    forget_all();
    power_on();
    (void)turn(true);
    record(1u, 1u, words);
    ht_log_ring_put(&ring, words);
    operations = 0;
    for (n = 0; n < 100; n++) {
        CHECK(ht_log_ring_turn(&ring, false, true) == HT_LOG_BUSY);
    }
    CHECK(operations == 0);
    CHECK(put(1u, 1u)); /* the same again */
    for (n = 2; (n < MOST_PUT) && turn(false);
         n++) { /* clients all the time: until the area is full */
        record(1u, n, words);
        ht_log_ring_put(&ring, words);
        while (ring.writing) {
            (void)ht_log_ring_turn(&ring, true, false);
        }
    }
    CHECK(n > HT_LOG_SLOTS - 5u);
    CHECK(memory.erases[0] + memory.erases[1] == 0);
    CHECK(turn(true));
    CHECK(memory.erases[0] + memory.erases[1] == 1);
    CHECK(ring.events == HT_LOG_EVENTS);
}

/* One value alone, and none at all, go along with each change. */
static void values_go_along(void)
{
    unsigned which;
    for (which = 0; which < 3; which++) {
        unsigned changes = 3;
        forget_all();
        power_on();
        put_event();
        if (which < 2) {
            put_a_value(which);
        }
        while ((changes != 0) && (put_events < MOST_PUT)) {
            uint32_t before = ring.generation;
            put_event();
            changes -= (ring.generation != before) ? 1u : 0u;
        }
        everything_is_there();
        CHECK(ring.damaged == 0);
    }
}

/* What is no log is erased, not taken. */
static void foreign(void)
{
    unsigned k;
    for (k = 0; k < 3; k++) {
        unsigned n;
        forget_all();
        for (n = 0; n < AREA_WORDS; n++) {
            memory.programmed[0][n / HT_STORE_WORDS] = true;
            memory.word[0][n] = (uint16_t)((k == 0) ? 0u : ((k == 1) ? 0x1234u : (unsigned)rand()));
        }
        power_on();
        put_event();
        CHECK((kept_events == 1) && (memory.erases[0] == 1));
        everything_is_there();
    }
    forget_all();
    fill(3);
    memory.word[ring.area][1] = 2; /* another layout, sealed as it must be */
    {
        uint32_t crc = 0;
        uint16_t octets[2];
        for (k = 0; k < HT_LOG_PAYLOAD; k++) {
            ht_put16(octets, memory.word[ring.area][k]);
            crc = ht_crc32(crc, octets, 2);
        }
        memory.word[ring.area][HT_LOG_PAYLOAD] = (uint16_t)crc;
        memory.word[ring.area][HT_LOG_PAYLOAD + 1u] = (uint16_t)(crc >> 16);
    }
    kept_events = 0;
    CHECK(look(0) == 0);
}

/* Of two whole areas the later one counts, over the wrap of the generation as well. */
static void generations(void)
{
    static const uint32_t pairs[][3] = {
        {1, 2, 1}, {2, 1, 0}, {0xFFFFFFFFu, 0, 1}, {0, 0xFFFFFFFFu, 0}};
    unsigned k;
    for (k = 0; k < 4; k++) {
        unsigned area;
        erase_all();
        for (area = 0; area < 2; area++) {
            uint16_t *words = memory.word[area];
            uint32_t crc = 0;
            unsigned w;
            memset(words, 0, HT_LOG_WORDS * sizeof *words);
            words[0] = 0xFFFEu;
            words[1] = 1;
            words[2] = (uint16_t)pairs[k][area];
            words[3] = (uint16_t)(pairs[k][area] >> 16);
            for (w = 0; w < HT_LOG_PAYLOAD; w++) {
                uint16_t octets[2];
                ht_put16(octets, words[w]);
                crc = ht_crc32(crc, octets, 2);
            }
            words[HT_LOG_PAYLOAD] = (uint16_t)crc;
            words[HT_LOG_PAYLOAD + 1u] = (uint16_t)(crc >> 16);
        }
        power_on();
        (void)turn(false);
        CHECK(ring.area == pairs[k][2]);
    }
}

int main(void)
{
    srand(1);
    it_keeps_the_latest();
    power_fails(0);
    power_fails(1);
    a_damaged_record();
    damaged_before_a_change();
    writes_fail();
    wear();
    only_with_leave();
    values_go_along();
    foreign();
    generations();
    printf("%d failures\n", failures);
    return (failures == 0) ? 0 : 1;
}
