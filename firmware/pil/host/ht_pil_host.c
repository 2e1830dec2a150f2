#include "ht_pil_host.h"
#include "ht_board_of_device.h"
#include "ht_octets.h"
#include "ht_pil_pipe.h"
#include "ht_snapshot.h"

#include <string.h>

#define QFLG 0x19u /* of the eQEP */
#define QEPSTS 0x1Cu

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

/* Wait until the descriptor is ready. False, with the link down, after the time-out. */
static bool wait_for(ht_link *l, int fd, bool to_write, int64_t until_ms)
{
    if (ht_pipe_wait(fd, to_write, until_ms)) {
        return true;
    }
    down(l, HT_LINK_SILENT);
    return false;
}

/* The open request as bytes of a frame. Returns their number. */
static uint16_t close_request(ht_link *l)
{
    uint16_t i;
    ht_outgoing_set(&l->out, &l->request);
    for (i = 0u; i < l->out.n; i++) {
        l->bytes[i] = (unsigned char)l->out.octet[i];
    }
    if ((l->flip_request != 0u) && (l->flip_request <= l->out.n)) {
        l->bytes[l->flip_request - 1u] ^= 1u;
        l->flip_request = 0u;
    }
    return l->out.n;
}

static void send(ht_link *l, uint16_t n, int64_t until_ms)
{
    uint16_t done = 0u;
    while ((done < n) && (l->error == (uint16_t)HT_LINK_UP)) {
        int sent = ht_pipe_write(l->to_target, &l->bytes[done], (uint16_t)(n - done));
        if (sent > 0) {
            done = (uint16_t)(done + sent);
        } else if (sent == HT_PIPE_LATER) {
            (void)wait_for(l, l->to_target, true, until_ms);
        } else {
            down(l, HT_LINK_CLOSED);
        }
    }
}

/* Bytes from the target. True once a reply is there; nothing may follow it. */
static bool take(ht_link *l, const unsigned char *bytes, uint16_t n)
{
    ht_incoming_status status = HT_INCOMING_PART;
    uint16_t i;
    for (i = 0u; (i < n) && (status == HT_INCOMING_PART); i++) {
        status = ht_incoming_take(&l->reply, bytes[i]);
    }
    if (status == HT_INCOMING_DAMAGED) {
        down(l, HT_LINK_BROKEN);
    } else if (i < n) {
        down(l, HT_LINK_ANSWER);
    } else {
        /* a reply, or its rest is on its way */
    }
    return status == HT_INCOMING_WHOLE;
}

static void receive(ht_link *l, int64_t until_ms)
{
    while ((l->error == (uint16_t)HT_LINK_UP) && wait_for(l, l->from_target, false, until_ms)) {
        int n = ht_pipe_read(l->from_target, l->bytes, (uint16_t)sizeof l->bytes);
        if (n > 0) {
            l->heard += (uint32_t)n;
            if (take(l, l->bytes, (uint16_t)n)) {
                return;
            }
        } else if (n == HT_PIPE_CLOSED) {
            down(l, HT_LINK_CLOSED);
        } else {
            /* again */
        }
    }
}

/* The same frames without the wire. */
static void through_local(ht_link *l, uint16_t n)
{
    const ht_outgoing *out = &l->local->out;
    bool whole = false;
    uint16_t i;
    for (i = 0u; i < n; i++) {
        if (ht_pil_line_take(l->local, l->bytes[i])) {
            break;
        }
    }
    for (i = 0u; i < out->n; i++) {
        unsigned char byte = (unsigned char)out->octet[i];
        whole = take(l, &byte, 1u);
    }
    if (!whole) {
        down(l, HT_LINK_BROKEN);
    }
}

/* Send the open request and wait for its reply. True if there is one to look at: `r` is at its
 * payload then. */
static bool exchange(ht_link *l, uint16_t opcode, ht_reader *r)
{
    uint16_t answered;
    uint16_t number;
    l->heard = 0u;
    if (l->error != (uint16_t)HT_LINK_UP) {
        return false;
    }
    ht_incoming_reset(&l->reply);
    if (l->local != NULL) {
        through_local(l, close_request(l));
    } else {
        int64_t until_ms = ht_pipe_now_ms() + l->timeout_ms;
        send(l, close_request(l), until_ms);
        receive(l, until_ms);
    }
    if (l->error != (uint16_t)HT_LINK_UP) {
        return false;
    }
    ht_reader_begin(r, l->reply.octet, l->reply.n);
    answered = ht_read8(r);
    number = ht_read8(r);
    l->result = ht_read8(r);
    l->state = ht_read8(r);
    l->faults = ht_read32(r);
    if (answered == ((uint16_t)HT_OP_PIL_DAMAGED | (uint16_t)HT_OP_REPLY)) {
        down(l, HT_LINK_BROKEN);
    } else if ((answered != (opcode | (uint16_t)HT_OP_REPLY)) || (number != l->number)
               || r->exceeded) {
        down(l, HT_LINK_ANSWER);
    } else if (l->result >= (uint16_t)HT_PIL_REFUSED) {
        down(l, HT_LINK_REFUSED);
    } else {
        return true;
    }
    return false;
}

static void begin(ht_link *l, uint16_t opcode)
{
    l->number = (uint16_t)((l->number + 1u) & 0xFFu);
    ht_packet_begin(&l->request);
    ht_packet_add8(&l->request, opcode);
    ht_packet_add8(&l->request, l->number);
}

/* What the driver will find in the registers when it makes a call target's calls. Looking
 * leaves no trace: the calls themselves follow with the reply. */
static void look(ht_link *l, ht_pil_inputs *in)
{
    uint32_t accesses = l->registers.accesses;
    uint16_t *status = ht_regfile_word(&l->registers, l->port.map->eqep + QEPSTS);
    uint16_t *latched = ht_regfile_word(&l->registers, l->port.map->eqep + QFLG);
    uint16_t flags = *status;
    uint16_t latches = *latched;
    uint16_t leg;
    ht_port_read(&l->port, &in->samples);
    ht_port_read_capture(&l->port, &in->capture);
    in->tripped = 0u;
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        if (ht_port_leg_tripped(&l->port, leg)) {
            in->tripped = (uint16_t)(in->tripped | (HT_LEG_U1 >> leg));
        }
    }
    in->trip_pin_low = ht_port_trip_pin_low(&l->port);
    in->beyond = ht_port_beyond(&l->port);
    for (leg = 0u; leg < (uint16_t)HT_SLOW_CHANNELS; leg++) {
        uint32_t result = l->port.map->adc_slow_result[leg];
        in->slow[leg] =
            (uint16_t)(*ht_regfile_word(&l->registers, result) >> l->port.map->adc_shift);
    }
    in->absolute = ht_port_read_absolute(&l->port);
    in->overrun = false; /* no conversion ends during an interrupt here */
    in->interrupt_lost = ht_port_interrupt_lost(&l->port);
    *status = flags;
    *latched = latches;
    l->registers.accesses = accesses;
}

/* The hardware's actions: the end of a request. */
static void add_hardware(ht_link *l)
{
    if (l->calls != 0u) {
        ht_pil_inputs in;
        look(l, &in);
        ht_pil_inputs_add(&l->request, &in);
    } else {
        ht_mirror_tell(&l->mirror, &l->request);
    }
}

/* One call on the driver. False if there is no such call, or if the driver gives another
 * answer than the drive got on the target. */
static bool make_call(ht_link *l, ht_reader *r)
{
    ht_pwm_setup setup;
    ht_trip_levels levels;
    ht_compare pattern;
    ht_samples samples;
    ht_capture capture;
    uint16_t leg;
    uint16_t which;
    switch (ht_read16(r)) {
    case HT_CALL_INIT:
        setup.period_counts = ht_read16(r);
        setup.dead_counts = ht_read16(r);
        setup.shadow = ht_read16(r) != 0u;
        setup.slow_Hz = ht_read_float(r);
        (void)ht_port_init(&l->port, &setup);
        return true;
    case HT_CALL_WRITE:
        pattern.start = ht_read16(r);
        for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
            pattern.ca[leg] = ht_read16(r);
        }
        for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
            pattern.cb[leg] = ht_read16(r);
        }
        ht_port_write(&l->port, &pattern);
        return true;
    case HT_CALL_GATES_OFF:
        ht_port_gates_off(&l->port);
        return true;
    case HT_CALL_SHORT_CIRCUIT:
        ht_port_short_circuit(&l->port);
        return true;
    case HT_CALL_OUTPUTS:
        which = ht_read16(r);
        ht_port_outputs(&l->port, which, ht_read16(r));
        return true;
    case HT_CALL_GATES_ON:
        leg = ht_read16(r);
        return ht_port_gates_on(&l->port, leg) == (ht_read16(r) != 0u);
    case HT_CALL_TRIP_PIN_LOW:
        return ht_port_trip_pin_low(&l->port) == (ht_read16(r) != 0u);
    case HT_CALL_TRIPPED:
        leg = ht_read16(r);
        return ht_port_tripped(&l->port, leg) == (ht_read16(r) != 0u);
    case HT_CALL_LEG_OFF:
        leg = ht_read16(r);
        if (leg >= (uint16_t)HT_LEGS) {
            return false;
        }
        ht_port_leg_off(&l->port, leg);
        return true;
    case HT_CALL_LEG_TRIPPED:
        leg = ht_read16(r);
        return (leg < (uint16_t)HT_LEGS)
               && (ht_port_leg_tripped(&l->port, leg) == (ht_read16(r) != 0u));
    case HT_CALL_INTERRUPT_LOST:
        return ht_port_interrupt_lost(&l->port) == (ht_read16(r) != 0u);
    case HT_CALL_TRIP_LEVELS:
        for (leg = 0u; leg < (uint16_t)HT_ADC_CHANNELS; leg++) {
            levels.low[leg] = ht_read16(r);
        }
        for (leg = 0u; leg < (uint16_t)HT_ADC_CHANNELS; leg++) {
            levels.high[leg] = ht_read16(r);
        }
        ht_port_trip_levels(&l->port, &levels);
        return true;
    case HT_CALL_BEYOND:
        return ht_port_beyond(&l->port) == ht_read16(r);
    case HT_CALL_BEGIN_FAST:
        ht_port_begin_fast(&l->port);
        return true;
    case HT_CALL_READ:
        ht_port_read(&l->port, &samples);
        return true;
    case HT_CALL_READ_CAPTURE:
        ht_port_read_capture(&l->port, &capture);
        return true;
    case HT_CALL_READ_SLOW:
        leg = ht_read16(r);
        which = ht_read16(r);
        return (leg < (uint16_t)HT_SLOW_CHANNELS) && (which < (uint16_t)HT_SLOW_CHANNELS)
               && (ht_port_read_slow(&l->port, leg, which) == ht_read16(r));
    case HT_CALL_READ_ABSOLUTE:
        return true;
    case HT_CALL_COUNTS:
        return ht_port_counts(&l->port) == ht_read16(r);
    case HT_CALL_OVERRUN:
        return ht_port_overrun(&l->port) == (ht_read16(r) != 0u);
    case HT_CALL_ACK_FAST:
        ht_port_ack_fast(&l->port);
        return true;
    default:
        return false;
    }
}

/* Do what the target's driver did: the end of a reply. */
/** @returns whether the registers at the far end have the same history as the ones here */
static bool take_registers(ht_link *l, ht_reader *r)
{
    uint32_t digest;
    l->registers.accesses = ht_read32(r);
    l->registers.violations = ht_read32(r);
    digest = ht_read32(r);
    if (!ht_mirror_take(&l->mirror, r)) {
        down(l, HT_LINK_ANSWER);
    }
    return ht_mirror_digest(&l->mirror, l->number) == digest;
}

static void follow(ht_link *l, ht_reader *r)
{
    bool together = true;
    if (l->calls != 0u) {
        while (together && (r->left != 0u)) {
            together = make_call(l, r);
        }
    } else {
        together = take_registers(l, r);
    }
    if (r->exceeded) {
        down(l, HT_LINK_ANSWER);
    } else if (!together) {
        down(l, HT_LINK_PARTED);
    } else {
        /* both ends have the same */
    }
}

/* Send the open request and take its reply over. */
/** Channels come in groups of 8 behind an octet of flags: those that changed have a value. */
static void take_channels(ht_link *l, ht_reader *r)
{
    uint16_t flags = 0u;
    uint16_t i;
    for (i = 0u; i < ht_channel_count(); i++) {
        if ((i % 8u) == 0u) {
            flags = ht_read8(r);
        }
        if ((flags & (1u << (i % 8u))) != 0u) {
            l->told[i] = ht_read_float(r);
        }
    }
    (void)memcpy(l->channels, l->told, sizeof l->channels);
}

static void operate(ht_link *l, uint16_t opcode)
{
    ht_reader r;
    if (!exchange(l, opcode, &r) || (r.left == 0u)) {
        return; /* nothing left: INIT, with parameters that the drive refused */
    }
    if (ht_channel_count() > (uint16_t)HT_PIL_CHANNELS) {
        down(l, HT_LINK_ANSWER);
        return;
    }
    l->value = ht_read_float(&r);
    take_channels(l, &r);
    follow(l, &r);
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
    if (l->local != NULL) {
        ht_pil_line_reset(l->local);
    }
}

void ht_link_hello(ht_link *l, ht_pil_identity *identity)
{
    ht_reader r;
    (void)memset(identity, 0, sizeof *identity);
    begin(l, HT_OP_PIL_HELLO);
    if (exchange(l, HT_OP_PIL_HELLO, &r)) {
        identity->version = ht_read16(&r);
        identity->params = ht_read16(&r);
        identity->channels = ht_read16(&r);
        identity->registers = ht_read16(&r);
        identity->names = ht_read32(&r);
        l->calls = (identity->registers == 0u) ? 1u : 0u;
        if (!ht_reader_done(&r)) {
            down(l, HT_LINK_ANSWER);
        }
    }
}

/* Those that differ from their defaults. */
static void add_parameters(ht_packet *request, const ht_params *p)
{
    ht_params defaults;
    uint16_t flags_at = 0u;
    uint16_t id;
    ht_params_default(&defaults);
    for (id = 0u; id < (uint16_t)HT_PARAMS; id++) {
        if ((id % 8u) == 0u) {
            flags_at = request->n;
            ht_packet_add8(request, 0u);
        }
        if (ht_float_bits(p->v[id]) != ht_float_bits(defaults.v[id])) {
            request->octet[flags_at] |= (uint16_t)(1u << (id % 8u));
            ht_packet_add_float(request, p->v[id]);
        }
    }
}

static void add_own_hardware(ht_link *l, const ht_board *board)
{
    ht_pil_hardware hardware;
    hardware.pwm_clock_Hz = ht_port_pwm_clock_Hz(&l->port);
    hardware.capture_clock_Hz = ht_port_capture_clock_Hz(&l->port);
    hardware.dead_min_us = board->dead_min_us;
    hardware.min_pulse_us = board->min_pulse_us;
    hardware.dead_max_counts = board->map->dead_max_counts;
    ht_pil_hardware_add(&l->request, &hardware);
}

void ht_link_init(ht_link *l, uint16_t device, const ht_params *p)
{
    const ht_board *board = ht_board_of_device(device);
    ht_regfile_reset(&l->registers, board->map);
    ht_mirror_init(&l->mirror, &l->registers, board->map);
    begin_log(&l->log, &l->mirror);
    ht_port_bind(&l->port, &l->registers, board);
    (void)memset(l->told, 0, sizeof l->told);
    if ((l->calls != 0u) && !ht_board_start(&l->port)) {
        down(l, HT_LINK_PARTED); /* never: the model's clock starts */
    }
    begin(l, HT_OP_PIL_INIT);
    ht_packet_add8(&l->request, device);
    add_parameters(&l->request, p);
    if (l->calls != 0u) {
        add_own_hardware(l, board);
    }
    add_hardware(l); /* register target: nothing has changed so far */
    operate(l, HT_OP_PIL_INIT);
}

void ht_link_request(ht_link *l, uint16_t opcode, uint16_t argument, float value)
{
    begin(l, opcode);
    ht_packet_add16(&l->request, argument);
    if (opcode == (uint16_t)HT_OP_PIL_SET) {
        ht_packet_add_float(&l->request, value);
    }
    add_hardware(l);
    operate(l, opcode);
}

void ht_link_snapshot(ht_link *l, ht_snapshot *s)
{
    ht_reader r;
    begin(l, HT_OP_PIL_SNAPSHOT);
    if (exchange(l, HT_OP_PIL_SNAPSHOT, &r)) {
        uint32_t faults = ht_read32(&r);
        if (r.left != (uint16_t)HT_SNAPSHOT_BYTES) {
            down(l, HT_LINK_ANSWER);
        } else {
            ht_snapshot_take(r.octet, s);
            s->faults = faults;
        }
    }
}

void ht_link_fast(ht_link *l)
{
    ht_link_request(l, HT_OP_PIL_STEP, HT_PIL_FAST, 0.0f);
}

void ht_link_slow(ht_link *l)
{
    ht_link_request(l, HT_OP_PIL_STEP, HT_PIL_SLOW, 0.0f);
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
