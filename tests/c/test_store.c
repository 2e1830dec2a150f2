/* The parameter store (ht_store.h) on a memory whose power fails and that gets damaged. A start
 * must take the former set, the new one or the built-in one, and never anything else. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "checks.h"
#include "ht_octets.h"
#include "ht_store.h"
#include "store_bench.h"
#ifdef HT_FAKE_FLASH
#include "fake_flash.h"
#define BEFORE_CASES 2 /* the register model is slow */
#else
#define BEFORE_CASES 4
#endif

#define LAST_BLOCK (1u + (HT_PARAMS + 3u) / 4u)
#define COPY_WORDS ((LAST_BLOCK + 1u) * HT_STORE_WORDS)

static ht_drive drive;
static ht_store store;
static ht_params defaults;

/* Values of a set that may change alone. They differ by `n`. */
static ht_params set_of(unsigned n)
{
    ht_params p = defaults;
    p.v[HT_P_rs_ohm] = 1.0f + 0.01f * (float)n;
    p.v[HT_P_dead_time_us] = 2.5f + 0.01f * (float)n;
    p.v[HT_P_kp_speed_Nms_rad] = 0.3f + 0.001f * (float)n;
    p.v[HT_PARAMS - 1] = defaults.v[HT_PARAMS - 1];
    return p;
}

static bool same(const ht_params *a, const ht_params *b)
{
    return memcmp(a, b, sizeof *a) == 0;
}

/* Power on. Returns the set that the drive has taken. */
static unsigned start(void)
{
    bench_power_on();
    memset(&drive, 0xA5, sizeof drive);
    ht_store_none(&store);
    store.port = bench_store();
    CHECK(ht_store_start(&store, &drive, &bench_chip, &defaults) == HT_OK);
    CHECK(drive.state == (uint16_t)HT_STATE_IDLE);
    CHECK(ht_port_tripped(&bench_chip, HT_ALL_LEGS));
    return store.set;
}

/* A drive with set `n` in force. */
static void use(unsigned n)
{
    ht_params p = set_of(n);
    CHECK(ht_drive_init(&drive, &bench_chip, &p) == HT_OK);
}

static void save(unsigned n)
{
    (void)start();
    use(n);
    CHECK(ht_store_save(&store, &drive) == HT_OK);
}

static bool starts_with(unsigned n)
{
    ht_params p = set_of(n);
    return (start() == HT_SET_SAVED) && same(&drive.params, &p);
}

/* The CRC and its complement in the mark, from the definition in ht_store.h. */
static void seal(unsigned area)
{
    uint32_t crc = 0;
    unsigned k;
    for (k = 0; k < COPY_WORDS - HT_STORE_WORDS; k++) {
        uint16_t octets[2];
        ht_put16(octets, *bench_word(area, k));
        crc = ht_crc32(crc, octets, 2);
    }
    *bench_word(area, COPY_WORDS - 8) = (uint16_t)crc;
    *bench_word(area, COPY_WORDS - 7) = (uint16_t)(crc >> 16);
    *bench_word(area, COPY_WORDS - 6) = (uint16_t)~crc;
    *bench_word(area, COPY_WORDS - 5) = (uint16_t)(~crc >> 16);
}

static void blank(unsigned area)
{
    unsigned k;
    for (k = 0; k < COPY_WORDS; k++) {
        *bench_word(area, k) = HT_STORE_ERASED;
    }
}

static void put_value(unsigned area, unsigned id, float value)
{
    uint32_t bits = ht_float_bits(value);
    *bench_word(area, HT_STORE_WORDS + 2 * id) = (uint16_t)bits;
    *bench_word(area, HT_STORE_WORDS + 2 * id + 1) = (uint16_t)(bits >> 16);
    seal(area);
}

static void keeps_and_forgets(void)
{
    ht_params p;
    bench_erase();
    CHECK((start() == HT_SET_DEFAULTS) && same(&drive.params, &defaults));
    save(1);
    CHECK(starts_with(1));
    save(2);
    save(3);
    CHECK(starts_with(3));
    CHECK(ht_store_forget(&store, &drive) == HT_OK);
    p = set_of(3);
    CHECK(same(&drive.params, &p)); /* what is in force stays */
    CHECK((start() == HT_SET_DEFAULTS) && same(&drive.params, &defaults));
    CHECK(ht_store_forget(&store, &drive) == HT_OK); /* nothing to forget is no error */
    save(4);
    CHECK(starts_with(4));
}

/* The references are commands, so they are not kept. */
static void references_are_not_kept(void)
{
    ht_params p = set_of(5);
    bench_erase();
    (void)start();
    p.v[HT_P_speed_ref_rpm] = 400.0f;
    p.v[HT_P_torque_ref_Nm] = 3.0f;
    CHECK(ht_drive_init(&drive, &bench_chip, &p) == HT_OK);
    CHECK(ht_store_save(&store, &drive) == HT_OK);
    CHECK(starts_with(5));
    CHECK(drive.params.v[HT_P_speed_ref_rpm] == 0.0f);
    CHECK(drive.params.v[HT_P_torque_ref_Nm] == 0.0f);
}

/* Operations of a save, and of a forget. */
#define SAVE_OPERATIONS (2u * (1u + LAST_BLOCK + 1u))
#define FORGET_OPERATIONS 2u
/* Under the address sanitizer each step takes 70 times as long, so only every 13th is taken there.
 * */
#ifdef __SANITIZE_ADDRESS__
#define STRIDE 13u
#else
#define STRIDE 1u
#endif

/* The contents before: 0 nothing, 1 a set, 2 a set whose save was cut between its copies, 3 a set
 * of which one copy is damaged. Set 10 is the valid one. */
static void before(unsigned which)
{
    bench_erase();
    if (which == 0) {
        return;
    }
    save(9);
    save(10);
    if (which == 2) {
        (void)start();
        use(10);
        bench.cut_at = SAVE_OPERATIONS / 2u + 3u;
        bench.style = CUT_RANDOM;
        if (setjmp(bench.off) == 0) {
            (void)ht_store_save(&store, &drive);
        }
    } else if (which == 3) {
        *bench_word(0, 20) ^= 4u;
    } else {
        /* as it is */
    }
}

static bool as_before(unsigned which)
{
    return (which == 0) ? ((start() != HT_SET_SAVED) && same(&drive.params, &defaults))
                        : starts_with(10);
}

static void power_fails_in_a_save(void)
{
    volatile unsigned which;
    volatile unsigned at;
    volatile unsigned style;
    for (which = 0; which < BEFORE_CASES; which++) {
        for (at = 1; at <= SAVE_OPERATIONS + 1; at += STRIDE) {
            for (style = 0; style < CUT_STYLES; style++) {
                volatile bool cut = true;
                bool old;
                before(which);
                (void)start();
                use(11);
                bench.cut_at = at;
                bench.style = style;
                if (setjmp(bench.off) == 0) {
                    CHECK(ht_store_save(&store, &drive) == HT_OK);
                    cut = false;
                }
                CHECK(cut == (at <= SAVE_OPERATIONS));
                old = as_before(which);
                CHECK(old || starts_with(11));
                /* The first copy is whole if its mark was written, and not before. */
                if ((at > SAVE_OPERATIONS / 2u)
                    || ((at == SAVE_OPERATIONS / 2u) && (style == CUT_COMPLETE))) {
                    CHECK(!old);
                } else if (at < SAVE_OPERATIONS / 2u) {
                    CHECK(old);
                } else {
                    /* either */
                }
                save(12);
                CHECK(starts_with(12));
            }
        }
    }
}

static void power_fails_in_a_forget(void)
{
    volatile unsigned at;
    volatile unsigned style;
    for (at = 1; at <= FORGET_OPERATIONS; at++) {
        for (style = 0; style < CUT_STYLES; style++) {
            before(1);
            (void)start();
            bench.cut_at = at;
            bench.style = style;
            if (setjmp(bench.off) == 0) {
                (void)ht_store_forget(&store, &drive);
                CHECK(false);
            }
            CHECK(starts_with(10)
                  || ((store.set != HT_SET_SAVED) && same(&drive.params, &defaults)));
            CHECK((at == 2) || starts_with(10)); /* the latest copy goes last */
            save(11);
            CHECK(starts_with(11));
        }
    }
}

/* If the memory fails, the caller gets an error, and one whole set is there. */
static void writing_fails(void)
{
    unsigned at;
    for (at = 1; at <= SAVE_OPERATIONS; at++) {
        before(1);
        (void)start();
        use(11);
        bench.fail_at = at;
        CHECK(ht_store_save(&store, &drive) == HT_ERROR_STORE);
        CHECK(starts_with(10) || starts_with(11));
    }
    for (at = 1; at <= FORGET_OPERATIONS; at++) {
        before(1);
        (void)start();
        bench.fail_at = at;
        CHECK(ht_store_forget(&store, &drive) == HT_ERROR_STORE);
    }
}

static void every_bit_counts(void)
{
    unsigned word;
    unsigned bit;
    ht_params p;
    bench_erase();
    save(10);
    for (word = 0; word < COPY_WORDS; word += STRIDE) {
        for (bit = 0; bit < 16; bit++) {
            *bench_word(1, word) ^= (uint16_t)(1u << bit);
            CHECK(ht_store_load(&store, &p) == HT_SET_SAVED); /* the other copy */
            *bench_word(1, word) ^= (uint16_t)(1u << bit);
        }
    }
    CHECK(starts_with(10));
    blank(1);
    CHECK(starts_with(10));
    for (word = 0; word < COPY_WORDS; word += STRIDE) {
        for (bit = 0; bit < 16; bit++) {
            *bench_word(0, word) ^= (uint16_t)(1u << bit);
            CHECK(ht_store_load(&store, &p) == HT_SET_DAMAGED);
            *bench_word(0, word) ^= (uint16_t)(1u << bit);
        }
    }
    *bench_word(0, 20) ^= 1u;
    CHECK((start() == HT_SET_DAMAGED) && same(&drive.params, &defaults));
    save(11);
    *bench_word(0, 20) ^= 1u;
    *bench_word(1, 40) ^= 1u;
    CHECK((start() == HT_SET_DAMAGED) && same(&drive.params, &defaults));
}

static void sequence_wraps(void)
{
    unsigned area;
    unsigned first;
    bench_erase();
    save(10);
    for (area = 0; area < 2; area++) {
        *bench_word(area, 6) = 0xFFFFu;
        *bench_word(area, 7) = 0xFFFFu;
        seal(area);
    }
    CHECK(starts_with(10));
    use(11);
    bench.cut_at = SAVE_OPERATIONS / 2u + 1u; /* one copy is new: number 0 */
    bench.style = CUT_NOTHING;
    if (setjmp(bench.off) == 0) {
        (void)ht_store_save(&store, &drive);
    }
    first = (*bench_word(0, 7) == 0u) ? 0u : 1u;
    CHECK((*bench_word(first, 6) == 0u) && (*bench_word(1u - first, 6) == 0xFFFFu));
    CHECK(starts_with(11));
    save(12);
    CHECK(starts_with(12));
}

static void foreign(void)
{
    static const float bad[] = {-1.0f, 1.0e9f};
    unsigned k;
    bench_erase();
    save(10);
    blank(1);
    *bench_word(0, 4) ^= 1u; /* another table */
    seal(0);
    CHECK((start() == HT_SET_FOREIGN) && same(&drive.params, &defaults));
    *bench_word(0, 4) ^= 1u;
    seal(0);
    CHECK(starts_with(10));
    for (k = 0; k < 2; k++) { /* a range that was wider before */
        put_value(0, HT_P_rs_ohm, bad[k]);
        CHECK((start() == HT_SET_FOREIGN) && same(&drive.params, &defaults));
    }
    put_value(0, HT_P_rs_ohm, ht_float_of(0x7FC00000u)); /* NaN */
    CHECK((start() == HT_SET_FOREIGN) && same(&drive.params, &defaults));
    put_value(0, HT_P_rs_ohm, 1.1f);
    put_value(0, HT_P_scheme, 1.5f); /* no choice */
    CHECK(start() == HT_SET_FOREIGN);
    put_value(0, HT_P_scheme, 4.0f);
    CHECK(starts_with(10));
    put_value(0, HT_P_vdc_min_V, defaults.v[HT_P_vdc_max_V]); /* does not fit the others */
    CHECK((start() == HT_SET_FOREIGN) && same(&drive.params, &defaults));
    put_value(0, HT_P_vdc_min_V, defaults.v[HT_P_vdc_min_V]);
    CHECK(starts_with(10));
    /* Fewer values, as an older table had them: whole, but not this one's. */
    *bench_word(0, 3) = HT_PARAMS - 4u;
    for (k = 0; k < HT_STORE_WORDS; k++) { /* the mark is a block earlier */
        *bench_word(0, COPY_WORDS - 2 * HT_STORE_WORDS + k) =
            *bench_word(0, COPY_WORDS - HT_STORE_WORDS + k);
    }
    CHECK(start() == HT_SET_DAMAGED); /* the CRC is another set's */
    /* A later copy of another table beside an older one of this table: the older one must not
     * return. */
    save(10);
    *bench_word(1, 4) ^= 1u;
    *bench_word(1, 6) = (uint16_t)(*bench_word(0, 6) + 1u);
    seal(1);
    CHECK(start() == HT_SET_FOREIGN);
    /* A number of values that no area holds. */
    save(10);
    blank(1);
    for (k = HT_PARAMS + 1u; k < 0x10000u; k = k * 2u + 1u) {
        *bench_word(0, 3) = (uint16_t)k;
        CHECK(start() == HT_SET_DAMAGED);
    }
}

static void only_with_the_gates_off(void)
{
    unsigned state;
    ht_store none;
    bench_erase();
    save(10);
    (void)start();
    use(11);
    for (state = 0; state < HT_STATES; state++) {
        bool off = (state == HT_STATE_IDLE) || (state == HT_STATE_FAULT);
        drive.state = (uint16_t)state;
        bench.operations = 0;
        if (!off) {
            CHECK(ht_store_save(&store, &drive) == HT_ERROR_STATE);
            CHECK(ht_store_forget(&store, &drive) == HT_ERROR_STATE);
            CHECK(bench.operations == 0u);
        }
    }
    CHECK(starts_with(10));
    use(11);
    drive.state = (uint16_t)HT_STATE_FAULT;
    CHECK(ht_store_save(&store, &drive) == HT_OK);
    CHECK(starts_with(11));
    ht_store_none(&none);
    CHECK(ht_store_save(&none, &drive) == HT_ERROR_STORE);
    CHECK(ht_store_forget(&none, &drive) == HT_ERROR_STORE);
    CHECK(ht_store_start(&none, &drive, &bench_chip, &defaults) == HT_OK);
    CHECK((none.set == HT_SET_DEFAULTS) && same(&drive.params, &defaults));
    none.port = bench_store();
    none.port.blocks = LAST_BLOCK; /* one too few */
    CHECK(ht_store_save(&none, &drive) == HT_ERROR_STORE);
}

#ifdef HT_FAKE_FLASH
/* The chip's side: the calls of TI's API, and the state of the chip after them. */
static void the_chip(void)
{
    const ht_regfile *chip = fake_flash_chip;
    unsigned at;
    bench_erase();
    fake_flash_slow = true;
    save(10);
    CHECK(chip->time_us > 100000u); /* a save takes time, and the watchdog is serviced */
    CHECK(chip->intm == 0u);        /* interrupts are let through again */
    CHECK(chip->eallow == 0u);
    CHECK(chip->dog_resets == 0u);
    CHECK(chip->violations == 0u);
    CHECK(fake_flash_rest_is_untouched());
    if (fake_flash_broken != 0u) {
        printf("%u rules broken, the latest: %s\n", fake_flash_broken, fake_flash_rule);
    }
    CHECK(fake_flash_broken == 0u);
    /* One that failed, and the next one. */
    for (at = 1; at < 4u; at++) {
        bench.operations = 0;
        bench.fail_at = at;
        CHECK(ht_store_save(&store, &drive) == HT_ERROR_STORE);
        CHECK(ht_store_save(&store, &drive) == HT_OK);
    }
    /* An erase that never ends: the caller gets its refusal. */
    fake_flash_stuck = bench_board->map->device == HT_DEVICE_f28377s;
    if (fake_flash_stuck) {
        CHECK(ht_store_save(&store, &drive) == HT_ERROR_STORE);
        CHECK(chip->dog_resets == 0u);
        fake_flash_stuck = false;
        CHECK(starts_with(10));
    }
    /* No block outside of the area. */
    (void)start();
    bench.operations = 0;
    CHECK(!store.port.write(store.port.at, 0, store.port.blocks, NULL));
    CHECK(!store.port.write(store.port.at, HT_STORE_AREAS, 0, NULL));
    CHECK(bench.operations == 0u);
}
#endif

int main(void)
{
    srand(1);
    ht_params_default(&defaults);
    keeps_and_forgets();
    references_are_not_kept();
    power_fails_in_a_save();
    power_fails_in_a_forget();
    writing_fails();
    every_bit_counts();
    sequence_wraps();
    foreign();
    only_with_the_gates_off();
#ifdef HT_FAKE_FLASH
    the_chip();
#endif
    printf("%d failures\n", failures);
    return (failures == 0) ? 0 : 1;
}
