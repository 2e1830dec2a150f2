/* The requests of the serial line, one by one, and its watchdog. The drive, the streams, the capture
 * and the store are called by what they promise. */
#include "ht_contracts.h"
#include "ht_octets.c"
#include "ht_requests_drive.c"
#include "ht_requests_sampling.c"
#include "ht_requests_session.c"
#include "ht_service_requests.c"
#include "prove.h"

#define PAYLOAD (HT_PACKET_BODY - HT_SERVICE_REQUEST_HEAD)

static ht_service service;
static ht_drive drive;
static ht_store store;

static bool has_stopped;
static uint16_t writes;
static bool streaming;
static float rate_now_Hz;
static uint16_t look; /* any: what holds for the pair of this number holds for all of a WRITE */
static const uint16_t *payload; /* of a WRITE's pairs */
static uint16_t payload_octets;
static uint16_t pairs;      /* that were taken */
static uint32_t replied[2]; /* the first two long ones of the reply */
static uint16_t replies;

static void grow(ht_packet *p, uint16_t count)
{
    MUST(p->n <= HT_PACKET_BODY);
    if (count > (HT_PACKET_BODY - p->n)) {
        p->full = true;
    } else {
        p->n = (uint16_t)(p->n + count);
    }
}

void ht_packet_add8(ht_packet *p, uint16_t value)
{
    grow(p, 1u);
}

void ht_packet_add16(ht_packet *p, uint16_t value)
{
    grow(p, 2u);
}

void ht_packet_add32(ht_packet *p, uint32_t value)
{
    grow(p, 4u);
    if (replies < 2u) {
        replied[replies] = value;
        replies++;
    }
}

void ht_packet_add_float(ht_packet *p, float value)
{
    grow(p, 4u);
}

uint16_t ht_param_count(void)
{
    return (uint16_t)HT_PARAMS;
}

uint16_t ht_channel_count(void)
{
    return 40u;
}

float ht_drive_get(const ht_drive *d, uint16_t id)
{
    MUST(id < (uint16_t)HT_PARAMS);
    return (id == (uint16_t)HT_P_f_isr_Hz) ? rate_now_Hz : nondet_float();
}

/* Streams, or a capture that is not complete, count in f_isr_Hz: it must stay. */
static bool rate_counts(void)
{
    uint16_t state = service.burst.state;
    return streaming
           || ((state >= (uint16_t)HT_BURST_FILLING) && (state <= (uint16_t)HT_BURST_TRIGGERED));
}

static bool may_take(uint16_t id, float value)
{
    return !rate_counts() || (id != (uint16_t)HT_P_f_isr_Hz) || (value == rate_now_Hz);
}

ht_result ht_drive_write(ht_drive *d, const uint16_t *ids, const float *values, uint16_t n,
                         uint16_t *at)
{
    uint16_t k;
    ht_result result = (ht_result)nondet_uint16();
    GIVEN((unsigned)result <= (unsigned)HT_ERROR_RESTART);
    MUST((n >= 1u) && (n <= HT_SERVICE_WRITE));
    MUST(IMPLIES(look < n, may_take(ids[look], values[look])));
    for (k = 0u; k < n; k++) {
        GIVEN(IMPLIES(result == HT_OK, ids[k] < (uint16_t)HT_PARAMS));
    }
    *at = nondet_uint16();
    writes++;
    return result;
}

ht_result ht_drive_start(ht_drive *d)
{
    ht_result result = (ht_result)nondet_uint16();
    GIVEN((unsigned)result <= (unsigned)HT_ERROR_RESTART);
    return result;
}

uint16_t ht_drive_restart_wait(const ht_drive *d)
{
    return nondet_uint16();
}

void ht_drive_stop(ht_drive *d)
{
    has_stopped = true;
}

void ht_streams_reset(ht_streams *s)
{
    streaming = false;
}

bool ht_streams_any(const ht_streams *s)
{
    return streaming;
}

void ht_streams_set(ht_streams *s, uint16_t k, const uint16_t *id, uint16_t n, uint16_t decimation)
{
    uint16_t at = nondet_uint16();
    MUST((k < HT_STREAMS) && (n <= HT_STREAM_CHANNELS) && (decimation >= 1u));
    MUST(IMPLIES(at < n, id[at] < ht_channel_count()));
}

/* As burst.c proves it. */
ht_burst_answer ht_burst_arm(ht_burst *b, const ht_burst_setup *setup)
{
    ht_burst_answer answer = (ht_burst_answer)nondet_uint16();
    uint16_t at = nondet_uint16();
    MUST((setup->n <= HT_BURST_CHANNELS) && (setup->channel < ht_channel_count()));
    MUST(IMPLIES(at < setup->n, setup->id[at] < ht_channel_count()));
    GIVEN((unsigned)answer <= (unsigned)HT_BURST_TOO_LARGE);
    GIVEN(IMPLIES(setup->n == 0u, answer == HT_BURST_BAD_N));
    return answer;
}

uint32_t ht_burst_values(const ht_burst *b)
{
    return nondet_uint32();
}

static uint16_t any_length(void)
{
    uint16_t n = nondet_uint16();
    GIVEN(n <= PAYLOAD);
    return n;
}

/* Any service in any state, and a payload that ends where the memory ends: one that is read further
 * than it reaches is found. The octet before it is there because an array must not be empty. */
static const uint16_t *any_request(const uint16_t *octets)
{
    uint16_t k;
    service.drive = &drive;
    service.setup.store = nondet_bool() ? &store : NULL;
    service.reply.n = nondet_uint16();
    service.reply.full = nondet_bool();
    service.session = nondet_uint16();
    service.asks = nondet_uint16();
    service.armed = nondet_bool() ? 1u : 0u;
    service.started = nondet_bool();
    service.last_crc = nondet_uint32();
    service.start_crc = nondet_uint32();
    service.mark = nondet_uint32();
    service.reply_waits = nondet_bool();
    service.watchdog_left = nondet_uint32();
    service.read_at = nondet_uint32();
    service.read_left = nondet_uint32();
    service.setup.watchdog_ms = HT_SERVICE_WATCHDOG_MS;
    service.setup.line.octets_per_s = nondet_uint32();
    service.burst.state = nondet_uint16();
    service.burst.size = nondet_uint32();
    drive.params.v[HT_P_f_isr_Hz] = nondet_float();
    GIVEN((drive.params.v[HT_P_f_isr_Hz] >= 1000.0f)
          && (drive.params.v[HT_P_f_isr_Hz] <= 50000.0f));
    GIVEN((service.reply.n <= HT_PACKET_BODY) && (service.burst.state <= 5u));
    for (k = 0u; k < HT_STREAMS; k++) {
        ht_stream *stream = &service.streams.stream[k];
        stream->active = nondet_uint16();
        stream->n = nondet_uint16();
        stream->decimation = nondet_uint16();
        GIVEN((stream->n <= HT_STREAM_CHANNELS) && (stream->decimation >= 1u));
    }
    return &octets[1];
}

void prove_request_open(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    uint16_t before = service.session;
    uint32_t mark = service.mark;
    uint16_t result;
    result = ht_request_open(&service, in, n);
    MUST(service.reply.n <= HT_PACKET_BODY);
    /* Nobody takes a session from its owner; a refusal changes nothing. */
    MUST((service.session == before) || ((before == 0u) && (result == (uint16_t)HT_OK)));
    MUST(IMPLIES(result == (uint16_t)HT_OK, (n == 6u) && (service.session != 0u)));
    MUST(IMPLIES(mark != 0u, service.mark == mark));
}

void prove_request_close(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    bool armed = service.armed != 0u;
    uint16_t result = ht_request_close(&service, in, n);
    MUST((result == (uint16_t)HT_OK) == (n == 0u));
    MUST(IMPLIES(n == 0u, (service.session == 0u) && (service.armed == 0u)));
    MUST(IMPLIES(n == 0u, has_stopped == armed));
}

void prove_request_start(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    bool again = service.started && (service.last_crc == service.start_crc);
    uint16_t armed = service.armed;
    uint16_t result = ht_request_start(&service, in, n);
    MUST(IMPLIES(again || (n != 0u), (result != (uint16_t)HT_OK) && (service.armed == armed)));
    MUST(IMPLIES(result == (uint16_t)HT_OK, (service.armed == 1u) && (service.fed == 1u)));
    MUST(IMPLIES(result == (uint16_t)HT_OK,
                 (service.watchdog_left >= 1u) && (service.watchdog_left <= 12501u)));
    MUST(IMPLIES(result != (uint16_t)HT_OK, service.armed == armed));
}

void prove_request_stop(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    uint16_t result = ht_request_stop(&service, in, n);
    MUST((result == (uint16_t)HT_OK) == (n == 0u));
    MUST(IMPLIES(n == 0u, has_stopped && (service.armed == 0u)));
}

void prove_request_get(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    uint16_t before = service.reply.n;
    uint16_t result = ht_request_get(&service, in, n);
    MUST(service.reply.n <= HT_PACKET_BODY);
    MUST(IMPLIES((result == (uint16_t)HT_OK) && (before <= HT_SERVICE_REPLY_HEAD),
                 service.reply.n == (before + 2u * n)));
}

static void any_pairs(void)
{
    uint16_t k;
    for (k = 0u; k < HT_SERVICE_WRITE; k++) {
        service.write_id[k] = nondet_uint16();
        service.write_value[k] = nondet_float();
    }
}

static void any_rate(void)
{
    look = nondet_uint16();
    streaming = nondet_bool();
    rate_now_Hz = drive.params.v[HT_P_f_isr_Hz];
}

/* As prove_request_values shows it. */
static bool promise_take_pairs(ht_service *l, const uint16_t *in, uint16_t count)
{
    bool fine = nondet_bool();
    MUST(count <= HT_SERVICE_WRITE);
    MUST(IMPLIES(count > 0u, in[6u * count - 1u] == in[6u * count - 1u])); /* is payload */
    GIVEN(IMPLIES(fine && (look < count), may_take(l->write_id[look], l->write_value[look])));
    return fine;
}

void prove_request_pair(void)
{
    uint16_t octets[PAIR + 1u];
    const uint16_t *in = any_request(octets);
    uint16_t k = nondet_uint16();
    bool fine;
    any_rate();
    GIVEN(k < HT_SERVICE_WRITE);
    fine = take_pair(&service, in, k, rate_counts());
    MUST(IMPLIES(fine, service.write_id[k] == ht_get16(in)));
    MUST(IMPLIES(fine, may_take(service.write_id[k], service.write_value[k])));
}

/* As prove_request_pair shows it. */
static bool promise_take_pair(ht_service *l, const uint16_t *pair, uint16_t k, bool fixed)
{
    MUST((k == pairs) && (k < HT_SERVICE_WRITE) && (fixed == rate_counts()));
    MUST((pair == &payload[PAIR * k]) && ((PAIR * k) + PAIR <= payload_octets));
    pairs++;
    return nondet_bool();
}

void prove_request_values(void)
{
    uint16_t octets[PAYLOAD + 1u];
    uint16_t count = nondet_uint16();
    payload = any_request(octets);
    payload_octets = any_length();
    any_rate();
    GIVEN((count <= HT_SERVICE_WRITE) && (PAIR * count <= payload_octets));
    MUST(IMPLIES(take_pairs(&service, payload, count), pairs == count));
}

void prove_request_write(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    bool waited = service.reply_waits;
    uint16_t result;
    any_rate();
    any_pairs();
    result = ht_request_write(&service, in, n);
    MUST(service.reply.n <= HT_PACKET_BODY);
    MUST(writes <= 1u); /* all at once */
    MUST(IMPLIES(result == (uint16_t)HT_OK, (writes == 1u) && service.reply_waits));
    MUST(IMPLIES(result != (uint16_t)HT_OK, service.reply_waits == waited));
}

/* f_isr_Hz goes up to 50 kHz; at 1 MHz, the slowest clock, whole counts make it 51.3 kHz. */
#define FASTEST_HZ 51300.0f
#define MOST_LOAD 7200000u /* bytes per second of a stream */

float promise_ht_request_rate_Hz(const ht_service *l)
{
    float interrupts_Hz = nondet_float();
    GIVEN((interrupts_Hz > 0.0f) && (interrupts_Hz <= FASTEST_HZ));
    return interrupts_Hz;
}

static uint32_t promise_load(float interrupts_Hz, uint16_t n, uint16_t decimation)
{
    uint32_t octets_per_s = nondet_uint32();
    MUST(decimation >= 1u);
    GIVEN(octets_per_s <= MOST_LOAD);
    return octets_per_s;
}

void prove_request_load(void)
{
    float interrupts_Hz = nondet_float();
    uint16_t n = nondet_uint16();
    uint16_t decimation = nondet_uint16();
    GIVEN((n <= HT_STREAM_CHANNELS) && (decimation >= 1u));
    GIVEN((interrupts_Hz > 0.0f) && (interrupts_Hz <= FASTEST_HZ));
    ht_most[0][0] = 4.0f;
    ht_most[0][1] = (float)HT_STREAM_CHANNELS;
    ht_most[1][0] = 4.0f * (float)HT_STREAM_CHANNELS + SAMPLE_HEAD;
    ht_most[1][1] = FASTEST_HZ;
    MUST(load(interrupts_Hz, n, decimation) <= MOST_LOAD);
}

static uint16_t promise_smallest(float interrupts_Hz, uint16_t n, uint32_t rest)
{
    return nondet_uint16();
}

void prove_request_smallest(void)
{
    uint32_t rest = nondet_uint32();
    uint16_t least = smallest(nondet_float(), nondet_uint16(), rest);
    MUST(IMPLIES(rest == 0u, least == 0u));
}

void prove_request_stream(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    uint16_t result;
    result = ht_request_stream(&service, in, n);
    MUST(service.reply.n <= HT_PACKET_BODY);
    MUST(IMPLIES((result == (uint16_t)HT_OK) && (replies == 2u), replied[0] <= replied[1]));
}

void prove_request_arm(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    uint32_t left = service.read_left;
    uint16_t result;
    result = ht_request_arm(&service, in, n);
    MUST(service.reply.n <= HT_PACKET_BODY);
    MUST(service.read_left == ((result == (uint16_t)HT_OK) ? 0u : left));
}

void prove_request_read(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    uint16_t result;
    result = ht_request_read(&service, in, n);
    MUST(IMPLIES(result == (uint16_t)HT_OK, service.burst.state == (uint16_t)HT_BURST_COMPLETE));
}

void prove_request_status(void)
{
    uint16_t n = any_length();
    uint16_t octets[n + 1u];
    const uint16_t *in = any_request(octets);
    GIVEN(service.watchdog_left <= 12501u); /* as START sets it */
    (void)ht_request_status(&service, in, n);
    MUST(service.reply.n <= HT_PACKET_BODY);
}

void prove_watchdog_ticks(void)
{
    ht_service l;
    ht_drive d;
    uint32_t ticks;
    float rate_Hz = nondet_float();
    GIVEN((rate_Hz >= 1000.0f) && (rate_Hz <= 50000.0f));
    d.params.v[HT_P_f_isr_Hz] = rate_Hz;
    l.drive = &d;
    l.setup.watchdog_ms = nondet_uint16();
    ticks = ht_service_watchdog_ticks(&l);
    MUST(ticks >= 1u);
    MUST(ticks <= 3277000u); /* 65535 ms at 50 kHz */
}
