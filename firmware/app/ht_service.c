/* Receiving, sending, session and watchdog. What a request does is in ht_service_requests.c. */
#include "ht_service_requests.h"

#include "ht_dictionary.h"
#include "ht_octets.h"
#include "ht_requests.h"

#include <stddef.h>

#define FIFO 16u
#define CAPTURE_VALUES 60u
#define SESSION_WATCHDOGS 4u

void ht_service_init(ht_service *l, ht_drive *d, const ht_service_setup *setup)
{
    l->drive = d;
    l->setup = *setup;
    if (l->setup.watchdog_ms == 0u) {
        l->setup.watchdog_ms = 1u; /* there is no drive without a watchdog */
    }
    l->dictionary = ht_dictionary_crc(&l->reply, d->port);
    ht_incoming_reset(&l->in);
    ht_packet_begin(&l->reply);
    l->out.n = 0u;
    l->out.sent = 0u;
    l->answered = false;
    l->reply_due = false;
    l->reply_waits = false;
    l->overtaken = 0u;
    l->last_crc = 0u;
    l->started = false;
    l->start_crc = 0u;
    l->mark = 0u;
    l->session = 0u;
    l->asks = 0u;
    l->session_tick = 0u;
    l->armed = 0u;
    l->fed = 0u;
    l->watchdog_left = 0u;
    l->watchdog_ticks = 0u;
    l->streams.head = 0u;
    l->streams.dropped = 0u;
    ht_streams_reset(&l->streams);
    l->begins = HT_STREAMS;
    ht_burst_init(&l->burst, setup->memory, setup->memory_size);
    l->read_at = 0u;
    l->read_left = 0u;
    l->damaged = 0u;
    l->overruns = 0u;
    if (l->setup.log != NULL) {
        ht_log_start(l->setup.log, l->setup.reset);
    }
}

/* What every request does, even one that is not carried out because it is a repetition or
 * comes before the last reply was sent: a request of the session feeds the watchdog, and a STOP
 * stops the drive. */
static void note_request(ht_service *l)
{
    if (l->in.n < HT_SERVICE_REQUEST_HEAD) {
        return;
    }
    if ((l->session != 0u) && (ht_get16(&l->in.octet[2]) == l->session)) {
        l->session_tick = l->drive->tick;
        l->fed = 1u;
    }
    if ((l->in.octet[0] == (uint16_t)HT_OP_STOP) && (l->in.n == HT_SERVICE_REQUEST_HEAD)) {
        ht_drive_stop(l->drive);
        l->armed = 0u;
    }
}

static void request(ht_service *l)
{
    uint32_t crc = ht_get32(&l->in.octet[l->in.n]);
    if ((l->in.octet[0] >= 0x40u) || (l->in.octet[0] == 0u)) {
        l->damaged++; /* no request: an echo? */
        return;
    }
    note_request(l);
    if (l->answered && (crc == l->last_crc)) {
        l->reply_due = true; /* a repetition: the same reply again */
        return;
    }
    if (l->reply_due) {
        return; /* the host did not wait for the reply; it will ask again */
    }
    l->last_crc = crc;
    ht_service_execute(l, l->in.octet, l->in.n);
    l->answered = true;
    l->reply_due = true;
}

static void receive(ht_service *l)
{
    uint16_t octets[FIFO];
    bool lost = false;
    uint16_t n = l->setup.line.read(l->setup.line.at, octets, FIFO, &lost);
    uint16_t i;
    if (lost) {
        l->overruns++;
        ht_incoming_discard(&l->in);
    }
    for (i = 0u; i < n; i++) {
        switch (ht_incoming_take(&l->in, octets[i])) {
        case HT_INCOMING_WHOLE:
            request(l);
            break;
        case HT_INCOMING_DAMAGED:
            l->damaged++;
            break;
        case HT_INCOMING_PART:
        default:
            break;
        }
    }
}

static void expire(ht_service *l)
{
    uint32_t ticks = SESSION_WATCHDOGS * ht_service_watchdog_ticks(l);
    if ((l->session != 0u) && ((l->drive->tick - l->session_tick) > ticks)) {
        l->session = 0u;
        ht_streams_reset(&l->streams);
    }
}

static bool sample_frame(ht_service *l, ht_packet *p)
{
    uint16_t i;
    if (!ht_streams_next(&l->streams, &l->sample)) {
        return false;
    }
    ht_packet_add8(p, (uint16_t)((uint16_t)HT_SERVICE_SAMPLE + l->sample.stream));
    ht_packet_add8(p, l->sample.number);
    ht_packet_add32(p, l->sample.tick);
    for (i = 0u; i < l->sample.n; i++) {
        ht_packet_add32(p, l->sample.value[i]);
    }
    return true;
}

static bool capture_frame(ht_service *l, ht_packet *p)
{
    uint32_t left = l->read_left;
    uint32_t n = (left < CAPTURE_VALUES) ? left : CAPTURE_VALUES;
    uint32_t i;
    if (n == 0u) {
        return false;
    }
    ht_packet_add8(p, HT_SERVICE_DATA);
    ht_packet_add8(p, l->burst.number);
    ht_packet_add32(p, l->read_at);
    for (i = 0u; i < n; i++) {
        ht_packet_add32(p, ht_burst_value(&l->burst, l->read_at + i));
    }
    l->read_at += n;
    l->read_left = left - n;
    return true;
}

/* Bytes of samples that may overtake the reply. */
static uint32_t longest_wait(const ht_service *l)
{
    return HT_SERVICE_STREAM_TENTHS * ((uint32_t)l->reply.n + (HT_PACKET_LINE - HT_PACKET_BODY));
}

/* The order is explained in ht_service.h. */
static void next_frame(ht_service *l)
{
    bool ready;
    if (l->reply_waits && (l->drive->staged == NULL)) {
        l->reply_waits = false;
        ht_put32(&l->reply.octet[HT_SERVICE_REPLY_HEAD], l->drive->taken_tick);
    }
    ready = l->reply_due && !l->reply_waits;
    ht_packet_begin(&l->data);
    if (!(ready && (l->overtaken >= longest_wait(l))) && sample_frame(l, &l->data)) {
        ht_outgoing_set(&l->out, &l->data);
        l->overtaken += ready ? l->out.n : 0u;
    } else if (ready) {
        l->reply_due = false;
        l->overtaken = 0u;
        ht_outgoing_set(&l->out, &l->reply);
        if (l->begins < HT_STREAMS) {
            ht_streams_begin(&l->streams, l->begins);
            l->begins = HT_STREAMS;
        }
    } else if (capture_frame(l, &l->data)) {
        ht_outgoing_set(&l->out, &l->data);
    } else {
        /* nothing to send */
    }
}

static void transmit(ht_service *l)
{
    if (l->out.sent == l->out.n) {
        next_frame(l);
    }
    if (l->out.sent < l->out.n) {
        uint16_t left = (uint16_t)(l->out.n - l->out.sent);
        uint16_t n = (left < FIFO) ? left : FIFO;
        uint16_t taken = l->setup.line.write(l->setup.line.at, &l->out.octet[l->out.sent], n);
        l->out.sent = (uint16_t)(l->out.sent + taken);
    }
}

void ht_service_turn(ht_service *l)
{
    receive(l);
    expire(l);
    ht_burst_sum(&l->burst);
    transmit(l);
    if (l->setup.log != NULL) {
        ht_log_turn(l->setup.log, l->drive, (l->session == 0u) && !ht_request_rate_is_used(l));
    }
}
