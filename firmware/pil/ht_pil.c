#include "ht_pil.h"

#include <stddef.h>
#include <string.h>

#include "ht_octets.h"
#include "ht_snapshot.h"

/* A name with its closing zero, so that two names are not one. */
static uint32_t sum_name(uint32_t crc, const char *name)
{
    uint32_t sum = crc;
    uint16_t i = 0u;
    uint16_t letter;
    do {
        letter = (uint16_t)name[i];
        sum = ht_crc32(sum, &letter, 1u);
        i++;
    } while (letter != 0u);
    return sum;
}

void ht_pil_identify(ht_pil_identity *id)
{
    uint16_t i;
    id->version = HT_PIL_VERSION;
    id->params = ht_param_count();
    id->channels = ht_channel_count();
    id->registers = ht_side_registers();
    id->names = 0u;
    for (i = 0u; i < id->params; i++) {
        id->names = sum_name(id->names, ht_param_describe(i)->name);
    }
    for (i = 0u; i < id->channels; i++) {
        id->names = sum_name(id->names, ht_channel_describe(i)->name);
    }
}

void ht_pil_reset(ht_pil *p)
{
    p->ready = false;
    p->image.begin = NULL;
    p->image.fast = NULL;
    p->image.at = NULL;
}

static uint16_t init(ht_pil *p, ht_reader *request)
{
    ht_params params;
    ht_result result;
    uint16_t device = ht_read8(request);
    uint16_t flags = 0u;
    uint16_t id;
    p->ready = false;
    (void)memset(&p->drive, 0, sizeof p->drive); /* as after a reset */
    (void)memset(&p->port, 0, sizeof p->port);
    (void)memset(p->told, 0, sizeof p->told);
    /* For every eight parameters an octet says which of them follow. The others have their defaults:
     * all of them would not fit into a frame. */
    ht_params_default(&params);
    for (id = 0u; id < (uint16_t)HT_PARAMS; id++) {
        if ((id % 8u) == 0u) {
            flags = ht_read8(request);
        }
        if (((uint16_t)(flags >> (id % 8u)) & 1u) != 0u) {
            params.v[id] = ht_read_float(request);
        }
    }
    if (!ht_side_init(&p->side, &p->port, device, request)) {
        return HT_PIL_REFUSED;
    }
    result = ht_drive_init(&p->drive, &p->port, &params);
    p->ready = result == HT_OK;
    if (p->ready && (p->image.begin != NULL)) {
        p->image.begin(p->image.at, &p->drive);
    }
    return (uint16_t)result;
}

static void step(ht_pil *p, uint16_t interrupts)
{
    if ((interrupts & (uint16_t)HT_PIL_FAST) != 0u) {
        if (p->image.fast != NULL) {
            p->image.fast(p->image.at);
        } else {
            ht_drive_fast_isr(&p->drive);
        }
    }
    if ((interrupts & (uint16_t)HT_PIL_SLOW) != 0u) {
        ht_drive_slow_isr(&p->drive);
    }
}

/* A request for a drive. `value`: the parameter's, of a GET. */
static uint16_t carry_out(ht_pil *p, uint16_t opcode, ht_reader *request, float *value)
{
    uint16_t argument = ht_read16(request); /* interrupts, or a parameter's id */
    float written = (opcode == (uint16_t)HT_OP_PIL_SET) ? ht_read_float(request) : 0.0f;
    if (!p->ready || !ht_side_take(&p->side, &p->port, request)) {
        return HT_PIL_REFUSED;
    }
    switch (opcode) {
    case HT_OP_PIL_STEP:
        step(p, argument);
        return HT_OK;
    case HT_OP_PIL_START:
        return (uint16_t)ht_drive_start(&p->drive);
    case HT_OP_PIL_STOP:
        ht_drive_stop(&p->drive);
        return HT_OK;
    case HT_OP_PIL_CLEAR:
        return (uint16_t)ht_drive_clear(&p->drive);
    case HT_OP_PIL_SET:
        return (uint16_t)ht_drive_set(&p->drive, argument, written);
    case HT_OP_PIL_GET:
        if (argument >= (uint16_t)HT_PARAMS) {
            return HT_ERROR_ID;
        }
        *value = ht_drive_get(&p->drive, argument);
        return HT_OK;
    default:
        return HT_PIL_REFUSED;
    }
}

static uint16_t hello(ht_packet *reply)
{
    ht_pil_identity id;
    ht_pil_identify(&id);
    ht_packet_add16(reply, id.version);
    ht_packet_add16(reply, id.params);
    ht_packet_add16(reply, id.channels);
    ht_packet_add16(reply, id.registers);
    ht_packet_add32(reply, id.names);
    return HT_OK;
}

static uint16_t snapshot(const ht_pil *p, ht_packet *reply)
{
    if (!p->ready) {
        return HT_PIL_REFUSED;
    }
    ht_packet_add32(reply, p->drive.snapshot.faults);
    ht_snapshot_add(reply, &p->drive.snapshot);
    return HT_OK;
}

/* The channels that changed since the latest reply. For every eight channels a byte says which
 * of them follow. */
static void tell_channels(ht_pil *p, ht_packet *reply)
{
    uint16_t flags_at = 0u;
    uint16_t id;
    for (id = 0u; id < ht_channel_count(); id++) {
        uint32_t bits = ht_float_bits(ht_channel_read(&p->drive, id));
        if ((id % 8u) == 0u) {
            flags_at = reply->n;
            ht_packet_add8(reply, 0u);
        }
        if (bits != p->told[id]) {
            p->told[id] = bits;
            reply->octet[flags_at] |= (uint16_t)(1u << (id % 8u));
            ht_packet_add32(reply, bits);
        }
    }
}

/* Everything else. The reply says what the host may want to know after an interrupt or a
 * command. */
static uint16_t operate(ht_pil *p, uint16_t opcode, uint16_t number, ht_reader *request,
                        ht_packet *reply)
{
    float value = 0.0f;
    uint16_t result = (opcode == (uint16_t)HT_OP_PIL_INIT) ? init(p, request)
                                                           : carry_out(p, opcode, request, &value);
    if (p->ready && (result != (uint16_t)HT_PIL_REFUSED)) {
        ht_packet_add_float(reply, value);
        tell_channels(p, reply);
        ht_side_tell(&p->side, &p->port, number, reply);
    }
    return result;
}

static void begin(ht_packet *reply)
{
    uint16_t i;
    ht_packet_begin(reply);
    for (i = 0u; i < (uint16_t)HT_PIL_REPLY_HEAD; i++) {
        ht_packet_add8(reply, 0u);
    }
}

void ht_pil_answer(ht_pil *p, const uint16_t *octets, uint16_t n, ht_packet *reply)
{
    ht_reader request;
    uint16_t opcode;
    uint16_t number;
    uint16_t result;
    ht_reader_begin(&request, octets, n);
    opcode = ht_read8(&request);
    number = ht_read8(&request);
    begin(reply);
    switch (opcode) {
    case HT_OP_PIL_HELLO:
        result = hello(reply);
        break;
    case HT_OP_PIL_SNAPSHOT:
        result = snapshot(p, reply);
        break;
    default:
        result = operate(p, opcode, number, &request, reply);
        break;
    }
    if (reply->full) {
        begin(reply);
        result = HT_PIL_REFUSED;
    }
    reply->octet[0] = opcode | (uint16_t)HT_OP_REPLY;
    reply->octet[1] = number;
    reply->octet[2] = result;
    if (p->ready) {
        reply->octet[3] = p->drive.state;
        ht_put32(&reply->octet[4], p->drive.faults);
    }
}

void ht_pil_complain(ht_packet *reply)
{
    begin(reply);
    reply->octet[0] = (uint16_t)HT_OP_PIL_DAMAGED | (uint16_t)HT_OP_REPLY;
}
