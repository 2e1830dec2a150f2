/* The conditions and effects of each request, from the tables of docs/protocol.md. */
#include <math.h>
#include <string.h>

#include "check.h"
#include "ht_dictionary.h"
#include "rig.h"
#include "rules.h"

/* clang-format off */
enum {
    HELLO = 1, LIST, OPEN, CLOSE, STATUS, GET, WRITE, START, STOP, CLEAR, STREAM, ARM, CAPTURE,
    READ, TRIGGER, CANCEL, SNAPSHOT, SAVE, FORGET, FORGET_LOG, OPCODES
};
enum {
    DONE, NO_ID, BAD_VALUE, BAD_STATE, NO_FIT, NO_HARDWARE, TURNING, TRIPPED,
    NO_PREDICTION = 9, TOO_SLOW, RESTARTS, NOT_CHARGED = 14,
    NO_OPCODE = 16, BAD_LENGTH, NO_SESSION, STALE, BUSY, BUDGET, NO_CAPTURE, NO_STREAM,
    BAD_FIELD, TOO_LARGE, SAMPLING
};
/* clang-format on */

#define NEEDS_SESSION                                                                \
    ((1u << CLOSE) | (1u << TRIGGER) | (1u << CANCEL) | (1u << READ) | (1u << WRITE) \
     | (1u << START) | (1u << CLEAR) | (1u << STREAM) | (1u << ARM) | (1u << SAVE)   \
     | (1u << FORGET) | (1u << FORGET_LOG))
#define NEEDS_DICTIONARY                                                                        \
    ((1u << GET) | (1u << WRITE) | (1u << START) | (1u << CLEAR) | (1u << STREAM) | (1u << ARM) \
     | (1u << SAVE) | (1u << FORGET) | (1u << FORGET_LOG))
#define NO_PAYLOAD                                                                                 \
    ((1u << HELLO) | (1u << CLOSE) | (1u << STATUS) | (1u << START) | (1u << STOP) | (1u << CLEAR) \
     | (1u << CAPTURE) | (1u << TRIGGER) | (1u << CANCEL) | (1u << SNAPSHOT) | (1u << SAVE)        \
     | (1u << FORGET) | (1u << FORGET_LOG))
#define COMMANDS ((1u << WRITE) | (1u << START) | (1u << STOP) | (1u << CLEAR))

static uint16_t u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | (at[1] << 8));
}

static uint32_t u32(const uint8_t *at)
{
    return u16(at) | ((uint32_t)u16(&at[2]) << 16);
}

static float f32(const uint8_t *at)
{
    uint32_t bits = u32(at);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* A reply's number. */
static uint32_t answered(unsigned at, unsigned octets)
{
    const uint16_t *octet = &the_rig.service.reply.octet[at];
    uint32_t value = 0;
    unsigned k;
    for (k = octets; k > 0; k--) {
        value = (value << 8) | octet[k - 1];
    }
    return value;
}

static bool length_fits(unsigned opcode, const uint8_t *in, size_t n)
{
    if (((1ul << opcode) & NO_PAYLOAD) != 0) {
        return n == 0;
    }
    switch (opcode) {
    case LIST:
        return n == 3;
    case OPEN:
        return n == 6;
    case GET:
        return (n % 2 == 0) && (n <= 200);
    case WRITE:
        return (n != 0) && (n % 6 == 0) && (n <= 480);
    case STREAM:
        return (n >= 4) && (n == 4u + 2u * in[1]);
    case ARM:
        return (n >= 18) && (n == 18u + 2u * in[0]);
    default: /* READ */
        return n == 8;
    }
}

static bool valid(uint16_t id, float value)
{
    const ht_param_info *info = ht_param_describe(id);
    if ((id == HT_P_dead_time_us) && !(value >= 1.0f)) { /* the rig's board: 1 .. 20 us */
        return false;
    }
    if ((id == HT_P_min_pulse_us) && !(value >= 2.0f)) { /* the rig's board: 2 .. 20 us */
        return false;
    }
    return (value >= info->min) && (value <= info->max)
           && (!info->whole || (floorf(value) == value));
}

static bool sampling(const rules_before *b)
{
    unsigned k;
    for (k = 0; k < HT_STREAMS; k++) {
        if (b->stream[k].active != 0u) {
            return true;
        }
    }
    return (b->capture >= HT_BURST_FILLING) && (b->capture <= HT_BURST_TRIGGERED);
}

/* The answer to a WRITE, as far as single values decide it. */
static unsigned judged(const uint8_t *in, size_t n, const rules_before *b)
{
    size_t k;
    for (k = 0; k < n; k += 6) {
        if ((u16(&in[k]) == HT_P_f_isr_Hz) && sampling(b)
            && (f32(&in[k + 2]) != the_rules.value[HT_P_f_isr_Hz])) {
            return SAMPLING;
        }
    }
    for (k = 0; k < n; k += 6) {
        uint16_t id = u16(&in[k]);
        if (id >= ht_param_count()) {
            return NO_ID;
        }
        if (!valid(id, f32(&in[k + 2]))) {
            return BAD_VALUE;
        }
        if ((ht_param_describe(id)->when == HT_WHEN_IDLE) && (b->state != HT_STATE_IDLE)) {
            return BAD_STATE;
        }
    }
    return DONE;
}

/* Rows of a kind of LIST. */
static unsigned rows_of(unsigned kind)
{
    switch (kind) {
    case HT_LIST_FAULTS:
    case HT_LIST_COUNTERS:
        return 1u;
    case HT_LIST_EVENTS:
        return ht_log_events(&the_rig.log);
    case HT_LIST_LIMITS:
        return HT_LIMITS;
    default:
        return ht_dictionary_rows((uint16_t)kind);
    }
}

/* What a parameter is if the WRITE is carried out. */
static float wanted(const uint8_t *in, size_t n, uint16_t id)
{
    float value = the_rules.value[id];
    size_t k;
    for (k = 0; k < n; k += 6) {
        value = (u16(&in[k]) == id) ? f32(&in[k + 2]) : value;
    }
    return value;
}

/* A scheme that commands a voltage decides one period ahead. */
static bool needs_prediction(float scheme)
{
    return (scheme == (float)HT_DB_DTFC) || (scheme == (float)HT_FOC)
           || (scheme == (float)HT_FOC_24) || (scheme == (float)HT_DB_IPWM);
}

/* An answer to values that are right one by one: does it fit them together? */
static bool fits_together(const uint8_t *in, size_t n, unsigned status)
{
    bool modulated = needs_prediction(wanted(in, n, HT_P_scheme));
    bool ahead = (wanted(in, n, HT_P_load_mode) == 0.0f) && (wanted(in, n, HT_P_predict) != 0.0f);
    switch (status) {
    case DONE:
        return !modulated || ahead;
    case NO_PREDICTION:
        return modulated && !ahead;
    case TOO_SLOW:
        return modulated && ahead;
    default:
        return (status == NO_FIT) || (status == NO_HARDWARE);
    }
}

static void check_write(const uint8_t *in, size_t n, const rules_before *b, unsigned status)
{
    unsigned judgement = judged(in, n, b);
    size_t k;
    CHECK((judgement == DONE) ? fits_together(in, n, status) : (status == judgement));
    if (status != DONE) {
        return;
    }
    for (k = 0; k < n; k += 6) {
        the_rules.value[u16(&in[k])] = f32(&in[k + 2]);
    }
    CHECK(the_rig.service.reply.n == 14u + 4u * (n / 6));
    for (k = 0; k < n / 6; k++) {
        uint32_t bits;
        memcpy(&bits, &the_rules.value[u16(&in[6 * k])], 4);
        CHECK(answered(14u + 4u * (unsigned)k, 4) == bits);
    }
}

static void check_get(const uint8_t *in, size_t n, unsigned status)
{
    size_t k;
    if (status != DONE) {
        CHECK(status == NO_ID);
        return;
    }
    CHECK(the_rig.service.reply.n == 10u + 2u * n);
    for (k = 0; k < n; k += 2) {
        uint32_t bits;
        CHECK(u16(&in[k]) < ht_param_count());
        memcpy(&bits, &the_rules.value[u16(&in[k])], 4);
        CHECK(answered(10u + 2u * (unsigned)k, 4) == bits);
    }
}

static void check_stream(const uint8_t *in, const rules_before *b, unsigned status)
{
    const ht_stream *now = the_rig.service.streams.stream;
    unsigned n = in[1];
    unsigned k;
    bool ids = true;
    for (k = 0; k < n; k++) {
        ids = ids && (u16(&in[4 + 2 * k]) < ht_channel_count());
    }
    if (in[0] >= HT_STREAMS) {
        CHECK(status == NO_STREAM);
    } else if ((n > HT_STREAM_CHANNELS) || (u16(&in[2]) == 0)) {
        CHECK(status == BAD_FIELD);
        CHECK(answered(10, 2) == ((n > HT_STREAM_CHANNELS) ? 1u : 2u));
    } else if (!ids) {
        CHECK(status == NO_ID);
    } else if (status == BUDGET) {
        uint32_t least = answered(10, 2);
        double others = 0.0;
        double rate = rules_rate_Hz();
        double most = 0.9 * the_rig.service.setup.line.octets_per_s;
        for (k = 0; k < HT_STREAMS; k++) {
            if ((k != in[0]) && (b->stream[k].active != 0u)) {
                others += (12.0 + 4.0 * b->stream[k].n) * rate / b->stream[k].decimation;
            }
        }
        /* Loads are whole octets a second, rounded up. */
        CHECK(others + (12.0 + 4.0 * n) * rate / u16(&in[2]) > most - 6.0);
        if (least != 0) {
            CHECK(least > u16(&in[2]));
            CHECK(others + (12.0 + 4.0 * n) * rate / least <= most);
            CHECK(others + (12.0 + 4.0 * n) * rate / (least - 1u) > most - 6.0);
        }
    } else {
        CHECK(status == DONE);
        CHECK((n != 0) ? ((now[in[0]].active != 0u) || (the_rig.service.begins == in[0]))
                       : (now[in[0]].active == 0u));
        if (n != 0) {
            CHECK((now[in[0]].n == n) && (now[in[0]].decimation == u16(&in[2])));
        }
    }
}

/* Is the field at `offset` of an ARM out of range? */
static bool wrong_in_arm(const uint8_t *in, uint32_t offset)
{
    switch (offset) {
    case 0:
        return (in[0] == 0) || (in[0] > HT_BURST_CHANNELS);
    case 1:
        return in[1] >= HT_TRIGGERS;
    case 2:
        return u16(&in[2]) == 0;
    case 4:
        return u32(&in[4]) == 0;
    case 8:
        return u32(&in[8]) >= u32(&in[4]);
    case 14:
        return isnan(f32(&in[14]));
    default:
        return false;
    }
}

static void check_arm(const uint8_t *in, unsigned status)
{
    const ht_burst *burst = &the_rig.service.burst;
    uint32_t samples = u32(&in[4]);
    bool good = (in[0] >= 1) && (in[0] <= HT_BURST_CHANNELS) && (in[1] < HT_TRIGGERS)
                && (u16(&in[2]) != 0) && (u32(&in[8]) < samples) && !isnan(f32(&in[14]))
                && ((uint64_t)samples * in[0] <= RIG_MEMORY);
    bool ids = u16(&in[12]) < ht_channel_count();
    unsigned k;
    for (k = 0; (k < in[0]) && (in[0] <= HT_BURST_CHANNELS); k++) {
        ids = ids && (u16(&in[18 + 2 * k]) < ht_channel_count());
    }
    if (status == DONE) {
        CHECK(good && ids);
        CHECK((burst->setup.n == in[0]) && (burst->setup.samples == samples));
        CHECK(answered(10, 1) == burst->number);
        CHECK(the_rig.service.read_left == 0u);
    } else {
        CHECK(!ids || !good);
        switch (status) {
        case NO_ID:
            CHECK(!ids);
            break;
        case TOO_LARGE:
            CHECK((answered(10, 4) == RIG_MEMORY / in[0]) && (answered(10, 4) < samples));
            break;
        default:
            CHECK((status == BAD_FIELD) && wrong_in_arm(in, answered(10, 2)));
            break;
        }
    }
}

static void check_done(unsigned opcode, const uint8_t *in, bool disturbed)
{
    const ht_drive *d = &the_rig.drive;
    switch (opcode) {
    case OPEN:
        the_rules.session = u16(in);
        the_rules.mark = (the_rules.mark != 0u) ? the_rules.mark : u32(&in[2]);
        CHECK(answered(10, 4) == the_rules.mark);
        break;
    case CLOSE:
        the_rules.session = 0u;
        CHECK(the_rules.elsewhere || (d->state == HT_STATE_IDLE) || (d->state == HT_STATE_FAULT));
        break;
    case START:
        the_rules.started = true;
        the_rules.start_crc = the_rules.last_crc;
        CHECK(disturbed || (d->state == HT_STATE_CALIBRATE));
        break;
    case STOP:
        CHECK(rig_gates_off());
        break;
    case CLEAR:
        CHECK((d->state == HT_STATE_IDLE) && (d->faults == 0u));
        break;
    case CANCEL:
        CHECK(the_rig.service.burst.state == HT_BURST_NONE);
        break;
    case STATUS:
        CHECK(answered(26, 4) == the_rules.mark);
        break;
    case LIST:
        CHECK((in[0] <= HT_LIST_ADDITIONS)
              || ((in[0] >= HT_LIST_FAULTS) && (in[0] <= HT_LIST_LIMITS)));
        CHECK(the_rig.service.reply.n > 13u);
        break;
    default:
        break;
    }
}

static void unchanged(unsigned opcode, const rules_before *b, bool refused, bool disturbed)
{
    const ht_service *s = &the_rig.service;
    unsigned k;
    if (!disturbed && (refused || (((1ul << opcode) & (COMMANDS | (1ul << CLOSE))) == 0))) {
        CHECK((the_rig.drive.state == b->state) && (the_rig.drive.faults == b->faults));
    }
    if ((refused || ((opcode != STREAM) && (opcode != CLOSE))) && (the_rules.session != 0u)) {
        for (k = 0; k < HT_STREAMS; k++) {
            CHECK((s->session == 0u) || (s->streams.stream[k].active == b->stream[k].active));
            CHECK(s->streams.stream[k].n == ((s->session == 0u) ? 0u : b->stream[k].n));
        }
    }
    if (refused || (opcode != ARM)) {
        CHECK(s->burst.number == b->capture_number);
        CHECK(s->burst.setup.n == b->setup.n);
        CHECK(s->burst.setup.samples == b->setup.samples);
        if (refused || (opcode != CANCEL)) { /* it may continue */
            CHECK(s->burst.state >= b->capture);
        }
    }
}

static void check_detail(unsigned status, size_t n)
{
    bool has = ((status >= NO_ID) && (status < NO_OPCODE)) || (status == BUDGET)
               || (status == BAD_FIELD) || (status == SAMPLING);
    CHECK(n == ((status == TOO_LARGE) ? 14u : (has ? 12u : 10u)));
}

void rules_request(const uint8_t *body, size_t n, const rules_before *b, bool disturbed)
{
    const ht_service *s = &the_rig.service;
    unsigned opcode = body[0];
    unsigned status = s->reply.octet[2];
    const uint8_t *in = &body[6];
    bool owner;
    unsigned expected;
    CHECK(s->reply.octet[0] == (opcode | 0x80u));
    CHECK(s->reply.octet[1] == body[1]);
    CHECK(answered(6, 4) == b->tick);
    if ((n < 6) || (opcode >= OPCODES)) {
        CHECK(status == ((n < 6) ? BAD_LENGTH : NO_OPCODE));
        unchanged(0, b, true, disturbed);
        return;
    }
    owner = (the_rules.session != 0u) && (u16(&body[2]) == the_rules.session);
    the_rules.started = the_rules.started && (!owner || (opcode == START));
    if ((((1ul << opcode) & NEEDS_SESSION) != 0) && !owner) {
        expected = NO_SESSION;
    } else if ((((1ul << opcode) & NEEDS_DICTIONARY) != 0)
               && (u16(&body[4]) != (s->dictionary & 0xFFFFu))) {
        expected = STALE;
    } else if (!length_fits(opcode, in, n - 6)) {
        expected = BAD_LENGTH;
    } else if (opcode == OPEN) {
        expected =
            (u16(in) == 0)
                ? BAD_FIELD
                : (((the_rules.session != 0u) && (u16(in) != the_rules.session)) ? BUSY : DONE);
        the_rules.session_tick = (expected == DONE) ? b->tick : the_rules.session_tick;
    } else if (opcode == READ) {
        uint64_t values = (uint64_t)b->setup.samples * b->setup.n;
        bool inside = (uint64_t)u32(in) + u32(&in[4]) <= values;
        expected = (b->capture != HT_BURST_COMPLETE) ? NO_CAPTURE : (inside ? DONE : BAD_FIELD);
    } else if (opcode == TRIGGER) {
        expected = ((b->capture == HT_BURST_FILLING) || (b->capture == HT_BURST_WAITING))
                       ? DONE
                       : NO_CAPTURE;
    } else if (opcode == START) {
        bool ready = (b->state == HT_STATE_IDLE) && (b->faults == 0u);
        bool old = the_rules.started && (the_rules.last_crc == the_rules.start_crc);
        expected = rig_trip_pin_low()
                       ? TRIPPED
                       : (!ready ? BAD_STATE : ((status == TURNING) ? TURNING : DONE));
        if ((expected == DONE) && (ht_drive_restart_wait(&the_rig.drive) != 0u)) {
            expected = RESTARTS;
        }
        if ((expected == DONE)
            && !ht_outputs_charged(&the_rig.drive.config->outputs, &the_rig.drive.outputs)) {
            expected = NOT_CHARGED;
        }
        expected = old ? BAD_STATE : expected;
    } else if (opcode == CLEAR) {
        bool latched = (b->state == HT_STATE_FAULT) || (b->faults != 0u);
        expected = rig_trip_pin_low() ? TRIPPED : (latched ? DONE : BAD_STATE);
    } else if ((opcode == SAVE) || (opcode == FORGET)) {
        bool off = (b->state == HT_STATE_IDLE) || (b->state == HT_STATE_FAULT);
        expected = (!off || sampling(b)) ? BAD_STATE : DONE;
        CHECK(off || (the_rig.store_writes == 0u));
    } else if (opcode == LIST) {
        expected = (u16(&in[1]) < rows_of(in[0])) ? DONE : NO_ID;
        if (in[0] == HT_LIST_EVENTS) { /* those in the memory are read with the gates off only */
            bool off = (ht_state_flags(b->state) & HT_AT_WORK) == 0u;
            bool last = u16(&in[1]) + 1u >= rows_of(in[0]); /* one may have come since */
            expected = ((last && (status == NO_ID)) || (!off && (status == BAD_STATE))) ? status
                                                                                        : expected;
        }
    } else if (opcode == FORGET_LOG) {
        bool off = (b->state == HT_STATE_IDLE) || (b->state == HT_STATE_FAULT);
        expected = (!off || (status == BAD_STATE)) ? BAD_STATE : DONE; /* or the memory is busy */
    } else if ((opcode == WRITE) || (opcode == GET) || (opcode == STREAM) || (opcode == ARM)) {
        expected = status; /* below */
        if (opcode == WRITE) {
            check_write(in, n - 6, b, status);
        } else if (opcode == GET) {
            check_get(in, n - 6, status);
        } else if (opcode == STREAM) {
            check_stream(in, b, status);
        } else {
            check_arm(in, status);
        }
    } else {
        expected = DONE;
    }
    CHECK(status == expected);
    if (status == DONE) {
        check_done(opcode, in, disturbed);
    } else {
        check_detail(status, s->reply.n);
    }
    unchanged(opcode, b, status != DONE, disturbed);
}
