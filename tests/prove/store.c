/* The parameter set in a memory that may hold anything, and fail at any access. */
#include "ht_contracts.h"
#include "ht_store.c"
#include "prove.h"

/* Of an area: a set and some more. */
#define BLOCKS ((uint16_t)((uint16_t)HT_PARAMS / 4u + 4u))

#define BEFORE_THE_MARK ((uint16_t)(blocks_of(HT_PARAMS) - 1u))

static uint16_t asked_area; /* of the latest read */
static uint16_t erased[2];  /* areas, in order */
static uint16_t erasures;
static uint16_t written; /* blocks since the area was erased */
static uint16_t read_back;
static bool every_block_is_back;

uint32_t ht_crc32(uint32_t crc, const uint16_t *octets, uint16_t n)
{
    return nondet_uint32();
}

static bool read(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    uint16_t k;
    MUST((area < HT_STORE_AREAS) && (block < BLOCKS));
    for (k = 0u; k < HT_STORE_WORDS; k++) {
        words[k] = nondet_uint16();
    }
    asked_area = area;
    return nondet_bool();
}

static uint32_t promise_version_of_table(void)
{
    return 0x12345678u; /* one value at all times */
}

static uint32_t promise_sum_block(uint32_t crc, const uint16_t *words)
{
    return nondet_uint32();
}

/* As prove_store_whole shows it. */
static void promise_look(const ht_store_port *port, uint16_t area, ht_copy *copy)
{
    MUST(area < HT_STORE_AREAS);
    copy->state = nondet_uint16();
    copy->count = nondet_uint16();
    copy->table = nondet_uint32();
    copy->sequence = nondet_uint32();
    GIVEN(copy->state <= (uint16_t)COPY_DAMAGED);
}

static const ht_store_port port = {read, NULL, NULL, BLOCKS};

/* Whatever the memory holds. */
void prove_store_whole(void)
{
    static ht_params p;
    ht_copy copy;
    uint16_t area = nondet_uint16();
    bool whole;
    GIVEN(area < HT_STORE_AREAS);
    whole = is_whole(&port, area, &copy, nondet_bool() ? &p : NULL);
    MUST(IMPLIES(whole, blocks_of(copy.count) <= BLOCKS));
    MUST(IMPLIES(whole, asked_area == area));
}

void prove_store_latest(void)
{
    ht_copy copies[HT_STORE_AREAS];
    uint16_t area;
    bool both;
    copies[0].state = nondet_uint16();
    copies[1].state = nondet_uint16();
    copies[0].sequence = nondet_uint32();
    copies[1].sequence = copies[0].sequence;
    both = (copies[0].state == (uint16_t)COPY_WHOLE) && (copies[1].state == (uint16_t)COPY_WHOLE);
    if (nondet_bool()) { /* power failed after the second copy was made */
        copies[1].sequence++;
        area = latest(copies);
        MUST(IMPLIES(both, area == 1u));
    } else if (nondet_bool()) {
        copies[0].sequence++;
        area = latest(copies);
        MUST(IMPLIES(both, area == 0u));
    } else {
        area = latest(copies);
    }
    MUST(area <= NO_AREA);
    MUST(IMPLIES(area < NO_AREA, copies[area].state == (uint16_t)COPY_WHOLE));
    MUST(IMPLIES(area == NO_AREA, (copies[0].state != (uint16_t)COPY_WHOLE)
                                      && (copies[1].state != (uint16_t)COPY_WHOLE)));
}

static bool write_block(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    MUST(area < HT_STORE_AREAS);
    if (words == NULL) {
        written = 0u;
        read_back = 0u;
        every_block_is_back = false;
    } else {
        MUST(block == written); /* each once, one after the other */
        written++;
        /* The mark, which makes the copy whole, only after all of it was read. */
        MUST(IMPLIES(block == BEFORE_THE_MARK, every_block_is_back));
    }
    return nondet_bool();
}

static bool promise_reads_back(const ht_store_port *of, uint16_t area, uint16_t block,
                               const uint16_t *words)
{
    bool same = nondet_bool();
    MUST(block < written);
    if (same && (block == read_back)) {
        read_back++;
        every_block_is_back = every_block_is_back || (read_back == BEFORE_THE_MARK);
    }
    return same;
}

void prove_store_copy(void)
{
    static ht_params p;
    const ht_store_port memory = {read, write_block, NULL, BLOCKS};
    uint16_t area = nondet_uint16();
    bool good;
    GIVEN(area < HT_STORE_AREAS);
    good = write_copy(&memory, area, nondet_uint32(), &p);
    MUST(IMPLIES(good, (written == blocks_of(HT_PARAMS)) && every_block_is_back));
}

/* Both copies are written anew, that of the set in force last, and only after the other one is
 * whole. */
static bool promise_write_copy(const ht_store_port *of, uint16_t area, uint32_t sequence,
                               const ht_params *p)
{
    bool good = nondet_bool();
    MUST(area < HT_STORE_AREAS);
    MUST(erasures < 2u);
    erased[erasures] = area;
    erasures++;
    written = good ? 1u : 0u;
    return good;
}

void prove_store_save(void)
{
    static ht_drive d;
    ht_store s;
    ht_copy copies[HT_STORE_AREAS];
    uint16_t first = 2u;
    ht_result result;
    s.port = port;
    d.state = nondet_uint16();
    if (nondet_bool()) {
        result = may_write(&s, &d, copies, &first);
        MUST(IMPLIES(result == HT_OK, (first < 2u) && (first != latest(copies))));
        MUST(IMPLIES(result == HT_OK, (d.state == (uint16_t)HT_STATE_IDLE)
                                          || (d.state == (uint16_t)HT_STATE_FAULT)));
        return;
    }
    result = ht_store_save(&s, &d);
    MUST(IMPLIES(result == HT_OK, (erasures == 2u) && (erased[0] != erased[1]) && (written == 1u)));
    MUST(IMPLIES((result != HT_OK) && (erasures == 2u), written == 0u));
    MUST(IMPLIES(erasures > 0u,
                 (d.state == (uint16_t)HT_STATE_IDLE) || (d.state == (uint16_t)HT_STATE_FAULT)));
}
