/* Commands that measure: lists, their packets and values, events, the clock. */
#include "ht_xcp_commands.h"

#include "ht_octets.h"
#include "ht_requests.h"
#include "ht_service_requests.h"

#include <stddef.h>

#define WHOLE_VALUE 0xFFu  /* bit offset of a value that is no bit */
#define MODE_UNKNOWN 0x23u /* alternating, stimulation, packets without number */
#define MODE_TIMED 0x10u
#define MODE_SELECTED 0x01u
#define MODE_RUNNING 0x40u
#define DYNAMIC_PRESCALER_TIME 0x13u
#define OVERLOAD_EVENT 0x80u
#define TIME_US_FIXED 0x3Cu /* four octets, in microseconds, always there */
#define EVENT_OF_DAQ 0x84u  /* all lists of an event have values of one instant */
#define EVENT_CYCLE_MOST 255u

static const char *const event_names[HT_XCP_EVENTS] = {"fast", "slow"};

uint16_t ht_xcp_free_daq(ht_xcp *x, const uint16_t *in)
{
    (void)in;
    ht_xcp_daq_free(&x->daq);
    x->pointer_list = HT_XCP_NOTHING;
    return HT_XCP_OK;
}

uint16_t ht_xcp_alloc_daq(ht_xcp *x, const uint16_t *in)
{
    return ht_xcp_daq_alloc_lists(&x->daq, ht_get16(&in[2]));
}

uint16_t ht_xcp_alloc_odt(ht_xcp *x, const uint16_t *in)
{
    return ht_xcp_daq_alloc_odts(&x->daq, ht_get16(&in[2]), in[4]);
}

uint16_t ht_xcp_alloc_entry(ht_xcp *x, const uint16_t *in)
{
    return ht_xcp_daq_alloc_entries(&x->daq, ht_get16(&in[2]), in[4], in[5]);
}

/* The list exists and does not run, or the error. */
static uint16_t at_rest(const ht_xcp *x, uint16_t list)
{
    if (list >= x->daq.lists) {
        return HT_XCP_OUT_OF_RANGE;
    }
    return (x->daq.list[list].running != 0u) ? (uint16_t)HT_XCP_DAQ_ACTIVE : (uint16_t)HT_XCP_OK;
}

uint16_t ht_xcp_clear_list(ht_xcp *x, const uint16_t *in)
{
    uint16_t list = ht_get16(&in[2]);
    uint16_t odt;
    if (list >= x->daq.lists) {
        return HT_XCP_OUT_OF_RANGE;
    }
    ht_xcp_daq_end(&x->daq, list);
    for (odt = 0u; odt < x->daq.list[list].n; odt++) {
        uint16_t entry = 0u;
        uint16_t place = ht_xcp_daq_place(&x->daq, list, odt, entry);
        while (place != HT_XCP_NOTHING) {
            x->daq.entry[place] = HT_XCP_NOTHING;
            entry++;
            place = ht_xcp_daq_place(&x->daq, list, odt, entry);
        }
    }
    return HT_XCP_OK;
}

uint16_t ht_xcp_set_daq_ptr(ht_xcp *x, const uint16_t *in)
{
    uint16_t list = ht_get16(&in[2]);
    uint16_t result = at_rest(x, list);
    if (result != (uint16_t)HT_XCP_OK) {
        return result;
    }
    if (ht_xcp_daq_place(&x->daq, list, in[4], in[5]) == HT_XCP_NOTHING) {
        return HT_XCP_OUT_OF_RANGE;
    }
    x->pointer_list = list;
    x->pointer_odt = in[4];
    x->pointer_entry = in[5];
    return HT_XCP_OK;
}

/* The entry at the pointer; it goes on to the next entry. */
static uint16_t advance(ht_xcp *x)
{
    uint16_t place = ht_xcp_daq_place(&x->daq, x->pointer_list, x->pointer_odt, x->pointer_entry);
    if (place != HT_XCP_NOTHING) {
        x->pointer_entry++;
    }
    return place;
}

uint16_t ht_xcp_write_daq(ht_xcp *x, const uint16_t *in)
{
    uint32_t address = ht_get32(&in[4]);
    uint16_t id = ht_xcp_value_at(address);
    uint16_t result = at_rest(x, x->pointer_list);
    uint16_t place;
    if (result != (uint16_t)HT_XCP_OK) {
        return result;
    }
    if ((in[1] != WHOLE_VALUE) || (in[2] != HT_XCP_VALUE) || (in[3] != 0u)
        || ((address % HT_XCP_VALUE) != 0u)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (id == HT_XCP_NOTHING) {
        return HT_XCP_ACCESS_DENIED;
    }
    place = advance(x);
    if (place == HT_XCP_NOTHING) {
        return HT_XCP_OUT_OF_RANGE;
    }
    x->daq.entry[place] = id;
    return HT_XCP_OK;
}

uint16_t ht_xcp_read_daq(ht_xcp *x, const uint16_t *in)
{
    uint16_t place = advance(x);
    uint16_t id;
    (void)in;
    if (place == HT_XCP_NOTHING) {
        return HT_XCP_OUT_OF_RANGE;
    }
    id = x->daq.entry[place];
    ht_xcp_add8(&x->reply, WHOLE_VALUE);
    ht_xcp_add8(&x->reply, (id == HT_XCP_NOTHING) ? 0u : HT_XCP_VALUE);
    ht_xcp_add8(&x->reply, 0u);
    ht_xcp_add32(&x->reply, (id == HT_XCP_NOTHING) ? 0u : ht_xcp_address_of(id));
    return HT_XCP_OK;
}

uint16_t ht_xcp_set_list_mode(ht_xcp *x, const uint16_t *in)
{
    uint16_t list = ht_get16(&in[2]);
    uint16_t event = ht_get16(&in[4]);
    uint16_t result = at_rest(x, list);
    if (result != (uint16_t)HT_XCP_OK) {
        return result;
    }
    if ((in[1] & MODE_UNKNOWN) != 0u) {
        return HT_XCP_MODE_NOT_VALID;
    }
    if ((event >= (uint16_t)HT_XCP_EVENTS) || (in[6] == 0u)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    x->daq.list[list].event = event;
    x->daq.list[list].prescaler = in[6];
    return HT_XCP_OK;
}

uint16_t ht_xcp_get_list_mode(ht_xcp *x, const uint16_t *in)
{
    uint16_t list = ht_get16(&in[2]);
    const ht_xcp_list *l;
    uint16_t mode = MODE_TIMED;
    if (list >= x->daq.lists) {
        return HT_XCP_OUT_OF_RANGE;
    }
    l = &x->daq.list[list];
    mode |= (l->selected != 0u) ? MODE_SELECTED : 0u;
    mode |= (l->running != 0u) ? MODE_RUNNING : 0u;
    ht_xcp_add8(&x->reply, mode);
    ht_xcp_add16(&x->reply, 0u);
    ht_xcp_add16(&x->reply, l->event);
    ht_xcp_add8(&x->reply, l->prescaler);
    ht_xcp_add8(&x->reply, 0u); /* priority */
    return HT_XCP_OK;
}

static float event_Hz(const ht_xcp *x, uint16_t event)
{
    return (event == (uint16_t)HT_XCP_EVENT_FAST)
               ? ht_request_rate_Hz(x->service)
               : ht_drive_get(x->service->drive, (uint16_t)HT_P_f_slow_Hz);
}

/* Octets a second of all lists that run or are to begin fit what samples may have of the line. */
static bool fits(const ht_xcp *x)
{
    uint32_t budget = x->line.octets_per_s / 10u * HT_SERVICE_STREAM_TENTHS;
    float sum = 0.0f;
    uint16_t k;
    for (k = 0u; k < x->daq.lists; k++) {
        const ht_xcp_list *l = &x->daq.list[k];
        if ((l->running != 0u) || (l->begins != 0u)) {
            float octets = (float)ht_xcp_daq_octets(&x->daq, k, x->serial);
            sum += octets * event_Hz(x, l->event) / (float)l->prescaler;
        }
    }
    return sum <= (float)budget;
}

/* Lists that are marked to begin do so, if they can; else none of them. */
static uint16_t checked(ht_xcp *x)
{
    bool good = fits(x);
    uint16_t k;
    for (k = 0u; k < x->daq.lists; k++) {
        good = good && ((x->daq.list[k].begins == 0u) || ht_xcp_daq_complete(&x->daq, k));
    }
    for (k = 0u; (k < x->daq.lists) && !good; k++) {
        x->daq.list[k].begins = 0u;
    }
    return good ? (uint16_t)HT_XCP_OK : (uint16_t)HT_XCP_DAQ_CONFIG;
}

uint16_t ht_xcp_start_stop_list(ht_xcp *x, const uint16_t *in)
{
    uint16_t list = ht_get16(&in[2]);
    ht_xcp_list *l;
    uint16_t result = HT_XCP_OK;
    if (list >= x->daq.lists) {
        return HT_XCP_OUT_OF_RANGE;
    }
    l = &x->daq.list[list];
    switch (in[1]) {
    case 0u:
        ht_xcp_daq_end(&x->daq, list);
        break;
    case 1u:
        l->begins = (uint16_t)((l->running != 0u) ? 0u : 1u);
        result = checked(x);
        break;
    case 2u:
        l->selected = 1u;
        break;
    default:
        result = HT_XCP_MODE_NOT_VALID;
        break;
    }
    ht_xcp_add8(&x->reply, (uint16_t)(l->first & HT_OCTET));
    return result;
}

static void end(ht_xcp *x, bool only_selected)
{
    uint16_t k;
    for (k = 0u; k < x->daq.lists; k++) {
        if (!only_selected || (x->daq.list[k].selected != 0u)) {
            ht_xcp_daq_end(&x->daq, k);
            x->daq.list[k].selected = 0u;
        }
    }
}

uint16_t ht_xcp_start_stop_all(ht_xcp *x, const uint16_t *in)
{
    uint16_t result = HT_XCP_OK;
    uint16_t k;
    if (in[1] > 2u) {
        return HT_XCP_MODE_NOT_VALID;
    }
    if (in[1] != 1u) {
        end(x, in[1] == 2u);
        return HT_XCP_OK;
    }
    for (k = 0u; k < x->daq.lists; k++) {
        ht_xcp_list *l = &x->daq.list[k];
        l->begins = (uint16_t)(((l->selected != 0u) && (l->running == 0u)) ? 1u : 0u);
    }
    result = checked(x);
    for (k = 0u; (k < x->daq.lists) && (result == (uint16_t)HT_XCP_OK); k++) {
        x->daq.list[k].selected = 0u;
    }
    return result;
}

void ht_xcp_begin(ht_xcp *x)
{
    uint16_t k;
    for (k = 0u; k < x->daq.lists; k++) {
        if (x->daq.list[k].begins != 0u) {
            x->daq.list[k].begins = 0u;
            ht_xcp_daq_begin(&x->daq, k);
        }
    }
}

uint16_t ht_xcp_clock(ht_xcp *x, const uint16_t *in)
{
    (void)in;
    ht_xcp_add8(&x->reply, 0u);
    ht_xcp_add16(&x->reply, 0u);
    ht_xcp_add32(&x->reply, x->time);
    return HT_XCP_OK;
}

uint16_t ht_xcp_daq_processor(ht_xcp *x, const uint16_t *in)
{
    ht_xcp_packet *p = &x->reply;
    (void)in;
    ht_xcp_add8(p, DYNAMIC_PRESCALER_TIME | OVERLOAD_EVENT);
    ht_xcp_add16(p, x->daq.lists);
    ht_xcp_add16(p, HT_XCP_EVENTS);
    ht_xcp_add8(p, 0u); /* no list that is always there */
    ht_xcp_add8(p, 0u); /* packets by their number alone, one address extension */
    return HT_XCP_OK;
}

uint16_t ht_xcp_daq_resolution(ht_xcp *x, const uint16_t *in)
{
    ht_xcp_packet *p = &x->reply;
    (void)in;
    ht_xcp_add8(p, HT_XCP_VALUE);
    ht_xcp_add8(p, HT_XCP_VALUE);
    ht_xcp_add16(p, 0u); /* no stimulation */
    ht_xcp_add8(p, TIME_US_FIXED);
    ht_xcp_add16(p, 1u);
    return HT_XCP_OK;
}

uint16_t ht_xcp_event(ht_xcp *x, const uint16_t *in)
{
    ht_xcp_packet *p = &x->reply;
    uint16_t event = ht_get16(&in[2]);
    uint16_t letters = 0u;
    uint16_t unit = 2u; /* 100 ns; each next one is ten times as long */
    float period;
    uint32_t cycle;
    if (event >= (uint16_t)HT_XCP_EVENTS) {
        return HT_XCP_OUT_OF_RANGE;
    }
    period = 1.0e7f / event_Hz(x, event);
    cycle = (uint32_t)(period + 0.5f);
    while (cycle > EVENT_CYCLE_MOST) {
        cycle = (cycle + 5u) / 10u;
        unit++;
    }
    x->text = event_names[event];
    while (x->text[letters] != '\0') {
        letters++;
    }
    ht_xcp_add8(p, EVENT_OF_DAQ);
    ht_xcp_add8(p, HT_XCP_LISTS);
    ht_xcp_add8(p, letters);
    ht_xcp_add8(p, (uint16_t)cycle);
    ht_xcp_add8(p, unit);
    ht_xcp_add8(p, 0u); /* priority */
    return HT_XCP_OK;
}
