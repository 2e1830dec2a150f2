#include "ht_xcp_daq.h"

#include "ht_octets.h"
#include "ht_xcp_codes.h"

#define MASK (HT_XCP_RING - 1u)
#define NOBODY 0xFFu     /* packet of a list that was ended */
#define TIMED 0x10000u   /* of a packet's head in the ring: a time follows */
#define PACKET_OCTETS 1u /* its number */
#define TIME_OCTETS 4u

void ht_xcp_daq_free(ht_xcp_daq *a)
{
    uint16_t k;
    for (k = 0u; k < HT_XCP_LISTS; k++) {
        a->list[k].running = 0u;
        a->list[k].selected = 0u;
        a->list[k].begins = 0u;
        a->list[k].event = (uint16_t)HT_XCP_EVENT_FAST;
        a->list[k].prescaler = 1u;
        a->list[k].n = 0u;
        a->list[k].size = 0u;
    }
    for (k = 0u; k < HT_XCP_ODTS; k++) {
        a->odt[k].n = 0u;
    }
    for (k = 0u; k < HT_XCP_ENTRIES; k++) {
        a->entry[k] = HT_XCP_NOTHING;
    }
    a->stage = (uint16_t)HT_XCP_NO_LISTS;
    a->lists = 0u;
    a->odts = 0u;
    a->entries = 0u;
    a->overload = 0u;
    a->tail = a->head; /* the reader's own end */
}

uint16_t ht_xcp_daq_alloc_lists(ht_xcp_daq *a, uint16_t n)
{
    if (a->stage > (uint16_t)HT_XCP_HAS_LISTS) {
        return HT_XCP_SEQUENCE;
    }
    if (n > (HT_XCP_LISTS - a->lists)) {
        return HT_XCP_MEMORY_OVERFLOW;
    }
    a->lists = (uint16_t)(a->lists + n);
    a->stage = (uint16_t)HT_XCP_HAS_LISTS;
    return HT_XCP_OK;
}

uint16_t ht_xcp_daq_alloc_odts(ht_xcp_daq *a, uint16_t list, uint16_t n)
{
    if ((a->stage != (uint16_t)HT_XCP_HAS_LISTS) && (a->stage != (uint16_t)HT_XCP_HAS_ODTS)) {
        return HT_XCP_SEQUENCE;
    }
    if (list >= a->lists) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (a->list[list].n != 0u) {
        return HT_XCP_SEQUENCE; /* those of a list lie together */
    }
    if (n > (HT_XCP_ODTS - a->odts)) {
        return HT_XCP_MEMORY_OVERFLOW;
    }
    a->list[list].first = a->odts;
    a->list[list].n = n;
    a->odts = (uint16_t)(a->odts + n);
    a->stage = (uint16_t)HT_XCP_HAS_ODTS;
    return HT_XCP_OK;
}

static bool has_odt(const ht_xcp_daq *a, uint16_t list, uint16_t odt)
{
    return (list < a->lists) && (odt < a->list[list].n);
}

uint16_t ht_xcp_daq_alloc_entries(ht_xcp_daq *a, uint16_t list, uint16_t odt, uint16_t n)
{
    ht_xcp_odt *o;
    if (a->stage < (uint16_t)HT_XCP_HAS_ODTS) {
        return HT_XCP_SEQUENCE;
    }
    if (!has_odt(a, list, odt)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    o = &a->odt[a->list[list].first + odt];
    if (o->n != 0u) {
        return HT_XCP_SEQUENCE;
    }
    if (n > HT_XCP_ODT_ENTRIES) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (n > (HT_XCP_ENTRIES - a->entries)) {
        return HT_XCP_MEMORY_OVERFLOW;
    }
    o->first = a->entries;
    o->n = n;
    a->entries = (uint16_t)(a->entries + n);
    a->stage = (uint16_t)HT_XCP_HAS_ENTRIES;
    return HT_XCP_OK;
}

uint16_t ht_xcp_daq_place(const ht_xcp_daq *a, uint16_t list, uint16_t odt, uint16_t entry)
{
    const ht_xcp_odt *o;
    if (!has_odt(a, list, odt)) {
        return HT_XCP_NOTHING;
    }
    o = &a->odt[a->list[list].first + odt];
    return (entry < o->n) ? (uint16_t)(o->first + entry) : HT_XCP_NOTHING;
}

static bool written(const ht_xcp_daq *a, const ht_xcp_odt *o)
{
    uint16_t k;
    for (k = 0u; k < o->n; k++) {
        if (a->entry[o->first + k] == HT_XCP_NOTHING) {
            return false;
        }
    }
    return o->n != 0u;
}

bool ht_xcp_daq_complete(const ht_xcp_daq *a, uint16_t list)
{
    const ht_xcp_list *l = &a->list[list];
    uint16_t k;
    for (k = 0u; k < l->n; k++) {
        if (!written(a, &a->odt[l->first + k])) {
            return false;
        }
    }
    return l->n != 0u;
}

uint32_t ht_xcp_daq_octets(const ht_xcp_daq *a, uint16_t list, bool sum)
{
    const ht_xcp_list *l = &a->list[list];
    uint32_t octets = 0u;
    uint16_t k;
    for (k = 0u; k < l->n; k++) {
        uint16_t time = (k == 0u) ? TIME_OCTETS : 0u;
        uint16_t values = (uint16_t)(4u * a->odt[l->first + k].n);
        octets += ht_xcp_frame_octets((uint16_t)(PACKET_OCTETS + time + values), sum);
    }
    return octets;
}

void ht_xcp_daq_begin(ht_xcp_daq *a, uint16_t list)
{
    ht_xcp_list *l = &a->list[list];
    uint16_t size = 1u; /* its time */
    uint16_t k;
    for (k = 0u; k < l->n; k++) {
        size = (uint16_t)(size + 1u + a->odt[l->first + k].n);
    }
    l->size = size;
    l->left = 1u;
    l->running = 1u; /* last: the rest is ready */
}

void ht_xcp_daq_end(ht_xcp_daq *a, uint16_t list)
{
    const ht_xcp_list *l = &a->list[list];
    uint16_t at = a->tail;
    a->list[list].running = 0u; /* first: the interrupt only adds behind */
    while (at != a->head) {
        uint32_t head = a->ring[at];
        uint16_t odt = (uint16_t)(head & HT_OCTET);
        uint16_t values = (uint16_t)((head >> 8) & HT_OCTET);
        if ((odt >= l->first) && (odt < (uint16_t)(l->first + l->n))) {
            a->ring[at] = head | NOBODY;
        }
        at = (uint16_t)((at + 1u + values + (((head & TIMED) != 0u) ? 1u : 0u)) & MASK);
    }
}

bool ht_xcp_daq_any(const ht_xcp_daq *a)
{
    uint16_t k;
    for (k = 0u; k < a->lists; k++) {
        if (a->list[k].running != 0u) {
            return true;
        }
    }
    return false;
}

static void put(ht_xcp_daq *a, const ht_xcp_list *l, const ht_source *source, uint32_t time)
{
    uint16_t at = a->head;
    uint16_t room = (uint16_t)((a->tail - at - 1u) & MASK);
    uint16_t k;
    if (room < l->size) {
        a->overload = 1u;
        return;
    }
    for (k = 0u; k < l->n; k++) {
        uint16_t number = (uint16_t)(l->first + k);
        uint16_t first = a->odt[number].first;
        uint16_t n = a->odt[number].n;
        uint16_t i;
        a->ring[at] = number | ((uint32_t)n << 8) | ((k == 0u) ? TIMED : 0u);
        at = (uint16_t)((at + 1u) & MASK);
        if (k == 0u) {
            a->ring[at] = time;
            at = (uint16_t)((at + 1u) & MASK);
        }
        for (i = 0u; i < n; i++) {
            a->ring[at] = ht_float_bits(source->read(source->object, a->entry[first + i]));
            at = (uint16_t)((at + 1u) & MASK);
        }
    }
    a->head = at; /* last: now it is there */
}

void ht_xcp_daq_sample(ht_xcp_daq *a, const ht_source *source, uint32_t time, bool slow)
{
    uint16_t k;
    for (k = 0u; k < a->lists; k++) {
        ht_xcp_list *l = &a->list[k];
        bool due = slow || (l->event == (uint16_t)HT_XCP_EVENT_FAST);
        if ((l->running != 0u) && due) {
            l->left--;
            if (l->left == 0u) {
                l->left = l->prescaler;
                put(a, l, source, time);
            }
        }
    }
}

bool ht_xcp_daq_next(ht_xcp_daq *a, ht_xcp_packet *p)
{
    while (a->tail != a->head) {
        uint16_t at = a->tail;
        uint32_t head = a->ring[at];
        uint16_t odt = (uint16_t)(head & HT_OCTET);
        uint16_t n = (uint16_t)((head >> 8) & HT_OCTET);
        n = (uint16_t)(n + (((head & TIMED) != 0u) ? 1u : 0u));
        at = (uint16_t)((at + 1u) & MASK);
        p->n = 0u;
        ht_xcp_add8(p, odt);
        for (; n != 0u; n--) {
            ht_xcp_add32(p, a->ring[at]);
            at = (uint16_t)((at + 1u) & MASK);
        }
        a->tail = at;
        if (odt != NOBODY) {
            return true;
        }
    }
    return false;
}
