/* The requests, one function each: payload in, status out, payload of the reply appended. */
#include "ht_service_requests.h"

#include "ht_dictionary.h"
#include "ht_drive_inside.h"
#include "ht_octets.h"
#include "ht_snapshot.h"

#include <stddef.h>

#define NO_DETAIL 0xFFFFu
#define GET_MOST 100u
#define PAIR 6u           /* bytes of id and value */
#define SAMPLE_HEAD 12.0f /* bytes of a sample on the line that are no values */

enum { NEEDS_NOTHING = 0, NEEDS_DICTIONARY = 1, NEEDS_SESSION = 2, NEEDS_BOTH = 3 };

uint32_t ht_service_watchdog_ticks(const ht_service *l)
{
    float ticks = l->drive->params.v[HT_P_f_isr_Hz] * (float)l->setup.watchdog_ms * 0.001f;
    return (ticks < 1.0f) ? 1u : (uint32_t)ticks;
}

/* Fast interrupts per second: the PWM clock divided by whole counts, next to f_isr_Hz. */
static float rate_Hz(const ht_service *l)
{
    uint16_t counts = ht_config_in_force(l->drive)->control.period.counts;
    return ht_port_pwm_clock_Hz(l->drive->port) / (float)counts;
}

/* Bytes per second that streams may take. */
static uint32_t streams_budget(const ht_service *l)
{
    return l->setup.line.octets_per_s / 10u * HT_SERVICE_STREAM_TENTHS;
}

/* The field at `offset` of the payload is out of range. */
static uint16_t field(ht_service *l, uint16_t offset)
{
    l->detail = offset;
    return HT_SERVICE_FIELD;
}

static uint16_t hello(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t kind;
    ht_packet *p = &l->reply;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_packet_add16(p, HT_SERVICE_VERSION);
    ht_packet_add32(p, l->dictionary);
    ht_packet_add_float(p, rate_Hz(l));
    ht_packet_add32(p, streams_budget(l));
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

static uint16_t list(ht_service *l, const uint16_t *in, uint16_t n)
{
    if (n != 3u) {
        return HT_SERVICE_LENGTH;
    }
    if (in[0] == (uint16_t)HT_LIST_RESET) {
        return list_reset(l, ht_get16(&in[1]));
    }
    return ht_dictionary_add(&l->reply, l->drive->port, in[0], ht_get16(&in[1])) ? HT_OK
                                                                                 : HT_ERROR_ID;
}

static uint16_t open_session(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t nonce;
    if (n != 6u) {
        return HT_SERVICE_LENGTH;
    }
    nonce = ht_get16(in);
    if (nonce == 0u) {
        return field(l, 0u);
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

static uint16_t close_session(ht_service *l, const uint16_t *in, uint16_t n)
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

static uint16_t status(ht_service *l, const uint16_t *in, uint16_t n)
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

static uint16_t get(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t k;
    if (((n & 1u) != 0u) || (n > (2u * GET_MOST))) {
        return HT_SERVICE_LENGTH;
    }
    for (k = 0u; k < n; k += 2u) {
        uint16_t id = ht_get16(&in[k]);
        if (id >= ht_param_count()) {
            l->detail = id;
            return HT_ERROR_ID;
        }
        ht_packet_add_float(&l->reply, ht_drive_get(l->drive, id));
    }
    return HT_OK;
}

/* The rate of the interrupt is the streams' and captures' unit of time. */
static bool rate_is_used(const ht_service *l)
{
    return ht_streams_any(&l->streams)
           || ((l->burst.state != (uint16_t)HT_BURST_NONE)
               && (l->burst.state < (uint16_t)HT_BURST_SUMMING));
}

/* Id and value number k of a WRITE; false if the rate would change while it is used. */
static bool take_pair(ht_service *l, const uint16_t *pair, uint16_t k, bool fixed)
{
    uint16_t id = ht_get16(pair);
    float value = ht_float_of(ht_get32(&pair[2]));
    if (fixed && (id == (uint16_t)HT_P_f_isr_Hz) && (value != ht_drive_get(l->drive, id))) {
        l->detail = id;
        return false;
    }
    l->write_id[k] = id;
    l->write_value[k] = value;
    return true;
}

/* Ids and values of the payload, all of them or false. */
static bool take_pairs(ht_service *l, const uint16_t *in, uint16_t count)
{
    bool fixed = rate_is_used(l);
    uint16_t k;
    for (k = 0u; k < count; k++) {
        if (!take_pair(l, &in[k * PAIR], k, fixed)) {
            return false;
        }
    }
    return true;
}

static uint16_t write(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t count = (uint16_t)(n / PAIR);
    uint16_t at = NO_DETAIL;
    uint16_t result;
    uint16_t k;
    if ((n == 0u) || ((count * PAIR) != n) || (count > HT_SERVICE_WRITE)) {
        return HT_SERVICE_LENGTH;
    }
    if (!take_pairs(l, in, count)) {
        return HT_SERVICE_SAMPLING;
    }
    result = (uint16_t)ht_drive_write(l->drive, l->write_id, l->write_value, count, &at);
    if (result != (uint16_t)HT_OK) {
        bool told = (result == (uint16_t)HT_ERROR_ID) || (result == (uint16_t)HT_ERROR_VALUE)
                    || (result == (uint16_t)HT_ERROR_STATE)
                    || (result == (uint16_t)HT_ERROR_CONFIG);
        if (told) {
            l->detail = at;
        }
        return result;
    }
    l->burst.command = 1u;
    l->reply_waits = true;
    ht_packet_add32(&l->reply, 0u); /* the tick: once it is known */
    for (k = 0u; k < count; k++) {
        ht_packet_add_float(&l->reply, ht_drive_get(l->drive, l->write_id[k]));
    }
    return HT_OK;
}

static uint16_t start(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t result;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    if (l->started && (l->last_crc == l->start_crc)) {
        return HT_ERROR_STATE; /* repeated after another host's request, perhaps a STOP */
    }
    l->watchdog_ticks = ht_service_watchdog_ticks(l);
    result = (uint16_t)ht_drive_start(l->drive);
    if (result == (uint16_t)HT_ERROR_RESTART) {
        l->detail = ht_drive_restart_wait(l->drive);
    }
    if (result == (uint16_t)HT_OK) {
        l->started = true;
        l->start_crc = l->last_crc;
        l->watchdog_left = l->watchdog_ticks;
        l->fed = 1u;
        l->armed = 1u; /* last: the interrupt disarms what does not run */
        l->burst.command = 1u;
    }
    return result;
}

static uint16_t stop(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_drive_stop(l->drive);
    l->armed = 0u;
    l->burst.command = 1u;
    return HT_OK;
}

static uint16_t clear(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t result;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    result = (uint16_t)ht_drive_clear(l->drive);
    if (result == (uint16_t)HT_OK) {
        l->burst.command = 1u;
    }
    return result;
}

static bool take_channels(ht_service *l, const uint16_t *in, uint16_t n, uint16_t *ids)
{
    uint16_t k;
    for (k = 0u; k < n; k++) {
        ids[k] = ht_get16(&in[2u * k]);
        if (ids[k] >= ht_channel_count()) {
            l->detail = ids[k];
            return false;
        }
    }
    return true;
}

/* Bytes a second of a stream: rounded up. */
static uint32_t load(float interrupts_Hz, uint16_t n, uint16_t decimation)
{
    float octets = 4.0f * (float)n + SAMPLE_HEAD;
    float samples_Hz = interrupts_Hz / (float)decimation;
    float sum = octets * samples_Hz;
    return (n == 0u) ? 0u : ((uint32_t)sum + 1u);
}

/* Smallest decimation with which a stream of `n` channels takes up to `rest` bytes a
 * second; 0: none. */
static uint16_t smallest(float interrupts_Hz, uint16_t n, uint32_t rest)
{
    uint32_t least;
    if (rest == 0u) {
        return 0u;
    }
    least = load(interrupts_Hz, n, 1u) / rest; /* this one or the next */
    if (least >= 0xFFFFu) {
        return 0u;
    }
    if ((least == 0u) || (load(interrupts_Hz, n, (uint16_t)least) > rest)) {
        least++;
    }
    return (load(interrupts_Hz, n, (uint16_t)least) > rest) ? 0u : (uint16_t)least;
}

static uint16_t stream(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t ids[HT_STREAM_CHANNELS];
    uint32_t others = 0u;
    uint32_t budget = streams_budget(l);
    float interrupts_Hz = rate_Hz(l);
    uint32_t needed;
    uint16_t slot;
    uint16_t count;
    uint16_t decimation;
    uint16_t k;
    if ((n < 4u) || (n != (4u + (2u * in[1])))) {
        return HT_SERVICE_LENGTH;
    }
    slot = in[0];
    count = in[1];
    decimation = ht_get16(&in[2]);
    if (slot >= HT_STREAMS) {
        return HT_SERVICE_NO_STREAM;
    }
    if (count > HT_STREAM_CHANNELS) {
        return field(l, 1u);
    }
    if (decimation == 0u) {
        return field(l, 2u);
    }
    if (!take_channels(l, &in[4], count, ids)) {
        return HT_ERROR_ID;
    }
    for (k = 0u; k < HT_STREAMS; k++) {
        if ((k != slot) && (l->streams.stream[k].active != 0u)) {
            others += load(interrupts_Hz, l->streams.stream[k].n, l->streams.stream[k].decimation);
        }
    }
    needed = load(interrupts_Hz, count, decimation);
    if ((others + needed) > budget) {
        l->detail = smallest(interrupts_Hz, count, (others < budget) ? (budget - others) : 0u);
        return HT_SERVICE_BUDGET;
    }
    ht_streams_set(&l->streams, slot, ids, count, decimation);
    l->begins = slot;
    ht_packet_add32(&l->reply, others + needed);
    ht_packet_add32(&l->reply, budget);
    return HT_OK;
}

#define ARM_HEAD 18u

static uint16_t arm(ht_service *l, const uint16_t *in, uint16_t n)
{
    /* by ht_burst_answer */
    static const uint16_t offset[HT_BURST_TOO_LARGE] = {0u, 0u, 1u, 2u, 4u, 8u, 14u};
    ht_burst_setup setup;
    ht_burst_answer answer;
    if ((n < ARM_HEAD) || (n != (ARM_HEAD + (2u * in[0])))) {
        return HT_SERVICE_LENGTH;
    }
    setup.n = in[0];
    setup.trigger = in[1];
    setup.prescaler = ht_get16(&in[2]);
    setup.samples = ht_get32(&in[4]);
    setup.before = ht_get32(&in[8]);
    setup.channel = ht_get16(&in[12]);
    setup.level = ht_float_of(ht_get32(&in[14]));
    if (setup.n > HT_BURST_CHANNELS) {
        return field(l, 0u);
    }
    if (setup.channel >= ht_channel_count()) {
        l->detail = setup.channel;
        return HT_ERROR_ID;
    }
    if (!take_channels(l, &in[ARM_HEAD], setup.n, setup.id)) {
        return HT_ERROR_ID;
    }
    answer = ht_burst_arm(&l->burst, &setup);
    if (answer == HT_BURST_TOO_LARGE) {
        l->detail = l->burst.size / setup.n;
        return HT_SERVICE_MEMORY;
    }
    if (answer != HT_BURST_ARMED) {
        return field(l, offset[answer]);
    }
    l->read_left = 0u; /* of the capture that was there */
    ht_packet_add8(&l->reply, l->burst.number);
    return HT_OK;
}

static uint16_t capture(ht_service *l, const uint16_t *in, uint16_t n)
{
    const ht_burst *b = &l->burst;
    ht_packet *p = &l->reply;
    uint16_t state = b->state; /* once: the interrupt moves it on */
    uint16_t k;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_packet_add8(p, state);
    ht_packet_add8(p, b->number);
    ht_packet_add16(p, b->setup.prescaler);
    ht_packet_add32(p, b->setup.samples);
    ht_packet_add32(p, b->setup.before);
    ht_packet_add32(p, b->tick);
    ht_packet_add32(p, (state == (uint16_t)HT_BURST_COMPLETE) ? b->crc : 0u);
    for (k = 0u; k < b->setup.n; k++) {
        ht_packet_add16(p, b->setup.id[k]);
    }
    return HT_OK;
}

static uint16_t read(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint32_t first;
    uint32_t count;
    uint32_t values = ht_burst_values(&l->burst);
    if (n != 8u) {
        return HT_SERVICE_LENGTH;
    }
    first = ht_get32(in);
    count = ht_get32(&in[4]);
    if (l->burst.state != (uint16_t)HT_BURST_COMPLETE) {
        return HT_SERVICE_CAPTURE;
    }
    if (first > values) {
        return field(l, 0u);
    }
    if (count > (values - first)) {
        return field(l, 4u);
    }
    l->read_at = first;
    l->read_left = count;
    return HT_OK;
}

static uint16_t trigger(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    if ((l->burst.state != (uint16_t)HT_BURST_FILLING)
        && (l->burst.state != (uint16_t)HT_BURST_WAITING)) {
        return HT_SERVICE_CAPTURE;
    }
    l->burst.manual = 1u;
    return HT_OK;
}

static uint16_t cancel(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_burst_cancel(&l->burst);
    l->read_left = 0u;
    return HT_OK;
}

static uint16_t snapshot(ht_service *l, const uint16_t *in, uint16_t n)
{
    const volatile ht_snapshot *s = &l->drive->snapshot;
    ht_packet *p = &l->reply;
    uint16_t begin = p->n;
    uint32_t tick;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    do { /* again, if a fault came in between: its tick is another one */
        tick = s->tick;
        p->n = begin;
        ht_snapshot_add(p, s);
    } while (s->tick != tick);
    return HT_OK;
}

ht_result ht_service_keep(const ht_service *l)
{
    if (l->setup.store == NULL) {
        return HT_ERROR_STORE;
    }
    return rate_is_used(l) ? HT_ERROR_STATE : ht_store_save(l->setup.store, l->drive);
}

ht_result ht_service_forget(const ht_service *l)
{
    if (l->setup.store == NULL) {
        return HT_ERROR_STORE;
    }
    return rate_is_used(l) ? HT_ERROR_STATE : ht_store_forget(l->setup.store, l->drive);
}

/* The reply to a SAVE or FORGET tells a memory that fails from none at all. */
static uint16_t stored(ht_service *l, ht_result result)
{
    if ((result == HT_ERROR_STORE) && (l->setup.store != NULL)
        && (l->setup.store->port.read != NULL)) {
        l->detail = 0u;
    }
    return (uint16_t)result;
}

static uint16_t save(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    return (n != 0u) ? (uint16_t)HT_SERVICE_LENGTH : stored(l, ht_service_keep(l));
}

static uint16_t forget(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    return (n != 0u) ? (uint16_t)HT_SERVICE_LENGTH : stored(l, ht_service_forget(l));
}

typedef struct {
    uint16_t needs;
    uint16_t (*carry_out)(ht_service *l, const uint16_t *in, uint16_t n);
} handler;

/* By opcode. There is none for 0. */
static const handler handlers[(uint16_t)HT_OP_LAST + 1u] = {
    [HT_OP_HELLO] = {NEEDS_NOTHING, hello},       [HT_OP_LIST] = {NEEDS_NOTHING, list},
    [HT_OP_OPEN] = {NEEDS_NOTHING, open_session}, [HT_OP_CLOSE] = {NEEDS_SESSION, close_session},
    [HT_OP_STATUS] = {NEEDS_NOTHING, status},     [HT_OP_GET] = {NEEDS_DICTIONARY, get},
    [HT_OP_WRITE] = {NEEDS_BOTH, write},          [HT_OP_START] = {NEEDS_BOTH, start},
    [HT_OP_STOP] = {NEEDS_NOTHING, stop},         [HT_OP_CLEAR] = {NEEDS_BOTH, clear},
    [HT_OP_STREAM] = {NEEDS_BOTH, stream},        [HT_OP_ARM] = {NEEDS_BOTH, arm},
    [HT_OP_CAPTURE] = {NEEDS_NOTHING, capture},   [HT_OP_READ] = {NEEDS_SESSION, read},
    [HT_OP_TRIGGER] = {NEEDS_SESSION, trigger},   [HT_OP_CANCEL] = {NEEDS_SESSION, cancel},
    [HT_OP_SNAPSHOT] = {NEEDS_NOTHING, snapshot}, [HT_OP_SAVE] = {NEEDS_BOTH, save},
    [HT_OP_FORGET] = {NEEDS_BOTH, forget},
};

static uint16_t carry_out(ht_service *l, const uint16_t *octets, uint16_t n)
{
    const handler *h;
    uint16_t dictionary;
    bool owner;
    if (n < HT_SERVICE_REQUEST_HEAD) {
        return HT_SERVICE_LENGTH;
    }
    if (octets[0] > (uint16_t)HT_OP_LAST) {
        return HT_SERVICE_OPCODE;
    }
    h = &handlers[octets[0]];
    if (h->carry_out == NULL) {
        return HT_SERVICE_OPCODE;
    }
    l->asks = ht_get16(&octets[2]);
    dictionary = ht_get16(&octets[4]);
    owner = (l->session != 0u) && (l->asks == l->session);
    if (owner && (octets[0] != (uint16_t)HT_OP_START)) {
        l->started = false; /* its host has gone on: no repetition of that START will come */
    }
    if (((h->needs & (uint16_t)NEEDS_SESSION) != 0u) && !owner) {
        return HT_SERVICE_SESSION;
    }
    if (((h->needs & (uint16_t)NEEDS_DICTIONARY) != 0u)
        && (dictionary != (uint16_t)(l->dictionary & 0xFFFFu))) {
        return HT_SERVICE_DICTIONARY;
    }
    return h->carry_out(l, &octets[HT_SERVICE_REQUEST_HEAD],
                        (uint16_t)(n - HT_SERVICE_REQUEST_HEAD));
}

static bool has_detail(uint16_t status_code)
{
    return ((status_code >= (uint16_t)HT_ERROR_ID) && (status_code < (uint16_t)HT_SERVICE_OPCODE))
           || (status_code == (uint16_t)HT_SERVICE_BUDGET)
           || (status_code == (uint16_t)HT_SERVICE_FIELD)
           || (status_code == (uint16_t)HT_SERVICE_SAMPLING);
}

void ht_service_execute(ht_service *l, const uint16_t *octets, uint16_t n)
{
    ht_packet *p = &l->reply;
    uint16_t result;
    uint16_t k;
    ht_packet_begin(p);
    for (k = 0u; k < HT_SERVICE_REPLY_HEAD; k++) {
        ht_packet_add8(p, 0u);
    }
    l->detail = NO_DETAIL;
    result = carry_out(l, octets, n);
    if (result != (uint16_t)HT_OK) {
        p->n = HT_SERVICE_REPLY_HEAD;
        if (has_detail(result)) {
            ht_packet_add16(p, (uint16_t)l->detail);
        }
        if (result == (uint16_t)HT_SERVICE_MEMORY) {
            ht_packet_add32(p, l->detail);
        }
    }
    p->octet[0] = (uint16_t)(octets[0] | (uint16_t)HT_OP_REPLY);
    p->octet[1] = octets[1];
    p->octet[2] = result;
    p->octet[3] = l->drive->state;
    ht_put16(&p->octet[4], l->drive->faults);
    ht_put32(&p->octet[6], l->drive->tick);
}
