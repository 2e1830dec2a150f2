/* Fuzz target: everything behind the line (firmware/app/ht_service*.c, ht_dictionary.c,
 * firmware/link) with the drive and the register model below it.
 *
 * The first octet of an input says where it begins (rig.h). The others are a program of steps:
 * octets from the line, time, values of the sensors. The low half of a step's octet is its kind.
 * With 0x10 set, requests wait on the line, else the rig has them answered.
 */
#include <string.h>

#include "check.h"
#include "rig.h"
#include "rules.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define STEPS 64u

/* The remaining input. Behind its end there are zeros. */
typedef struct {
    const uint8_t *at;
    size_t left;
} tape;

static uint8_t next(tape *t)
{
    if (t->left == 0) {
        return 0;
    }
    t->left--;
    return *t->at++;
}

static uint16_t next16(tape *t)
{
    uint16_t low = next(t);
    return (uint16_t)(low | (next(t) << 8));
}

/* Up to `most` octets. The next octet says how many. */
static size_t octets(tape *t, const uint8_t **at, size_t most)
{
    size_t n = next(t);
    n = (n < most) ? n : most;
    n = (n < t->left) ? n : t->left;
    *at = t->at;
    t->at += n;
    t->left -= n;
    return n;
}

/* Values within their ranges, so that some of them fit together. */
static void write_valid(tape *t)
{
    uint8_t pairs[4 * 6];
    size_t n = 1u + next(t) % 4u;
    size_t k;
    for (k = 0; k < n; k++) {
        uint16_t id = (uint16_t)(next(t) % ht_param_count());
        uint8_t where = next(t);
        const ht_param_info *info = ht_param_describe(id);
        float value = info->min + (info->max - info->min) * ((float)where / 255.0f);
        if (where % 4u == 1u) {
            value = info->initial * (0.5f + (float)where / 255.0f);
        }
        if (info->whole) {
            value = (float)(int)value;
        }
        pairs[6 * k] = (uint8_t)id;
        pairs[6 * k + 1] = (uint8_t)(id >> 8);
        memcpy(&pairs[6 * k + 2], &value, 4);
    }
    rig_ask(0x07, RIG_NONCE, pairs, 6 * n);
}

static void put32(uint8_t *at, uint32_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
    at[2] = (uint8_t)(value >> 16);
    at[3] = (uint8_t)(value >> 24);
}

/* A capture of a valid length with any other values. */
static void arm(tape *t)
{
    uint8_t set_up[18 + 2 * 17] = {0};
    float level = (float)(int8_t)next(t);
    unsigned k;
    set_up[0] = (uint8_t)(next(t) % 18u);
    set_up[1] = (uint8_t)(next(t) % 8u);
    set_up[2] = (uint8_t)(next(t) % 5u);
    put32(&set_up[4], next(t) % 100u);
    put32(&set_up[8], next(t) % 100u);
    set_up[12] = (uint8_t)(next(t) % (ht_channel_count() + 1u));
    memcpy(&set_up[14], &level, 4);
    for (k = 0; k < set_up[0]; k++) {
        set_up[18 + 2 * k] = (uint8_t)(next(t) % ht_channel_count());
    }
    rig_ask(0x0C, RIG_NONCE, set_up, 18u + 2u * set_up[0]);
}

static void stream(tape *t)
{
    uint8_t set_up[4 + 2 * 33] = {0};
    unsigned k;
    set_up[0] = (uint8_t)(next(t) % 5u);
    set_up[1] = (uint8_t)(next(t) % 34u);
    set_up[2] = next(t);
    set_up[3] = (uint8_t)(next(t) % 2u);
    for (k = 0; k < set_up[1]; k++) {
        set_up[4 + 2 * k] = (uint8_t)(next(t) % ht_channel_count());
    }
    rig_ask(0x0B, RIG_NONCE, set_up, 4u + 2u * set_up[1]);
}

static void debugger(unsigned what)
{
    switch (what % 4u) {
    case 0:
        rules_debugger_starts(ht_drive_start(&the_rig.drive) == HT_OK);
        break;
    case 1:
        ht_drive_stop(&the_rig.drive);
        break;
    case 2:
        (void)ht_drive_clear(&the_rig.drive);
        break;
    default:
        rig_trip_pin(0u);
        rig_trip_pin(1u);
        break;
    }
    rig_fast();
}

static void switches(unsigned which)
{
    the_rig.isr_in_read = (which & 1u) != 0;
    the_rig.isr_in_write = (which & 2u) != 0;
    the_rig.lost = (which & 4u) != 0;
    rig_trip_pin((which & 8u) == 0);
}

static void repeat(unsigned n, void (*what)(void))
{
    for (; n != 0; n--) {
        what();
    }
}

static void step(tape *t)
{
    uint8_t what = next(t);
    uint8_t opcode;
    const uint8_t *at;
    size_t n;
    switch (what & 0xFu) {
    case 0:
        n = octets(t, &at, 255);
        rig_put(at, n);
        break;
    case 1:
        n = octets(t, &at, 255);
        if (n != 0) {
            rig_put_body(at, n);
        }
        break;
    case 2:
        opcode = next(t);
        n = octets(t, &at, 255);
        rig_ask(opcode, RIG_NONCE, at, n);
        break;
    case 3:
        the_rig.id--; /* the same octets, if it is the same request */
        opcode = next(t);
        n = octets(t, &at, 255);
        rig_ask(opcode, RIG_NONCE, at, n);
        break;
    case 4:
        repeat(1u + next(t) % 32u, rig_fast);
        break;
    case 5:
        repeat(1u + next(t) % 32u, rig_turn);
        break;
    case 6:
        the_rig.room = next(t);
        break;
    case 7:
        opcode = next(t);
        rig_sense(opcode % 8u, next16(t));
        break;
    case 8:
        switches(next(t));
        break;
    case 9:
        rig_slow();
        break;
    case 10:
        write_valid(t);
        break;
    case 11:
        arm(t);
        break;
    case 12:
        stream(t);
        break;
    case 13:
        debugger(next(t));
        break;
    case 14:
        opcode = next(t);
        rig_ask(opcode, next16(t), t->at, 0);
        break;
    default:
        opcode = next(t); /* time passes for both */
        for (n = 0; n < 1u + opcode % 32u; n++) {
            rig_fast();
            rig_turn();
        }
        break;
    }
    if ((what & 0x10u) == 0) {
        rig_settle();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    tape t = {data, size};
    unsigned k;
    rig_begin(next(&t));
    for (k = 0; (k < STEPS) && (t.left != 0); k++) {
        step(&t);
    }
    rig_settle();
    rules_parameters();
    return 0;
}
