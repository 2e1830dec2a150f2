#define _POSIX_C_SOURCE 200809L

#include "ht_pil_host.h"
#include "ht_pil_snapshot.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define QEPSTS 0x1Cu /* of the eQEP */

/* --- images --------------------------------------------------------------------- */

static void log_period(ht_log *log, const ht_mirror *m, const ht_regfile *registers)
{
    uint16_t *row;
    if ((log->image == NULL) || (log->rows >= log->capacity)) {
        return;
    }
    row = log->image + (size_t)log->rows * log->width;
    log->rows++;
    ht_mirror_read(m, row);
    row += m->count;
    row[0] = (uint16_t)(registers->accesses & 0xFFFFu);
    row[1] = (uint16_t)(registers->accesses >> 16);
    row[2] = (uint16_t)(registers->violations & 0xFFFFu);
    row[3] = (uint16_t)(registers->violations >> 16);
}

static void begin_log(ht_log *log, const ht_mirror *m)
{
    log->image = NULL;
    log->capacity = 0u;
    log->rows = 0u;
    log->width = m->count + (uint32_t)HT_IMAGE_EXTRA;
}

void ht_watch_init(ht_watch *w, ht_drive *d, ht_regfile *registers)
{
    w->drive = d;
    w->registers = registers;
    ht_mirror_init(&w->mirror, registers, registers->map);
    begin_log(&w->log, &w->mirror);
}

void ht_watch_fast(ht_watch *w)
{
    ht_drive_fast_isr(w->drive);
}

void ht_watch_slow(ht_watch *w)
{
    ht_drive_slow_isr(w->drive);
}

void ht_watch_channels(ht_watch *w, float *out)
{
    ht_channels_read(w->drive, out);
    log_period(&w->log, &w->mirror, w->registers);
}

/* --- the link ------------------------------------------------------------------- */

static void down(ht_link *l, ht_link_error why)
{
    if (l->error == (uint16_t)HT_LINK_UP) {
        l->error = (uint16_t)why;
    }
}

static int64_t now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

/* Wait until the descriptor is ready. False, with the link down, after the time-out. */
static bool wait_for(ht_link *l, int fd, short what, int64_t until_ms)
{
    for (;;) {
        struct pollfd p;
        int64_t left = until_ms - now_ms();
        int n;
        p.fd = fd;
        p.events = what;
        p.revents = 0;
        n = (left > 0) ? poll(&p, 1, (int)left) : 0;
        if (n > 0) {
            return true; /* ready, or closed: the access will tell */
        }
        if ((n == 0) || (errno != EINTR)) {
            down(l, HT_LINK_SILENT);
            return false;
        }
    }
}

static void send(ht_link *l, uint16_t octets, int64_t until_ms)
{
    uint16_t done = 0u;
    uint16_t i;
    for (i = 0u; i < octets; i++) {
        l->octets[i] = ht_frame_octet(&l->request, i);
    }
    if ((l->flip_request != 0u) && (l->flip_request <= octets)) {
        l->octets[l->flip_request - 1u] ^= 1u;
        l->flip_request = 0u;
    }
    while ((done < octets) && (l->error == (uint16_t)HT_LINK_UP)) {
        ssize_t n = write(l->to_target, &l->octets[done], (size_t)(octets - done));
        if (n > 0) {
            done = (uint16_t)(done + n);
        } else if (errno == EAGAIN) {
            (void)wait_for(l, l->to_target, POLLOUT, until_ms);
        } else if (errno != EINTR) {
            down(l, HT_LINK_CLOSED);
        } else {
            /* again */
        }
    }
}

static void receive(ht_link *l, int64_t until_ms)
{
    ht_frame_reset(&l->reply);
    while ((l->error == (uint16_t)HT_LINK_UP) && wait_for(l, l->from_target, POLLIN, until_ms)) {
        ssize_t n = read(l->from_target, l->octets, sizeof l->octets);
        if (n > 0) {
            uint16_t used;
            ht_frame_status status = ht_frame_take(&l->reply, l->octets, (uint16_t)n, &used);
            l->heard += (uint32_t)n;
            if (status == HT_FRAME_BROKEN) {
                down(l, HT_LINK_BROKEN);
            } else if ((status == HT_FRAME_WHOLE) && (used != (uint16_t)n)) {
                down(l, HT_LINK_ANSWER);
            } else if (status == HT_FRAME_WHOLE) {
                return;
            } else {
                /* the rest is on its way */
            }
        } else if ((n == 0) || ((errno != EINTR) && (errno != EAGAIN))) {
            down(l, HT_LINK_CLOSED);
        } else {
            /* again */
        }
    }
}

/* The same through the same codec, without the wire. */
static void through_local(ht_link *l, uint16_t octets)
{
    uint16_t used;
    uint16_t i;
    for (i = 0u; i < octets; i++) {
        l->octets[i] = ht_frame_octet(&l->request, i);
    }
    if ((l->flip_request != 0u) && (l->flip_request <= octets)) {
        l->octets[l->flip_request - 1u] ^= 1u;
        l->flip_request = 0u;
    }
    if (ht_frame_take(&l->incoming, l->octets, octets, &used) == HT_FRAME_WHOLE) {
        octets = ht_pil_answer(l->local, &l->incoming, &l->request);
    } else {
        octets = ht_pil_complain(&l->request);
    }
    for (i = 0u; i < octets; i++) {
        l->octets[i] = ht_frame_octet(&l->request, i);
    }
    ht_frame_reset(&l->reply);
    if (ht_frame_take(&l->reply, l->octets, octets, &used) != HT_FRAME_WHOLE) {
        down(l, HT_LINK_BROKEN);
    }
}

/* Send the open request, wait for its reply. True if there is one to look at. */
static bool exchange(ht_link *l, uint16_t type)
{
    uint16_t octets = ht_frame_end(&l->request);
    l->heard = 0u;
    if (l->error != (uint16_t)HT_LINK_UP) {
        return false;
    }
    if (l->local != NULL) {
        through_local(l, octets);
    } else {
        int64_t until_ms = now_ms() + l->timeout_ms;
        send(l, octets, until_ms);
        receive(l, until_ms);
    }
    if (l->error != (uint16_t)HT_LINK_UP) {
        return false;
    }
    if (ht_frame_type(&l->reply) == (uint16_t)HT_PIL_BROKEN) {
        down(l, HT_LINK_BROKEN);
        return false;
    }
    if ((ht_frame_type(&l->reply) != (uint16_t)(type | (uint16_t)HT_PIL_REPLY))
        || (ht_frame_number(&l->reply) != l->number) || (ht_frame_length(&l->reply) == 0u)) {
        down(l, HT_LINK_ANSWER);
        return false;
    }
    return true;
}

static void begin(ht_link *l, uint16_t type)
{
    l->number = (uint16_t)((l->number + 1u) & 0xFFu);
    ht_frame_begin(&l->request, type, l->number);
}

/* What the driver will find when a target that tells calls has made them, without a
 * trace: the calls themselves follow the reply. */
static void look(ht_link *l)
{
    uint32_t accesses = l->registers.accesses;
    uint16_t *status = ht_regfile_word(&l->registers, l->port.map->eqep + QEPSTS);
    uint16_t flags = *status;
    ht_samples samples;
    ht_capture capture;
    uint16_t leg;
    int channel;
    ht_port_read(&l->port, &samples);
    ht_port_read_capture(&l->port, &capture);
    for (channel = 0; channel < HT_ADC_CHANNELS; channel++) {
        l->input[HT_INPUT_ADC + channel] = samples.adc[channel];
    }
    l->input[HT_INPUT_POSITION] = (uint16_t)(samples.position & 0xFFFFu);
    l->input[HT_INPUT_POSITION + 1] = (uint16_t)(samples.position >> 16);
    l->input[HT_INPUT_TRIPPED] = 0u;
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        if (ht_port_leg_tripped(&l->port, leg)) {
            l->input[HT_INPUT_TRIPPED] = (uint16_t)(l->input[HT_INPUT_TRIPPED] | (1u << leg));
        }
    }
    l->input[HT_INPUT_TRIP_PIN_LOW] = ht_port_trip_pin_low(&l->port) ? 1u : 0u;
    l->input[HT_INPUT_OVERRUN] = 0u; /* nothing comes in between here */
    l->input[HT_INPUT_PERIOD_TICKS] = capture.period_ticks;
    l->input[HT_INPUT_AGE_TICKS] = capture.age_ticks;
    l->input[HT_INPUT_FLAGS] = (uint16_t)((capture.event ? (unsigned)HT_FLAG_EVENT : 0u)
                                          | (capture.overflow ? (unsigned)HT_FLAG_OVERFLOW : 0u)
                                          | (capture.reversed ? (unsigned)HT_FLAG_REVERSED : 0u)
                                          | (capture.forward ? (unsigned)HT_FLAG_FORWARD : 0u));
    *status = flags;
    l->registers.accesses = accesses;
}

static void add_inputs(ht_link *l)
{
    int i;
    look(l);
    for (i = 0; i < HT_INPUTS; i++) {
        ht_frame_add(&l->request, l->input[i]);
    }
}

/* One call on the driver; `word` are its code and arguments. Returns how many words
 * those are, 0 if there is no such call or it goes another way than on the target. */
static uint16_t make_call(ht_link *l, const uint16_t *word, uint16_t words)
{
    ht_pwm_setup setup;
    ht_compare pattern;
    ht_samples samples;
    ht_capture capture;
    int leg;
    switch (word[0]) {
    case HT_CALL_INIT:
        if (words < 6u) {
            return 0u;
        }
        setup.period_counts = word[1];
        setup.dead_counts = word[2];
        setup.shadow = word[3] != 0u;
        setup.slow_Hz = ht_frame_float(&word[4]);
        (void)ht_port_init(&l->port, &setup);
        return 6u;
    case HT_CALL_WRITE:
        if (words < 14u) {
            return 0u;
        }
        pattern.start = word[1];
        for (leg = 0; leg < HT_LEGS; leg++) {
            pattern.ca[leg] = word[2 + leg];
            pattern.cb[leg] = word[2 + HT_LEGS + leg];
        }
        ht_port_write(&l->port, &pattern);
        return 14u;
    case HT_CALL_GATES_OFF:
        ht_port_gates_off(&l->port);
        return 1u;
    case HT_CALL_GATES_ON:
        return ((words >= 2u) && (ht_port_gates_on(&l->port) == (word[1] != 0u))) ? 2u : 0u;
    case HT_CALL_TRIP_PIN_LOW:
        return ((words >= 2u) && (ht_port_trip_pin_low(&l->port) == (word[1] != 0u))) ? 2u : 0u;
    case HT_CALL_TRIPPED:
        return ((words >= 2u) && (ht_port_tripped(&l->port) == (word[1] != 0u))) ? 2u : 0u;
    case HT_CALL_LEG_TRIPPED:
        return ((words >= 3u) && (word[1] < (uint16_t)HT_LEGS)
                && (ht_port_leg_tripped(&l->port, word[1]) == (word[2] != 0u)))
                   ? 3u
                   : 0u;
    case HT_CALL_BEGIN_FAST:
        ht_port_begin_fast(&l->port);
        return 1u;
    case HT_CALL_READ:
        ht_port_read(&l->port, &samples);
        return 1u;
    case HT_CALL_READ_CAPTURE:
        ht_port_read_capture(&l->port, &capture);
        return 1u;
    case HT_CALL_OVERRUN:
        return ((words >= 2u) && (ht_port_overrun(&l->port) == (word[1] != 0u))) ? 2u : 0u;
    case HT_CALL_ACK_FAST:
        ht_port_ack_fast(&l->port);
        return 1u;
    default:
        return 0u;
    }
}

/* Do what the target's driver did. */
static void follow(ht_link *l, const uint16_t *reply, uint16_t rest, uint16_t words)
{
    if (l->calls != 0u) {
        while (rest < words) {
            uint16_t used = make_call(l, &reply[rest], (uint16_t)(words - rest));
            if (used == 0u) {
                down(l, HT_LINK_PARTED);
                return;
            }
            rest = (uint16_t)(rest + used);
        }
        return;
    }
    if (!ht_mirror_apply(&l->mirror, &reply[rest], (uint16_t)(words - rest))) {
        down(l, HT_LINK_ANSWER);
        return;
    }
    if (ht_mirror_digest(&l->mirror, l->number) != ht_frame_32(&reply[HT_PIL_AT_DIGEST])) {
        down(l, HT_LINK_PARTED);
        return;
    }
    l->registers.accesses = ht_frame_32(&reply[HT_PIL_AT_ACCESSES]);
    l->registers.violations = ht_frame_32(&reply[HT_PIL_AT_VIOLATIONS]);
}

/* Take the reply over. */
static void digest(ht_link *l)
{
    const uint16_t *word = ht_frame_payload(&l->reply);
    uint16_t words = ht_frame_length(&l->reply);
    uint16_t channels;
    uint16_t rest;
    uint16_t i;
    l->result = word[HT_PIL_AT_RESULT];
    if (l->result == (uint16_t)HT_PIL_REFUSED) {
        down(l, HT_LINK_REFUSED);
        return;
    }
    if (words == 1u) {
        return; /* an INIT whose parameters do not fit */
    }
    channels = (words >= (uint16_t)HT_PIL_AT_REST) ? word[HT_PIL_AT_CHANNELS] : 0xFFFFu;
    rest = (uint16_t)(HT_PIL_AT_REST + 2u * channels);
    if ((channels > (uint16_t)HT_PIL_CHANNELS) || (rest > words)) {
        down(l, HT_LINK_ANSWER);
        return;
    }
    l->state = word[HT_PIL_AT_STATE];
    l->faults = word[HT_PIL_AT_FAULTS];
    l->value = ht_frame_float(&word[HT_PIL_AT_VALUE]);
    for (i = 0u; i < channels; i++) {
        l->channels[i] = ht_frame_float(&word[HT_PIL_AT_REST + 2u * i]);
    }
    follow(l, word, rest, words);
}

uint32_t ht_link_baud(void)
{
    return HT_PIL_BAUD;
}

void ht_link_reset(ht_link *l)
{
    l->error = (uint16_t)HT_LINK_UP;
    l->number = 0u;
    l->flip_request = 0u;
    ht_frame_reset(&l->incoming);
    ht_frame_reset(&l->reply);
    if (l->local != NULL) {
        ht_pil_reset(l->local);
    }
}

void ht_link_hello(ht_link *l, uint16_t *identity)
{
    uint16_t i;
    begin(l, HT_PIL_HELLO);
    if (exchange(l, HT_PIL_HELLO) && (ht_frame_length(&l->reply) != (uint16_t)HT_PIL_IDENTITY)) {
        down(l, HT_LINK_ANSWER);
    }
    for (i = 0u; i < (uint16_t)HT_PIL_IDENTITY; i++) {
        identity[i] = (l->error == (uint16_t)HT_LINK_UP) ? ht_frame_payload(&l->reply)[i]
                                                         : (uint16_t)0u;
    }
    l->calls = (identity[3] == 0u) ? 1u : 0u;
}

void ht_link_init(ht_link *l, uint16_t device, const ht_params *p)
{
    const ht_board *board = (device == 0u) ? &ht_board_f28335 : &ht_board_f28377s;
    const ht_c2000_map *map = board->map;
    uint16_t id;
    ht_regfile_reset(&l->registers, map);
    ht_mirror_init(&l->mirror, &l->registers, map);
    begin_log(&l->log, &l->mirror);
    ht_port_bind(&l->port, &l->registers, board);
    if ((l->calls != 0u) && !ht_board_start(&l->port)) {
        down(l, HT_LINK_PARTED); /* never: the model's clock starts */
    }
    begin(l, HT_PIL_INIT);
    ht_frame_add(&l->request, device);
    for (id = 0u; id < HT_PARAMS; id++) {
        ht_frame_add_float(&l->request, p->v[id]);
    }
    if (l->calls != 0u) {
        ht_frame_add_float(&l->request, ht_port_pwm_clock_Hz(&l->port));
        ht_frame_add_float(&l->request, ht_port_capture_clock_Hz(&l->port));
        ht_frame_add_float(&l->request, board->dead_min_us);
        ht_frame_add(&l->request, map->dead_max_counts);
        add_inputs(l);
    }
    if (exchange(l, HT_PIL_INIT)) {
        digest(l);
    }
}

void ht_link_request(ht_link *l, uint16_t type, uint16_t argument, float value)
{
    uint16_t pairs[2 * HT_MIRROR_MAX];
    uint16_t n;
    uint16_t i;
    begin(l, type);
    ht_frame_add(&l->request, argument);
    ht_frame_add_float(&l->request, value);
    if (l->calls != 0u) {
        add_inputs(l);
    } else {
        n = ht_mirror_changes(&l->mirror, pairs);
        for (i = 0u; i < n; i++) {
            ht_frame_add(&l->request, pairs[i]);
        }
    }
    if (exchange(l, type)) {
        digest(l);
    }
}

void ht_link_snapshot(ht_link *l, ht_snapshot *s)
{
    begin(l, HT_PIL_SNAPSHOT);
    if (exchange(l, HT_PIL_SNAPSHOT)) {
        const uint16_t *word = ht_frame_payload(&l->reply);
        if (word[HT_PIL_AT_RESULT] != (uint16_t)HT_OK) {
            down(l, HT_LINK_REFUSED);
        } else if (ht_frame_length(&l->reply) != 1u + (uint16_t)HT_PIL_SNAPSHOT_WORDS) {
            down(l, HT_LINK_ANSWER);
        } else {
            ht_pil_snapshot_take(&word[1], s);
        }
    }
}

void ht_link_fast(ht_link *l)
{
    ht_link_request(l, HT_PIL_STEP, HT_PIL_FAST, 0.0f);
}

void ht_link_slow(ht_link *l)
{
    ht_link_request(l, HT_PIL_STEP, HT_PIL_SLOW, 0.0f);
}

void ht_link_slow_unseen(ht_link *l)
{
    float channels[HT_PIL_CHANNELS];
    (void)memcpy(channels, l->channels, sizeof channels);
    ht_link_slow(l);
    (void)memcpy(l->channels, channels, sizeof channels);
}

void ht_link_channels(ht_link *l, float *out)
{
    (void)memcpy(out, l->channels, (size_t)ht_channel_count() * sizeof out[0]);
    log_period(&l->log, &l->mirror, &l->registers);
}
