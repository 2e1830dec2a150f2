#include "rules.h"

#include <math.h>
#include <string.h>

#include "check.h"
#include "rig.h"

#define ARRIVED 16u /* octets of a turn */

rules the_rules;

/* Of the turn under way. */
static rules_before before;
static bool reply_was_due;
static bool in_turn;
static bool interrupted; /* after the octets were read */
static bool stopped;     /* a request has asked for it */
static uint16_t arrived[ARRIVED];
static uint16_t arrived_n;
static bool arrived_lost;

void rules_begin(void)
{
    uint16_t id;
    memset(&the_rules, 0, sizeof the_rules);
    CHECK(ht_param_count() <= RULES_PARAMS);
    for (id = 0; id < ht_param_count(); id++) {
        the_rules.value[id] = ht_drive_get(&the_rig.drive, id);
    }
}

void rules_debugger_starts(bool done)
{
    the_rules.elsewhere = the_rules.elsewhere || done;
}

/* --- what holds at any time ------------------------------------------------------------------ */

static bool running(void)
{
    return (the_rig.drive.state != (uint16_t)HT_STATE_IDLE)
           && (the_rig.drive.state != (uint16_t)HT_STATE_FAULT);
}

static void check_drive(void)
{
    const ht_drive *d = &the_rig.drive;
    CHECK(d->state < (uint16_t)HT_STATES);
    CHECK((d->faults & 0xA000u) == 0u); /* no such fault; the clock is right here */
    CHECK((d->state != (uint16_t)HT_STATE_FAULT) || (d->faults != 0u));
    CHECK(running() || rig_gates_off());
    if (the_rig.registers->violations != 0u) {
        fprintf(stderr, "register %lx: %s %s\n", (unsigned long)the_rig.registers->log[0].address,
                ht_regfile_kind(the_rig.registers->log[0].kind), the_rig.registers->log[0].why);
    }
    CHECK(the_rig.registers->violations == 0u);
}

void rules_parameters(void)
{
    uint16_t id;
    for (id = 0; id < ht_param_count(); id++) {
        const ht_param_info *info = ht_param_describe(id);
        float value = ht_drive_get(&the_rig.drive, id);
        CHECK(value == the_rules.value[id]);
        CHECK((value >= info->min) && (value <= info->max));
    }
}

/* A drive that the link has started must not run without its host. */
static void check_watchdog(void)
{
    const ht_service *s = &the_rig.service;
    if (!running()) {
        the_rules.elsewhere = false;
    } else if (!the_rules.elsewhere) {
        CHECK(s->armed != 0u);
        CHECK(the_rules.session != 0u);
        CHECK(the_rig.drive.tick - the_rules.session_tick <= ht_service_watchdog_ticks(s));
    } else {
        /* a drive that was started elsewhere is not guarded */
    }
}

double rules_rate_Hz(void)
{
    double clock_Hz = ht_board_f28377s.map->pwm_clock_Hz;
    return clock_Hz / round(clock_Hz / the_rules.value[HT_P_f_isr_Hz]);
}

static void check_streams(void)
{
    const ht_streams *s = &the_rig.service.streams;
    double rate = rules_rate_Hz();
    double octets_per_s = 0.0;
    unsigned k;
    unsigned i;
    CHECK((s->head < HT_STREAM_RING) && (s->tail < HT_STREAM_RING));
    for (k = 0; k < HT_STREAMS; k++) {
        const ht_stream *one = &s->stream[k];
        if (one->active == 0u) {
            continue;
        }
        CHECK(the_rules.session != 0u);
        CHECK((one->n >= 1u) && (one->n <= HT_STREAM_CHANNELS) && (one->decimation >= 1u));
        CHECK((one->left >= 1u) && (one->left <= one->decimation) && (one->number < 256u));
        for (i = 0; i < one->n; i++) {
            CHECK(one->id[i] < ht_channel_count());
        }
        octets_per_s += (12.0 + 4.0 * one->n) * rate / one->decimation;
    }
    CHECK(octets_per_s <= 0.9 * the_rig.service.setup.line.octets_per_s);
}

static void check_capture(void)
{
    const ht_service *s = &the_rig.service;
    const ht_burst *b = &s->burst;
    uint64_t values = (uint64_t)b->setup.samples * b->setup.n;
    if (b->state != (uint16_t)HT_BURST_NONE) {
        CHECK(b->state <= (uint16_t)HT_BURST_COMPLETE);
        CHECK((values >= 1u) && (values <= RIG_MEMORY) && (b->at < values));
        CHECK((b->setup.before < b->setup.samples) && (b->rows < b->setup.samples));
        CHECK((b->left >= 1u) && (b->left <= b->setup.prescaler));
    }
    if (s->read_left != 0u) {
        CHECK(b->state == (uint16_t)HT_BURST_COMPLETE);
        CHECK((uint64_t)s->read_at + s->read_left <= values);
    }
}

static void check_packets(void)
{
    const ht_service *s = &the_rig.service;
    CHECK((s->reply.n <= HT_PACKET_BODY) && !s->reply.full);
    CHECK((s->out.sent <= s->out.n) && (s->out.n <= HT_PACKET_LINE));
    CHECK(s->in.n <= HT_PACKET_BODY + HT_PACKET_CRC);
}

static void check_all(void)
{
    check_drive();
    check_watchdog();
    check_streams();
    check_capture();
    check_packets();
}

void rules_fast(void)
{
    interrupted = true;
    if (!in_turn) { /* else the session may be about to end */
        check_all();
    } else {
        CHECK(running() || rig_gates_off());
    }
}

/* --- what the device reads ------------------------------------------------------------------- */

static void remember(void)
{
    const ht_service *s = &the_rig.service;
    before.state = the_rig.drive.state;
    before.faults = the_rig.drive.faults;
    before.capture = s->burst.state;
    before.capture_number = s->burst.number;
    before.tick = the_rig.drive.tick;
    memcpy(before.stream, s->streams.stream, sizeof before.stream);
    before.setup = s->burst.setup;
}

void rules_before_turn(void)
{
    reply_was_due = the_rig.service.reply_due;
    in_turn = true;
    stopped = false;
    arrived_n = 0;
}

void rules_read(const uint16_t *octets, uint16_t n, bool lost)
{
    memcpy(arrived, octets, n * sizeof *octets);
    arrived_n = n;
    arrived_lost = lost;
    interrupted = false;
    remember();
}

/* The effect of every request, carried out or not. */
static void restart_session_time(const uint8_t *body, size_t n)
{
    if (n < 6u) {
        return;
    }
    if ((the_rules.session != 0u) && ((body[2] | (body[3] << 8)) == the_rules.session)) {
        the_rules.session_tick = before.tick;
    }
}

/* A body has come in. True if it is carried out now. */
static bool is_new(const uint8_t *body, size_t n)
{
    uint32_t crc = reference_crc(body, n);
    if ((body[0] == 0u) || (body[0] >= 0x40u)) {
        the_rules.damaged++;
        return false;
    }
    restart_session_time(body, n);
    if (the_rules.answered && (crc == the_rules.last_crc)) {
        reply_was_due = true;
        return false;
    }
    if (reply_was_due) {
        return false;
    }
    reply_was_due = true;
    the_rules.answered = true;
    the_rules.last_crc = crc;
    return true;
}

static void same_as_before(void)
{
    const ht_service *s = &the_rig.service;
    CHECK(interrupted || stopped || (the_rig.drive.state == before.state));
    CHECK(s->burst.number == before.capture_number);
    if (!the_rules.answered) {
        return;
    }
    CHECK(s->reply.n == the_rules.reply.n);
    if ((s->reply.octet[0] != 0x87u) || s->reply_waits) { /* else it got its tick just now */
        CHECK(memcmp(s->reply.octet, the_rules.reply.octet, s->reply.n * sizeof s->reply.octet[0])
              == 0);
    }
}

static void expire(void)
{
    uint32_t most = 4u * ht_service_watchdog_ticks(&the_rig.service);
    if ((the_rules.session != 0u) && (before.tick - the_rules.session_tick > most)) {
        the_rules.session = 0u;
    }
}

/* Bodies that the turn's octets have closed. Returns how many. */
static unsigned closed(uint8_t bodies[ARRIVED][REFERENCE_BODY + 4], size_t *lengths)
{
    rules_frame *f = &the_rules.to;
    unsigned count = 0;
    uint16_t k;
    f->damaged = f->damaged || arrived_lost;
    for (k = 0; k < arrived_n; k++) {
        uint8_t octet = (uint8_t)arrived[k];
        size_t n;
        if (octet != 0u) {
            if (f->n < RULES_FRAME) {
                f->octet[f->n] = octet;
            }
            f->n += (f->n <= RULES_FRAME) ? 1u : 0u;
            continue;
        }
        n = ((f->n > RULES_FRAME) || f->damaged) ? 0u
                                                 : reference_body(f->octet, f->n, bodies[count]);
        if (n != 0u) {
            stopped = stopped || ((bodies[count][0] == HT_OP_STOP) && (n == 6u));
            lengths[count] = n;
            count++;
        } else if ((f->n != 0u) || f->damaged) {
            the_rules.damaged++;
        } else {
            /* between two frames */
        }
        f->n = 0u;
        f->damaged = false;
    }
    return count;
}

void rules_turn(void)
{
    static uint8_t bodies[ARRIVED][REFERENCE_BODY + 4];
    const ht_service *s = &the_rig.service;
    size_t lengths[ARRIVED];
    unsigned count = closed(bodies, lengths);
    bool any = false;
    unsigned k;
    for (k = 0; k < count; k++) {
        if (is_new(bodies[k], lengths[k])) {
            any = true;
            rules_request(bodies[k], lengths[k], &before, interrupted || stopped);
            the_rules.previous = the_rules.reply;
            the_rules.reply = s->reply;
        }
    }
    if (any) {
        rules_parameters();
    } else {
        same_as_before();
    }
    CHECK(!stopped || !running());
    expire();
    in_turn = false;
    CHECK(s->session == the_rules.session);
    CHECK(s->damaged == the_rules.damaged);
    if (s->reply.octet[0] == 0x87u) {
        the_rules.reply = s->reply; /* by now it may have its tick */
    }
    check_all();
}

/* --- what the device sends ------------------------------------------------------------------- */

static bool is(const ht_packet *reply, const uint8_t *body, size_t n)
{
    size_t k;
    bool same = n == reply->n;
    for (k = 0; same && (k < n); k++) {
        same = body[k] == reply->octet[k];
    }
    return same;
}

static void sent(const uint8_t *body, size_t n)
{
    if (body[0] >= 0x80u) {
        CHECK(n >= 10u);
        CHECK(is(&the_rig.service.reply, body, n) || is(&the_rules.reply, body, n)
              || is(&the_rules.previous, body, n));
    } else if (body[0] == 0x50u) {
        uint32_t first = body[2] | ((uint32_t)body[3] << 8);
        CHECK((n > 6u) && ((n - 6u) % 4u == 0u) && ((n - 6u) / 4u <= 60u));
        CHECK((body[4] == 0u) && (body[5] == 0u));
        CHECK(first + (n - 6u) / 4u <= RIG_MEMORY);
    } else {
        CHECK((body[0] >= 0x40u) && (body[0] < 0x40u + HT_STREAMS));
        CHECK((n > 6u) && ((n - 6u) % 4u == 0u) && ((n - 6u) / 4u <= HT_STREAM_CHANNELS));
    }
}

void rules_write(const uint16_t *octets, uint16_t n)
{
    rules_frame *f = &the_rules.from;
    uint8_t body[REFERENCE_BODY + 4];
    uint16_t k;
    for (k = 0; k < n; k++) {
        CHECK(octets[k] <= 0xFFu);
        if (octets[k] != 0u) {
            CHECK(f->n < REFERENCE_FRAME);
            f->octet[f->n] = (uint8_t)octets[k];
            f->n++;
        } else {
            size_t length = reference_body(f->octet, f->n, body);
            CHECK(length != 0u);
            sent(body, length);
            f->n = 0u;
        }
    }
}
