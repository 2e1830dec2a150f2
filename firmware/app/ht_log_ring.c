#include "ht_log_ring.h"

#include <stddef.h>

#include "ht_octets.h"

#define MARK 0xFFFEu /* no record: its high octet is set as well */
#define LAYOUT 1u
#define KIND 0x00FFu
#define TRIES 3u      /* of a change of the area */
#define SPARE_PART 8u /* the area changes when fewer slots than this part of it are left */
#define MANY 0xFFFFu

enum { PHASE_NONE, PHASE_MARKS, PHASE_READ, PHASE_BLANK, PHASE_READY, PHASE_ERASE, PHASE_COPY };

static uint32_t word32(const uint16_t *words)
{
    return (uint32_t)words[0] | ((uint32_t)words[1] << 16);
}

static void put_word32(uint16_t *words, uint32_t value)
{
    words[0] = (uint16_t)(value & 0xFFFFu);
    words[1] = (uint16_t)(value >> 16);
}

static uint32_t sum(const uint16_t *words)
{
    uint32_t crc = 0u;
    uint16_t octets[2];
    uint16_t k;
    for (k = 0u; k < HT_LOG_PAYLOAD; k++) {
        ht_put16(octets, words[k]);
        crc = ht_crc32(crc, octets, 2u);
    }
    return crc;
}

static void seal(uint16_t *words)
{
    put_word32(&words[HT_LOG_PAYLOAD], sum(words));
}

static bool is_whole(const uint16_t *words)
{
    return word32(&words[HT_LOG_PAYLOAD]) == sum(words);
}

static bool is_blank(const uint16_t *words)
{
    uint16_t k;
    for (k = 0u; k < HT_LOG_WORDS; k++) {
        if (words[k] != HT_STORE_ERASED) {
            return false;
        }
    }
    return true;
}

static bool read_slot(const ht_log_ring *r, uint16_t area, uint16_t slot, uint16_t *words)
{
    bool good = true;
    uint16_t b;
    for (b = 0u; good && (b < HT_LOG_BLOCKS); b++) {
        good = r->port.read(r->port.at, area, (uint16_t)((slot * HT_LOG_BLOCKS) + b),
                            &words[b * HT_STORE_WORDS]);
    }
    return good;
}

static void count_damaged(ht_log_ring *r)
{
    r->damaged = (r->damaged < MANY) ? (uint16_t)(r->damaged + 1u) : (uint16_t)MANY;
}

/* Write the next block of `slot` into a slot of `area`. After the last one: does it read back? Returns
 * false if it failed; then, and after the last block, `block` is 0 again. */
static bool write_next(ht_log_ring *r, uint16_t area, uint16_t slot)
{
    bool good = r->port.write(r->port.at, area, (uint16_t)((slot * HT_LOG_BLOCKS) + r->block),
                              &r->slot[r->block * HT_STORE_WORDS]);
    r->block++;
    if (good && (r->block == HT_LOG_BLOCKS)) {
        uint16_t there[HT_LOG_WORDS];
        uint16_t k;
        good = read_slot(r, area, slot, there);
        for (k = 0u; good && (k < HT_LOG_WORDS); k++) {
            good = there[k] == r->slot[k];
        }
    }
    if (!good || (r->block == HT_LOG_BLOCKS)) {
        r->block = 0u;
    }
    return good;
}

/* --- what is where --------------------------------------------------------------------------- */

static void drop_event(ht_log_ring *r, uint16_t row)
{
    uint16_t k;
    for (k = (uint16_t)(row + 1u); k < r->events; k++) {
        r->index[k - 1u] = r->index[k];
    }
    r->events--;
}

/* A record of this kind is in this slot. */
static void note(ht_log_ring *r, uint16_t word, uint16_t slot)
{
    uint16_t kind = (uint16_t)(word & KIND);
    if (kind >= (HT_LOG_VALUE_FIRST + HT_LOG_VALUES)) {
        return; /* of a later firmware */
    }
    if (kind >= HT_LOG_VALUE_FIRST) {
        r->value[kind - HT_LOG_VALUE_FIRST] = slot;
        return;
    }
    if (r->events == HT_LOG_EVENTS) {
        drop_event(r, 0u);
    }
    r->index[r->events] = slot;
    r->events++;
}

static void clear(ht_log_ring *r)
{
    uint16_t k;
    r->events = 0u;
    for (k = 0u; k < HT_LOG_VALUES; k++) {
        r->value[k] = 0u;
    }
}

/* --- reading ---------------------------------------------------------------------------------- */

static bool is_mark(const uint16_t *words)
{
    return is_whole(words) && (words[0] == MARK) && (words[1] == LAYOUT);
}

/* Which area is in use? Without one, the first is to become it. */
static void read_marks(ht_log_ring *r)
{
    uint32_t generation[HT_STORE_AREAS];
    bool whole[HT_STORE_AREAS];
    uint16_t area;
    for (area = 0u; area < HT_STORE_AREAS; area++) {
        if (!read_slot(r, area, 0u, r->slot)) {
            r->phase = (uint16_t)PHASE_NONE; /* it may be whole: nothing is erased */
            return;
        }
        whole[area] = is_mark(r->slot);
        generation[area] = word32(&r->slot[2]);
    }
    if (whole[0] && whole[1]) {
        whole[0] = (generation[0] - generation[1]) < 0x80000000u;
    }
    if (whole[0] || whole[1]) {
        r->area = (uint16_t)(whole[0] ? 0u : 1u);
        r->generation = generation[r->area];
        r->next = 1u;
        r->at = 1u;
        r->phase = (uint16_t)PHASE_READ;
    } else {
        r->area = 1u; /* the other one becomes it */
        r->next = r->slots;
        r->at = 0u;
        r->phase = (uint16_t)PHASE_BLANK;
    }
}

static ht_log_turned read_next(ht_log_ring *r)
{
    uint16_t slot = r->at;
    ht_log_turned turned = HT_LOG_BUSY;
    if (slot == r->slots) {
        r->phase = (uint16_t)PHASE_READY;
        return turned;
    }
    r->at++;
    if (!read_slot(r, r->area, slot, r->slot)) {
        count_damaged(r);
        r->next = r->at;
    } else if (is_blank(r->slot)) {
        /* not written yet */
    } else {
        r->next = r->at;
        if (is_whole(r->slot)) {
            note(r, r->slot[0], slot);
            turned = HT_LOG_FOUND;
        } else {
            count_damaged(r);
        }
    }
    return turned;
}

/* A new chip's areas need no erase. */
static void look_for_blank(ht_log_ring *r)
{
    if (r->at == r->slots) {
        r->at = 0u;
        r->phase = (uint16_t)PHASE_COPY;
    } else if (!read_slot(r, 0u, r->at, r->slot)) {
        r->phase = (uint16_t)PHASE_NONE;
    } else if (is_blank(r->slot)) {
        r->at++;
    } else {
        r->phase = (uint16_t)PHASE_ERASE;
    }
}

/* --- writing ---------------------------------------------------------------------------------- */

static void change_failed(ht_log_ring *r)
{
    r->failed++;
    r->block = 0u;
    r->phase = (r->failed < TRIES) ? (uint16_t)PHASE_ERASE : (uint16_t)PHASE_NONE;
}

static uint16_t other(const ht_log_ring *r)
{
    return (r->area == 0u) ? 1u : 0u;
}

/* Slot of the record number `at` of those that are kept; 0: there is none. */
static uint16_t kept_slot(const ht_log_ring *r, uint16_t at)
{
    return (at < r->events) ? r->index[at] : r->value[at - r->events];
}

/* The record number `at` cannot be read any more. */
static void drop(ht_log_ring *r, uint16_t at)
{
    count_damaged(r);
    if (at < r->events) {
        drop_event(r, at);
    } else {
        r->value[at - r->events] = 0u;
    }
}

/* Everything is in the other area: it is in use from now on. */
static void change(ht_log_ring *r)
{
    uint16_t k;
    r->next = 1u;
    for (k = 0u; k < r->events; k++) {
        r->index[k] = r->next;
        r->next++;
    }
    for (k = 0u; k < HT_LOG_VALUES; k++) {
        if (r->value[k] != 0u) {
            r->value[k] = r->next;
            r->next++;
        }
    }
    r->area = other(r);
    r->generation++;
    r->failed = 0u;
    r->phase = (uint16_t)PHASE_READY;
}

static void make_mark(ht_log_ring *r)
{
    uint16_t k;
    for (k = 0u; k < HT_LOG_PAYLOAD; k++) {
        r->slot[k] = 0u;
    }
    r->slot[0] = MARK;
    r->slot[1] = LAYOUT;
    put_word32(&r->slot[2], r->generation + 1u);
    seal(r->slot);
}

/* The slot in the other area where the record number `at` goes. */
static uint16_t place(const ht_log_ring *r, uint16_t at)
{
    uint16_t slot = (uint16_t)(at + 1u);
    uint16_t k;
    for (k = 0u; (r->events + k) < at; k++) {
        slot = (r->value[k] == 0u) ? (uint16_t)(slot - 1u) : slot;
    }
    return slot;
}

/* A block of what is kept, and of the mark after it. */
static void copy_next(ht_log_ring *r)
{
    uint16_t records = (uint16_t)(r->events + HT_LOG_VALUES);
    bool mark = r->at == records;
    if (r->block == 0u) {
        if (mark) {
            make_mark(r);
        } else if (kept_slot(r, r->at) == 0u) {
            r->at++;
            return;
        } else if (!read_slot(r, r->area, kept_slot(r, r->at), r->slot) || !is_whole(r->slot)) {
            drop(r, r->at);
            return;
        } else {
            /* it is there */
        }
    }
    if (!write_next(r, other(r), mark ? 0u : place(r, r->at))) {
        change_failed(r);
    } else if (r->block != 0u) {
        /* more blocks */
    } else if (mark) {
        change(r);
    } else {
        r->at++;
    }
}

static void erase(ht_log_ring *r)
{
    r->block = 0u;
    r->at = 0u;
    if (r->port.write(r->port.at, other(r), 0u, NULL)) {
        r->phase = (uint16_t)PHASE_COPY;
    } else {
        change_failed(r);
    }
}

static ht_log_turned ready(ht_log_ring *r, bool may_write, bool may_erase)
{
    uint16_t left = (uint16_t)(r->slots - r->next);
    if (r->writing) {
        if (!may_write) {
            return HT_LOG_BUSY;
        }
        r->kept = write_next(r, r->area, r->next);
        if (!r->kept || (r->block == 0u)) {
            r->writing = false;
            if (r->kept) {
                note(r, r->slot[0], r->next);
            } else {
                count_damaged(r);
            }
            r->next++;
        }
        return HT_LOG_BUSY;
    }
    if ((left == 0u) || (may_erase && (left < (r->slots / SPARE_PART)))) {
        r->phase = (uint16_t)PHASE_ERASE;
        return HT_LOG_BUSY;
    }
    return HT_LOG_FREE;
}

ht_log_turned ht_log_ring_turn(ht_log_ring *r, bool may_write, bool may_erase)
{
    ht_log_turned turned = HT_LOG_BUSY;
    switch (r->phase) {
    case PHASE_MARKS:
        read_marks(r);
        break;
    case PHASE_READ:
        turned = read_next(r);
        break;
    case PHASE_BLANK:
        look_for_blank(r);
        break;
    case PHASE_READY:
        turned = ready(r, may_write, may_write && may_erase);
        break;
    case PHASE_ERASE:
        if (may_write && may_erase) {
            erase(r);
        }
        break;
    case PHASE_COPY:
        if (may_write) {
            copy_next(r);
        }
        break;
    case PHASE_NONE:
    default:
        turned = HT_LOG_NO_MEMORY;
        break;
    }
    return turned;
}

void ht_log_ring_put(ht_log_ring *r, const uint16_t *words)
{
    uint16_t k;
    for (k = 0u; k < HT_LOG_PAYLOAD; k++) {
        r->slot[k] = words[k];
    }
    seal(r->slot);
    r->block = 0u;
    r->kept = false;
    r->writing = true;
}

bool ht_log_ring_settled(const ht_log_ring *r)
{
    return (r->phase == (uint16_t)PHASE_READY) || (r->phase == (uint16_t)PHASE_ERASE)
           || (r->phase == (uint16_t)PHASE_NONE);
}

void ht_log_ring_empty(ht_log_ring *r, uint16_t but)
{
    while (r->events > but) {
        drop_event(r, 0u);
    }
}

bool ht_log_ring_works(const ht_log_ring *r)
{
    return r->phase != (uint16_t)PHASE_NONE;
}

bool ht_log_ring_read(const ht_log_ring *r, uint16_t row, uint16_t *words)
{
    return (row < r->events) && read_slot(r, r->area, r->index[row], words) && is_whole(words);
}

void ht_log_ring_none(ht_log_ring *r)
{
    r->port.read = NULL;
    r->port.write = NULL;
    r->port.at = NULL;
    r->port.blocks = 0u;
    ht_log_ring_start(r);
}

void ht_log_ring_start(ht_log_ring *r)
{
    r->slots = (uint16_t)(r->port.blocks / HT_LOG_BLOCKS);
    r->phase = ((r->port.read != NULL) && (r->slots >= HT_LOG_SLOTS)) ? (uint16_t)PHASE_MARKS
                                                                      : (uint16_t)PHASE_NONE;
    r->area = 0u;
    r->next = 0u;
    r->at = 0u;
    r->block = 0u;
    r->failed = 0u;
    r->generation = 0u;
    r->damaged = 0u;
    r->writing = false;
    r->kept = false;
    clear(r);
}
