#include "ht_log.h"

#include <math.h>
#include <stddef.h>

#include "ht_octets.h"

#define KIND_COUNTERS (HT_LOG_VALUE_FIRST + 0u)
#define KIND_TRIPS (HT_LOG_VALUE_FIRST + 1u)
#define MANY 0xFFFFu
#define OCTET_BITS 8u
#define KIND 0x00FFu /* in a record's first word */

#define HOUR_S 3600u
#define TOKEN_S 60u
/* Room in the queue that only trips take: what comes before a trip must not push it out. */
#define FOR_TRIPS 2u
/* A board that its watchdog starts again and again does not fill the log. */
#define WATCHDOGS_NOTED 8u

/* The kinds of entry that the ring writes. */
enum { PUT_NOTHING, PUT_EVENT, PUT_COUNTERS, PUT_TRIPS };

/* No fault is without its count: else this divides by 0. */
enum {
    FAULTS = 0
#define HT_FAULT(name, bit, text, help) +1
#include "ht_faults.def"
#undef HT_FAULT
    ,
    TRIPS_HAVE_ROOM = 1 / ((FAULTS <= (int)HT_LOG_TRIPS) ? 1 : 0)
};

static uint32_t word32(const uint16_t *words)
{
    return (uint32_t)words[0] | ((uint32_t)words[1] << 16);
}

static void put_word32(uint16_t *words, uint32_t value)
{
    words[0] = (uint16_t)(value & 0xFFFFu);
    words[1] = (uint16_t)(value >> 16);
}

static void put_float(uint16_t *words, float value)
{
    put_word32(words, ht_float_bits(value));
}

static uint16_t one_more(uint16_t count)
{
    return (count < MANY) ? (uint16_t)(count + 1u) : (uint16_t)MANY;
}

static uint16_t both(uint16_t low, uint16_t high)
{
    return (uint16_t)(low | (uint16_t)(high << OCTET_BITS));
}

/* --- events ---------------------------------------------------------------------------------- */

/* Three temperatures in the two words of one (ht_log.h). */
#define PACKED 0x8000u /* in word 1 */
#define AT_WINDING 28u
#define AT_DEVICE 30u
#define AT_SINK 32u
#define TEN_BITS 10u
#define UNKNOWN 1023u
#define COLDEST_DEGC (-100.0f)
#define STEP_K 0.5f

/* A temperature in ten bits; NaN if it is not `known`. */
static uint32_t packed(bool known, float degC)
{
    float steps = (degC - COLDEST_DEGC) / STEP_K + 0.5f;
    float most = (float)UNKNOWN;
    uint32_t word = UNKNOWN - 1u;
    if (!known) {
        return UNKNOWN;
    }
    if (steps < most) {
        word = (steps > 0.0f) ? (uint32_t)steps : 0u;
    }
    return word;
}

static float unpacked(uint32_t all, uint16_t which)
{
    uint16_t below = (uint16_t)(TEN_BITS * which);
    uint32_t steps = (all >> below) & UNKNOWN;
    return (steps == UNKNOWN) ? NAN : (COLDEST_DEGC + STEP_K * (float)steps);
}

/* Does a model or a thermistor tell the winding's temperature? */
static bool tells_winding(const ht_drive *d)
{
    return (d->config->heat.steps > 0.0f)
           || ht_ntc_tells(&d->config->ntc[HT_SLOW_WINDING], &d->ntc[HT_SLOW_WINDING]);
}

static uint32_t temperatures(const ht_drive *d)
{
    const ht_drive_config *c = d->config;
    bool sink = (d->sensors[HT_SLOW_SINK] == (uint16_t)HT_NTC_WHOLE)
                && ht_ntc_tells(&c->ntc[HT_SLOW_SINK], &d->ntc[HT_SLOW_SINK]);
    return packed(tells_winding(d), ht_heat_winding_degC(&c->heat, &d->heat))
           | (packed(c->device_heat.K_W > 0.0f, ht_drive_device_degC(d)) << TEN_BITS)
           | (packed(sink, ht_drive_sink_degC(d)) << (2u * TEN_BITS));
}

/* An event as the memory has it becomes one as a reply has it. */
static void unpack(uint16_t *words)
{
    uint32_t all = word32(&words[AT_WINDING]);
    if ((words[1] & PACKED) == 0u) { /* of an earlier firmware */
        all = ((uint32_t)UNKNOWN << TEN_BITS) | ((uint32_t)UNKNOWN << (2u * TEN_BITS));
    } else {
        words[1] = (uint16_t)(words[1] & ~(unsigned)PACKED);
        put_float(&words[AT_WINDING], unpacked(all, 0u));
    }
    put_float(&words[AT_DEVICE], unpacked(all, 1u));
    put_float(&words[AT_SINK], unpacked(all, 2u));
}

static bool take_token(ht_drive_log *l)
{
    if (l->tokens == 0u) {
        return false;
    }
    l->tokens--;
    return true;
}

static void drop_oldest(ht_drive_log *l)
{
    uint16_t k;
    uint16_t w;
    for (k = 1u; k < l->waiting; k++) {
        for (w = 0u; w < HT_LOG_PAYLOAD; w++) {
            l->queue[k - 1u][w] = l->queue[k][w];
        }
    }
    l->waiting--;
}

/* Room for an event, or NULL. */
static uint16_t *room(ht_drive_log *l, uint16_t event)
{
    uint16_t most =
        (uint16_t)(HT_LOG_QUEUE - ((event == (uint16_t)HT_EVENT_TRIP) ? 0u : FOR_TRIPS));
    if (!ht_log_keeps(l)) {
        if (l->waiting == HT_LOG_QUEUE) {
            drop_oldest(l);
        }
    } else if ((l->waiting >= most) || !take_token(l)) {
        l->counters.missed = one_more(l->counters.missed);
        return NULL;
    } else {
        /* there is room */
    }
    l->waiting++;
    return l->queue[l->waiting - 1u];
}

/* The trip's values. While it is copied another one may come: then once more. */
static ht_snapshot snapshot_of(const ht_drive *d)
{
    const volatile ht_snapshot *now = &d->snapshot;
    ht_snapshot s;
    do {
        s = *now;
    } while (now->tick != s.tick);
    return s;
}

/* The drive as it is, in the form of a trip's snapshot. */
static ht_snapshot present(const ht_drive *d)
{
    ht_snapshot s = d->snapshot;
    s.state = d->state;
    s.faults = d->faults;
    s.warnings = ht_drive_warnings(d);
    s.in = d->in;
    s.speed_rpm = d->speed_rpm;
    return s;
}

static void add_event(ht_drive_log *l, const ht_drive *d, uint16_t event, const ht_snapshot *s)
{
    uint16_t *words = room(l, event);
    uint16_t leg;
    if (words == NULL) {
        return;
    }
    words[0] = both(event, s->state);
    words[1] = (uint16_t)(both((uint16_t)d->config->control.scheme, l->reset.cause) | PACKED);
    put_word32(&words[2], l->sequence);
    put_word32(&words[4], l->counters.powered_s);
    put_word32(&words[6], l->counters.gates_s);
    put_word32(&words[8], s->faults);
    words[10] = s->warnings;
    words[11] = d->limits;
    put_float(&words[12], s->in.vdc_V);
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        put_float(&words[14u + (2u * leg)], s->in.i_A.p[leg]);
    }
    put_float(&words[26], s->speed_rpm);
    put_word32(&words[AT_WINDING], temperatures(d));
    l->sequence++;
}

/* --- counters -------------------------------------------------------------------------------- */

static float larger(float value, float peak)
{
    return (value > peak) ? value : peak; /* NaN is no peak */
}

static void follow_peaks(ht_drive_log *l, const ht_control_input *in, bool powered, float speed_rpm)
{
    ht_log_counters *c = &l->counters;
    int leg;
    c->vdc_V = larger(in->vdc_V, c->vdc_V);
    c->speed_rpm = larger(fabsf(speed_rpm), c->speed_rpm);
    for (leg = 0; powered && (leg < HT_LEGS); leg++) {
        c->current_A = larger(fabsf(in->i_A.p[leg]), c->current_A);
    }
}

static void follow_time(ht_drive_log *l, const ht_drive *d, bool powered)
{
    uint32_t tick = d->tick;
    uint32_t passed = tick - l->tick;
    uint32_t second = (uint32_t)d->params.v[HT_P_f_isr_Hz];
    l->tick = tick;
    l->ticks += passed;
    l->gates_ticks += powered ? passed : 0u;
    while (l->ticks >= second) {
        l->ticks -= second;
        l->counters.powered_s++;
    }
    while (l->gates_ticks >= second) {
        l->gates_ticks -= second;
        l->counters.gates_s++;
    }
    if ((l->counters.powered_s - l->token_s) >= TOKEN_S) {
        l->token_s += TOKEN_S;
        l->tokens = (l->tokens < HT_LOG_TOKENS) ? (uint16_t)(l->tokens + 1u)
                                                : (uint16_t)HT_LOG_TOKENS;
    }
}

/* A trip by these faults. */
static void count_trip(ht_drive_log *l, uint32_t faults)
{
    uint16_t row;
    for (row = 0u; row < HT_LOG_TRIPS; row++) {
        if (((faults >> row) & 1u) != 0u) {
            l->trips[row] = one_more(l->trips[row]);
        }
    }
    l->trips_kept = false;
}

static void note_trip(ht_drive_log *l, const ht_drive *d)
{
    ht_snapshot s = snapshot_of(d);
    bool was_at_work = (ht_state_flags(s.state) & (unsigned)HT_AT_WORK) != 0u;
    if (was_at_work && !l->at_work) { /* it tripped before this could look */
        l->counters.starts++;
    }
    count_trip(l, s.faults);
    l->fault_tick = s.tick;
    follow_peaks(l, &s.in, true, s.speed_rpm);
    add_event(l, d, (uint16_t)HT_EVENT_TRIP, &s);
}

static void note_warnings(ht_drive_log *l, const ht_drive *d)
{
    uint16_t warnings = ht_drive_warnings(d);
    if ((warnings & ~(unsigned)l->warned) != 0u) {
        ht_snapshot s = present(d);
        l->warned = (uint16_t)(l->warned | warnings);
        add_event(l, d, (uint16_t)HT_EVENT_WARNING, &s);
    }
}

static void follow(ht_drive_log *l, const ht_drive *d)
{
    uint16_t flags = ht_state_flags(d->state);
    bool at_work = (flags & (unsigned)HT_AT_WORK) != 0u;
    bool powered = (flags & (unsigned)HT_GATES_ON) != 0u;
    bool faulty = d->faults != 0u;
    follow_time(l, d, powered);
    if (at_work && !l->at_work) {
        l->counters.starts++;
        l->warned = 0u;
    }
    if (faulty && (!l->faulty || (d->snapshot.tick != l->fault_tick))) {
        note_trip(l, d);
    } else if (powered) {
        note_warnings(l, d);
    } else {
        /* nothing to tell */
    }
    if (d->tick != 0u) {
        follow_peaks(l, &d->in, powered, d->speed_rpm);
        if (tells_winding(d)) {
            l->counters.winding_degC =
                larger(ht_heat_winding_degC(&d->config->heat, &d->heat), l->counters.winding_degC);
        }
    }
    l->at_work = at_work;
    l->faulty = faulty;
}

/* --- the memory ------------------------------------------------------------------------------- */

static uint32_t later(uint32_t count, uint32_t other)
{
    return (count > other) ? count : other;
}

/* Records that the memory has. Those of an area that has changed come in another order than they were
 * made: of what never goes down the largest counts. */
static void take_counters(ht_log_counters *c, const uint16_t *words)
{
    c->missed = (words[1] > c->missed) ? words[1] : c->missed;
    c->powered_s = later(word32(&words[2]), c->powered_s);
    c->gates_s = later(word32(&words[4]), c->gates_s);
    c->starts = later(word32(&words[6]), c->starts);
    c->vdc_V = larger(ht_float_of(word32(&words[8])), c->vdc_V);
    c->current_A = larger(ht_float_of(word32(&words[10])), c->current_A);
    c->speed_rpm = larger(ht_float_of(word32(&words[12])), c->speed_rpm);
    c->winding_degC = larger(ht_float_of(word32(&words[14])), c->winding_degC);
}

/* A trip may be later than the counters, and is counted on top of those before it. */
static void take_event(ht_drive_log *l, const uint16_t *words)
{
    ht_log_counters *c = &l->counters;
    uint16_t event = (uint16_t)(words[0] & KIND);
    l->sequence = later(word32(&words[2]) + 1u, l->sequence);
    c->powered_s = later(word32(&words[4]), c->powered_s);
    c->gates_s = later(word32(&words[6]), c->gates_s);
    if (event == (uint16_t)HT_EVENT_TRIP) {
        uint16_t leg;
        count_trip(l, word32(&words[8]));
        c->vdc_V = larger(ht_float_of(word32(&words[12])), c->vdc_V);
        for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
            c->current_A =
                larger(fabsf(ht_float_of(word32(&words[14u + (2u * leg)]))), c->current_A);
        }
        c->speed_rpm = larger(fabsf(ht_float_of(word32(&words[26]))), c->speed_rpm);
    } else if (event == (uint16_t)HT_EVENT_FORGOTTEN) {
        ht_log_ring_empty(&l->ring, 1u);
    } else {
        /* counts nothing */
    }
}

static void take_found(ht_drive_log *l, const uint16_t *words)
{
    if (words[0] == KIND_COUNTERS) {
        take_counters(&l->counters, words);
    } else if (words[0] == KIND_TRIPS) {
        uint16_t row;
        for (row = 0u; row < HT_LOG_TRIPS; row++) {
            l->trips[row] = words[1u + row];
        }
        l->trips_kept = true;
    } else if ((words[0] & KIND) < HT_LOG_VALUE_FIRST) {
        take_event(l, words);
    } else {
        /* of a later firmware */
    }
}

static void blank(uint16_t *words)
{
    uint16_t k;
    for (k = 0u; k < HT_LOG_PAYLOAD; k++) {
        words[k] = 0u;
    }
}

static void put_counters(ht_drive_log *l)
{
    const ht_log_counters *c = &l->counters;
    uint16_t words[HT_LOG_PAYLOAD];
    blank(words);
    words[0] = KIND_COUNTERS;
    words[1] = c->missed;
    put_word32(&words[2], c->powered_s);
    put_word32(&words[4], c->gates_s);
    put_word32(&words[6], c->starts);
    put_float(&words[8], c->vdc_V);
    put_float(&words[10], c->current_A);
    put_float(&words[12], c->speed_rpm);
    put_float(&words[14], c->winding_degC);
    l->kept_powered_s = c->powered_s;
    l->kept_gates_s = c->gates_s;
    l->kept_starts = c->starts;
    ht_log_ring_put(&l->ring, words);
}

static void put_trips(ht_drive_log *l)
{
    uint16_t words[HT_LOG_PAYLOAD];
    uint16_t row;
    blank(words);
    words[0] = KIND_TRIPS;
    for (row = 0u; row < HT_LOG_TRIPS; row++) {
        words[1u + row] = l->trips[row];
    }
    l->trips_kept = true;
    l->trips_due = false;
    ht_log_ring_put(&l->ring, words);
}

/* The record that the ring has written, or not. */
static void finish(ht_drive_log *l)
{
    if (l->put == (uint16_t)PUT_EVENT) {
        if (l->ring.kept) {
            drop_oldest(l);
            l->trips_due = !l->trips_kept;
        }
    } else if (l->ring.kept) {
        /* as it was put */
    } else if (l->put == (uint16_t)PUT_TRIPS) {
        l->trips_kept = false;
        l->trips_due = true;
    } else if (l->put == (uint16_t)PUT_COUNTERS) {
        l->kept_powered_s -= HOUR_S; /* due at once */
    } else {
        /* nothing was put */
    }
    l->put = (uint16_t)PUT_NOTHING;
}

/* The next record, if there is one. The gates are off. */
static void put_next(ht_drive_log *l)
{
    const ht_log_counters *c = &l->counters;
    bool ran = (c->starts != l->kept_starts) || (c->gates_s != l->kept_gates_s);
    if (l->waiting != 0u) {
        l->put = (uint16_t)PUT_EVENT;
        ht_log_ring_put(&l->ring, l->queue[0]);
    } else if (!l->trips_kept && (l->trips_due || take_token(l))) {
        l->put = (uint16_t)PUT_TRIPS;
        put_trips(l);
    } else if (((c->powered_s - l->kept_powered_s) >= HOUR_S) || (ran && take_token(l))) {
        l->put = (uint16_t)PUT_COUNTERS;
        put_counters(l);
    } else {
        /* all is written */
    }
}

static bool may_write(const ht_drive *d)
{
    return ((d->state == (uint16_t)HT_STATE_IDLE) || (d->state == (uint16_t)HT_STATE_FAULT))
           && ((d->faults & (uint32_t)HT_FAULT_CLOCK) == 0u); /* the flash is timed by it */
}

/* The memory is read: what happens from now on comes on top. */
static void begin(ht_drive_log *l, const ht_drive *d)
{
    uint16_t dogs = l->reset.watchdogs;
    l->started = true;
    l->kept_powered_s = l->counters.powered_s;
    l->kept_gates_s = l->counters.gates_s;
    l->kept_starts = l->counters.starts;
    l->token_s = l->counters.powered_s;
    if ((dogs <= WATCHDOGS_NOTED) || ((dogs & (dogs - 1u)) == 0u)) {
        ht_snapshot s = present(d);
        add_event(l, d, (uint16_t)HT_EVENT_START, &s);
    }
}

void ht_log_turn(ht_drive_log *l, const ht_drive *d, bool alone)
{
    ht_log_turned turned = ht_log_ring_turn(&l->ring, may_write(d), alone);
    if (turned == HT_LOG_FOUND) {
        take_found(l, l->ring.slot);
        return;
    }
    if (!l->started) {
        if (!ht_log_ring_settled(&l->ring)) {
            return;
        }
        begin(l, d);
    }
    follow(l, d);
    if (turned == HT_LOG_FREE) {
        finish(l);
        if (may_write(d)) {
            put_next(l);
        }
    }
}

bool ht_log_keeps(const ht_drive_log *l)
{
    return ht_log_ring_works(&l->ring);
}

uint16_t ht_log_events(const ht_drive_log *l)
{
    return (uint16_t)(l->waiting + l->ring.events);
}

ht_result ht_log_row(const ht_drive_log *l, const ht_drive *d, uint16_t row, uint16_t *words)
{
    if (row < l->waiting) {
        uint16_t w;
        for (w = 0u; w < HT_LOG_PAYLOAD; w++) {
            words[w] = l->queue[l->waiting - 1u - row][w];
        }
    } else if (row >= ht_log_events(l)) {
        return HT_ERROR_ID;
    } else if ((ht_state_flags(d->state) & (unsigned)HT_AT_WORK) != 0u) {
        return HT_ERROR_STATE;
    } else if (!ht_log_ring_read(&l->ring, (uint16_t)(ht_log_events(l) - 1u - row), words)) {
        return HT_ERROR_ID;
    } else {
        /* it is read */
    }
    unpack(words);
    return HT_OK;
}

ht_result ht_log_forget(ht_drive_log *l, const ht_drive *d)
{
    ht_snapshot s;
    if (!may_write(d) || !l->started || !ht_log_ring_settled(&l->ring)
        || (l->put != (uint16_t)PUT_NOTHING)) {
        return HT_ERROR_STATE;
    }
    ht_log_ring_empty(&l->ring, 0u);
    l->waiting = 0u;
    s = present(d);
    add_event(l, d, (uint16_t)HT_EVENT_FORGOTTEN, &s);
    return HT_OK;
}

void ht_log_none(ht_drive_log *l)
{
    ht_log_ring_none(&l->ring);
}

void ht_log_start(ht_drive_log *l, const ht_reset *reset)
{
    ht_log_counters nothing = {0u, 0u, 0u, 0u, 0.0f, 0.0f, 0.0f, 0.0f};
    uint16_t row;
    ht_log_ring_start(&l->ring);
    l->waiting = 0u;
    l->put = (uint16_t)PUT_NOTHING;
    l->sequence = 1u;
    l->counters = nothing;
    for (row = 0u; row < HT_LOG_TRIPS; row++) {
        l->trips[row] = 0u;
    }
    l->trips_kept = true;
    l->trips_due = false;
    l->tick = 0u;
    l->ticks = 0u;
    l->gates_ticks = 0u;
    l->tokens = HT_LOG_TOKENS;
    l->warned = 0u;
    l->at_work = false;
    l->faulty = false;
    l->fault_tick = 0u;
    l->started = false;
    l->reset.cause = (reset != NULL) ? reset->cause : (uint16_t)HT_RESET_NO_FLAG;
    l->reset.watchdogs = (reset != NULL) ? reset->watchdogs : 0u;
}
