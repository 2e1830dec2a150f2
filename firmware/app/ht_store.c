#include "ht_store.h"

#include <stddef.h>

#include "ht_octets.h"

#define MAGIC_0 0x5448u /* "HT" */
#define MAGIC_1 0x5350u /* "PS" */
#define LAYOUT 1u
#define VALUES_A_BLOCK 4u
#define FIXED 4u /* words at the end of the mark */
#define NO_AREA HT_STORE_AREAS

static const uint16_t mark[FIXED] = {0x5AA5u, 0xC33Cu, 0x0FF0u, 0x9669u};

/* The content of an area. */
enum { COPY_BLANK, COPY_WHOLE, COPY_DAMAGED };
typedef struct {
    uint16_t state;
    uint16_t count; /* of values */
    uint32_t table;
    uint32_t sequence;
} ht_copy;

static uint32_t word32(const uint16_t *words)
{
    return (uint32_t)words[0] | ((uint32_t)words[1] << 16);
}

static void put_word32(uint16_t *words, uint32_t value)
{
    words[0] = (uint16_t)(value & 0xFFFFu);
    words[1] = (uint16_t)(value >> 16);
}

static uint32_t sum_block(uint32_t crc, const uint16_t *words)
{
    uint16_t octets[2u * HT_STORE_WORDS];
    uint16_t k;
    for (k = 0u; k < HT_STORE_WORDS; k++) {
        ht_put16(&octets[2u * k], words[k]);
    }
    return ht_crc32(crc, octets, 2u * HT_STORE_WORDS);
}

static uint32_t sum_text(uint32_t crc, const char *text)
{
    uint32_t sum = crc;
    uint16_t k = 0u;
    uint16_t octet;
    do { /* the zero at its end as well */
        octet = (uint16_t)text[k];
        sum = ht_crc32(sum, &octet, 1u);
        k++;
    } while (octet != 0u);
    return sum;
}

static uint32_t version_of_table(void)
{
    uint32_t sum = 0u;
    uint16_t id;
    for (id = 0u; id < ht_param_count(); id++) {
        const ht_param_info *info = ht_param_describe(id);
        sum = sum_text(sum, info->name);
        sum = sum_text(sum, info->unit);
        sum = sum_text(sum, info->choices);
    }
    return sum;
}

/* Blocks of a copy with so many values, head and mark included. */
static uint16_t blocks_of(uint16_t count)
{
    return (uint16_t)(2u + (count / VALUES_A_BLOCK) + (((count % VALUES_A_BLOCK) != 0u) ? 1u : 0u));
}

/* --- reading -------------------------------------------------------------------------------- */

static bool is_blank(const ht_store_port *port, uint16_t area)
{
    uint16_t words[HT_STORE_WORDS];
    uint16_t block;
    uint16_t k;
    for (block = 0u; block < blocks_of(HT_PARAMS); block++) {
        if (!port->read(port->at, area, block, words)) {
            return false;
        }
        for (k = 0u; k < HT_STORE_WORDS; k++) {
            if (words[k] != HT_STORE_ERASED) {
                return false;
            }
        }
    }
    return true;
}

static bool is_mark(const uint16_t *words, uint32_t crc)
{
    bool good = (word32(words) == crc) && (word32(&words[2]) == ~crc);
    uint16_t k;
    for (k = 0u; k < FIXED; k++) {
        good = good && (words[HT_STORE_WORDS - FIXED + k] == mark[k]);
    }
    return good;
}

static void take_values(const uint16_t *words, uint16_t first, ht_params *p)
{
    uint16_t k;
    for (k = 0u; k < VALUES_A_BLOCK; k++) {
        uint16_t id = (uint16_t)(first + k);
        if (id < (uint16_t)HT_PARAMS) {
            p->v[id] = ht_float_of(word32(&words[2u * k]));
        }
    }
}

/* Is the copy whole? Its values go into `p`, unless NULL, as far as there is room. */
static bool is_whole(const ht_store_port *port, uint16_t area, ht_copy *copy, ht_params *p)
{
    uint16_t words[HT_STORE_WORDS];
    uint32_t crc;
    uint16_t block;
    uint16_t blocks;
    if (!port->read(port->at, area, 0u, words) || (words[0] != MAGIC_0) || (words[1] != MAGIC_1)
        || (words[2] != LAYOUT) || (words[3] > (port->blocks * VALUES_A_BLOCK))
        || (blocks_of(words[3]) > port->blocks)) {
        return false;
    }
    copy->count = words[3];
    copy->table = word32(&words[4]);
    copy->sequence = word32(&words[6]);
    crc = sum_block(0u, words);
    blocks = blocks_of(copy->count);
    for (block = 1u; block < (blocks - 1u); block++) {
        if (!port->read(port->at, area, block, words)) {
            return false;
        }
        crc = sum_block(crc, words);
        if (p != NULL) {
            take_values(words, (uint16_t)((block - 1u) * VALUES_A_BLOCK), p);
        }
    }
    return port->read(port->at, area, (uint16_t)(blocks - 1u), words) && is_mark(words, crc);
}

static void look(const ht_store_port *port, uint16_t area, ht_copy *copy)
{
    if (is_whole(port, area, copy, NULL)) {
        copy->state = (uint16_t)COPY_WHOLE;
    } else {
        copy->state = is_blank(port, area) ? (uint16_t)COPY_BLANK : (uint16_t)COPY_DAMAGED;
    }
}

/* Area of the latest whole copy, or NO_AREA. */
static uint16_t latest(const ht_copy *copies)
{
    bool first = copies[0].state == (uint16_t)COPY_WHOLE;
    bool second = copies[1].state == (uint16_t)COPY_WHOLE;
    if (first && second) {
        uint32_t ahead = copies[1].sequence - copies[0].sequence;
        second = (ahead != 0u) && (ahead < 0x80000000u);
        first = !second;
    }
    return first ? 0u : (second ? 1u : (uint16_t)NO_AREA);
}

static uint16_t look_at_all(const ht_store_port *port, ht_copy *copies)
{
    uint16_t area;
    for (area = 0u; area < HT_STORE_AREAS; area++) {
        look(port, area, &copies[area]);
    }
    return latest(copies);
}

static bool exists(const ht_store *s)
{
    return (s->port.read != NULL) && (s->port.blocks >= blocks_of(HT_PARAMS));
}

uint16_t ht_store_load(const ht_store *s, ht_params *p)
{
    ht_copy copies[HT_STORE_AREAS];
    uint16_t area;
    if (!exists(s)) {
        return (uint16_t)HT_SET_DEFAULTS;
    }
    area = look_at_all(&s->port, copies);
    if (area == (uint16_t)NO_AREA) {
        bool blank = (copies[0].state == (uint16_t)COPY_BLANK)
                     && (copies[1].state == (uint16_t)COPY_BLANK);
        return blank ? (uint16_t)HT_SET_DEFAULTS : (uint16_t)HT_SET_DAMAGED;
    }
    if ((copies[area].count != (uint16_t)HT_PARAMS) || (copies[area].table != version_of_table())) {
        return (uint16_t)HT_SET_FOREIGN;
    }
    /* Once more, as the values are taken: what is used is what was checked. */
    return is_whole(&s->port, area, &copies[area], p) ? (uint16_t)HT_SET_SAVED
                                                      : (uint16_t)HT_SET_DAMAGED;
}

void ht_store_none(ht_store *s)
{
    s->port.read = NULL;
    s->port.write = NULL;
    s->port.at = NULL;
    s->port.blocks = 0u;
    s->set = (uint16_t)HT_SET_DEFAULTS;
}

bool ht_store_is_command(uint16_t id)
{
    return (id == (uint16_t)HT_P_speed_ref_rpm) || (id == (uint16_t)HT_P_torque_ref_Nm)
           || (id == (uint16_t)HT_P_start_mode) || (id == (uint16_t)HT_P_motion);
}

ht_result ht_store_start(ht_store *s, ht_drive *d, ht_port *port, const ht_params *defaults)
{
    s->set = ht_store_load(s, &d->params); /* the drive's own: a stack has little room */
    if (s->set == (uint16_t)HT_SET_SAVED) {
        uint16_t id;
        for (id = 0u; id < (uint16_t)HT_PARAMS; id++) {
            if (ht_store_is_command(id)) {
                d->params.v[id] = defaults->v[id];
            }
        }
        if (ht_drive_init(d, port, &d->params) == HT_OK) {
            return HT_OK;
        }
        s->set = (uint16_t)HT_SET_FOREIGN;
    }
    return ht_drive_init(d, port, defaults);
}

/* --- writing -------------------------------------------------------------------------------- */

/* A block of the copy that is being made, all but the mark. */
static void make_block(uint16_t *words, uint16_t block, uint32_t sequence, const ht_params *p)
{
    uint16_t k;
    if (block == 0u) {
        words[0] = MAGIC_0;
        words[1] = MAGIC_1;
        words[2] = LAYOUT;
        words[3] = (uint16_t)HT_PARAMS;
        put_word32(&words[4], version_of_table());
        put_word32(&words[6], sequence);
        return;
    }
    for (k = 0u; k < VALUES_A_BLOCK; k++) {
        uint16_t id = (uint16_t)(((block - 1u) * VALUES_A_BLOCK) + k);
        put_word32(&words[2u * k], (id < (uint16_t)HT_PARAMS) ? ht_float_bits(p->v[id]) : 0u);
    }
}

static bool reads_back(const ht_store_port *port, uint16_t area, uint16_t block,
                       const uint16_t *words)
{
    uint16_t there[HT_STORE_WORDS];
    uint16_t k;
    bool same = port->read(port->at, area, block, there);
    for (k = 0u; same && (k < HT_STORE_WORDS); k++) {
        same = there[k] == words[k];
    }
    return same;
}

static bool write_copy(const ht_store_port *port, uint16_t area, uint32_t sequence,
                       const ht_params *p)
{
    uint16_t words[HT_STORE_WORDS];
    uint16_t last = (uint16_t)(blocks_of(HT_PARAMS) - 1u);
    uint32_t crc = 0u;
    uint16_t block;
    bool good = port->write(port->at, area, 0u, NULL);
    for (block = 0u; good && (block < last); block++) {
        make_block(words, block, sequence, p);
        crc = sum_block(crc, words);
        good = port->write(port->at, area, block, words);
    }
    for (block = 0u; good && (block < last); block++) {
        make_block(words, block, sequence, p);
        good = reads_back(port, area, block, words);
    }
    if (good) {
        uint16_t k;
        put_word32(words, crc);
        put_word32(&words[2], ~crc);
        for (k = 0u; k < FIXED; k++) {
            words[HT_STORE_WORDS - FIXED + k] = mark[k];
        }
        good = port->write(port->at, area, last, words) && reads_back(port, area, last, words);
    }
    return good;
}

/* May it be written now, and which area is first? */
static ht_result may_write(const ht_store *s, const ht_drive *d, ht_copy *copies, uint16_t *first)
{
    uint16_t area;
    if (!exists(s)) {
        return HT_ERROR_STORE;
    }
    if ((d->state != (uint16_t)HT_STATE_IDLE) && (d->state != (uint16_t)HT_STATE_FAULT)) {
        return HT_ERROR_STATE;
    }
    if (d->short_circuit.on != 0u) {
        return HT_ERROR_SHORT_CIRCUIT; /* writing takes the gates off */
    }
    area = look_at_all(&s->port, copies);
    *first = (area == 0u) ? 1u : 0u; /* not the latest: that one stays until this one is whole */
    return HT_OK;
}

ht_result ht_store_save(const ht_store *s, const ht_drive *d)
{
    ht_copy copies[HT_STORE_AREAS];
    uint32_t sequence = 0u;
    uint16_t first = 0u;
    ht_result result = may_write(s, d, copies, &first);
    if (result != HT_OK) {
        return result;
    }
    if (copies[1u - first].state == (uint16_t)COPY_WHOLE) {
        sequence = copies[1u - first].sequence + 1u;
    }
    return (write_copy(&s->port, first, sequence, &d->params)
            && write_copy(&s->port, (uint16_t)(1u - first), sequence, &d->params))
               ? HT_OK
               : HT_ERROR_STORE;
}

ht_result ht_store_forget(const ht_store *s, const ht_drive *d)
{
    ht_copy copies[HT_STORE_AREAS];
    uint16_t first = 0u;
    ht_result result = may_write(s, d, copies, &first);
    if (result != HT_OK) {
        return result;
    }
    return (s->port.write(s->port.at, first, 0u, NULL)
            && s->port.write(s->port.at, (uint16_t)(1u - first), 0u, NULL) && is_blank(&s->port, 0u)
            && is_blank(&s->port, 1u))
               ? HT_OK
               : HT_ERROR_STORE;
}
