/* Requests: who is there, what is in its tables, and who may command it. */
#include "ht_dictionary.h"
#include "ht_octets.h"
#include "ht_requests.h"

#include <stddef.h>

uint16_t ht_request_hello(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t kind;
    ht_packet *p = &l->reply;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_packet_add16(p, HT_SERVICE_VERSION);
    ht_packet_add32(p, l->dictionary);
    ht_packet_add_float(p, ht_request_rate_Hz(l));
    ht_packet_add32(p, ht_request_budget(l));
    for (kind = 0u; kind < (uint16_t)HT_LISTS; kind++) {
        ht_packet_add16(p, ht_dictionary_rows(kind));
    }
    ht_packet_add16(p, HT_PACKET_BODY);
    ht_packet_add8(p, HT_STREAMS);
    ht_packet_add8(p, HT_STREAM_CHANNELS);
    ht_packet_add8(p, HT_BURST_CHANNELS);
    ht_packet_add8(p, (l->session != 0u) ? 1u : 0u);
    ht_packet_add32(p, l->burst.size);
    ht_packet_add16(p, l->setup.watchdog_ms);
    ht_packet_add_text(p, l->setup.device);
    ht_packet_add_text(p, l->setup.build);
    return HT_OK;
}

/* Why the board started. */
static uint16_t list_reset(ht_service *l, uint16_t row)
{
    const ht_reset *reset = l->setup.reset;
    const ht_reset_info *info = (reset != NULL) ? ht_reset_describe(reset->cause) : NULL;
    ht_packet *p = &l->reply;
    if ((info == NULL) || (row != 0u)) {
        return HT_ERROR_ID;
    }
    ht_packet_add8(p, HT_LIST_RESET);
    ht_packet_add16(p, row);
    ht_packet_add8(p, reset->cause);
    ht_packet_add16(p, reset->watchdogs);
    ht_packet_add_text(p, info->name);
    ht_packet_add_text(p, info->help);
    return HT_OK;
}

/* All bits of the faults. */
static uint16_t list_faults(ht_service *l, uint16_t row)
{
    ht_packet *p = &l->reply;
    if (row != 0u) {
        return HT_ERROR_ID;
    }
    ht_packet_add8(p, HT_LIST_FAULTS);
    ht_packet_add16(p, row);
    ht_packet_add32(p, l->drive->faults);
    ht_packet_add32(p, (l->drive->snapshot.tick != 0u) ? l->drive->snapshot.faults : 0u);
    return HT_OK;
}

#define COUNTERS_KEPT 1u /* flag: over a power-off */

/* The counters of the log. */
static uint16_t list_counters(ht_service *l, uint16_t row)
{
    const ht_drive_log *log = l->setup.log;
    const ht_log_counters *c;
    ht_packet *p = &l->reply;
    uint16_t k;
    if ((log == NULL) || (row != 0u)) {
        return HT_ERROR_ID;
    }
    c = &log->counters;
    ht_packet_add8(p, HT_LIST_COUNTERS);
    ht_packet_add16(p, row);
    ht_packet_add8(p, ht_log_keeps(log) ? COUNTERS_KEPT : 0u);
    ht_packet_add16(p, ht_log_events(log));
    ht_packet_add16(p, c->missed);
    ht_packet_add16(p, log->ring.damaged);
    ht_packet_add32(p, c->powered_s);
    ht_packet_add32(p, c->gates_s);
    ht_packet_add32(p, c->starts);
    ht_packet_add_float(p, c->vdc_V);
    ht_packet_add_float(p, c->current_A);
    ht_packet_add_float(p, c->speed_rpm);
    ht_packet_add_float(p, c->winding_degC);
    for (k = 0u; k < ht_fault_count(); k++) {
        ht_packet_add16(p, log->trips[k]);
    }
    return HT_OK;
}

/* An event, as ht_log.h has its words. */
static uint16_t list_event(ht_service *l, uint16_t row)
{
    ht_packet *p = &l->reply;
    uint16_t words[HT_LOG_ROW];
    uint16_t k;
    ht_result result = (l->setup.log != NULL) ? ht_log_row(l->setup.log, l->drive, row, words)
                                              : HT_ERROR_ID;
    if (result != HT_OK) {
        return (uint16_t)result;
    }
    ht_packet_add8(p, HT_LIST_EVENTS);
    ht_packet_add16(p, row);
    for (k = 0u; k < HT_LOG_ROW; k++) {
        ht_packet_add16(p, words[k]);
    }
    return HT_OK;
}

/* A limit: does it act, and since when? */
static uint16_t list_limit(ht_service *l, uint16_t row)
{
    const ht_drive *d = l->drive;
    const ht_limit_info *info = ht_limit_describe(row);
    bool controls = (ht_state_flags(d->state) & (uint16_t)HT_CONTROLS) != 0u;
    ht_packet *p = &l->reply;
    if (info == NULL) {
        return HT_ERROR_ID;
    }
    ht_packet_add8(p, HT_LIST_LIMITS);
    ht_packet_add16(p, row);
    ht_packet_add16(p, info->bit);
    ht_packet_add8(p, (controls && ((d->limits & info->bit) != 0u)) ? 1u : 0u);
    ht_packet_add32(p, d->limit_from[row]);
    ht_packet_add32(p, d->limit_to[row]);
    ht_packet_add_text(p, info->name);
    ht_packet_add_text(p, info->help);
    return HT_OK;
}

uint16_t ht_request_list(ht_service *l, const uint16_t *in, uint16_t n)
{
    if (n != 3u) {
        return HT_SERVICE_LENGTH;
    }
    if (in[0] == (uint16_t)HT_LIST_RESET) {
        return list_reset(l, ht_get16(&in[1]));
    }
    if (in[0] == (uint16_t)HT_LIST_FAULTS) {
        return list_faults(l, ht_get16(&in[1]));
    }
    if (in[0] == (uint16_t)HT_LIST_COUNTERS) {
        return list_counters(l, ht_get16(&in[1]));
    }
    if (in[0] == (uint16_t)HT_LIST_EVENTS) {
        return list_event(l, ht_get16(&in[1]));
    }
    if (in[0] == (uint16_t)HT_LIST_LIMITS) {
        return list_limit(l, ht_get16(&in[1]));
    }
    return ht_dictionary_add(&l->reply, l->drive->port, in[0], ht_get16(&in[1])) ? HT_OK
                                                                                 : HT_ERROR_ID;
}

uint16_t ht_request_open(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t nonce;
    if (n != 6u) {
        return HT_SERVICE_LENGTH;
    }
    nonce = ht_get16(in);
    if (nonce == 0u) {
        return ht_request_field(l, 0u);
    }
    if ((l->session != 0u) && (l->session != nonce)) {
        return HT_SERVICE_BUSY;
    }
    l->session = nonce;
    l->session_tick = l->drive->tick;
    if (l->mark == 0u) {
        l->mark = ht_get32(&in[2]);
    }
    ht_packet_add32(&l->reply, l->mark);
    return HT_OK;
}

uint16_t ht_request_close(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    if (l->armed != 0u) {
        ht_drive_stop(l->drive);
        l->armed = 0u;
    }
    l->session = 0u;
    ht_streams_reset(&l->streams);
    return HT_OK;
}

uint16_t ht_request_status(ht_service *l, const uint16_t *in, uint16_t n)
{
    ht_packet *p = &l->reply;
    bool armed = l->armed != 0u;
    float per_ms = l->drive->params.v[HT_P_f_isr_Hz] * 0.001f;
    float left_ms = armed ? ((float)l->watchdog_left / per_ms) : 0.0f;
    uint16_t flags = (l->session != 0u) ? 1u : 0u;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    if ((l->session != 0u) && (l->asks == l->session)) {
        flags |= 2u;
    }
    flags |= armed ? 4u : 0u;
    flags |= (l->drive->faults > 0xFFFFu) ? 8u : 0u; /* HT_LIST_FAULTS has them */
    ht_packet_add8(p, flags);
    ht_packet_add8(p, l->burst.state);
    ht_packet_add16(p, (uint16_t)left_ms);
    ht_packet_add32(p, l->damaged);
    ht_packet_add32(p, l->overruns);
    ht_packet_add32(p, l->streams.dropped);
    ht_packet_add32(p, l->mark);
    ht_packet_add8(p, (l->setup.store != NULL) ? l->setup.store->set : (uint16_t)HT_SET_DEFAULTS);
    return HT_OK;
}
