/* Fuzz target: the XCP slave (firmware/link/xcp) on a drive of its own. The first octet of an input
 * chooses the line, the others are steps: octets or whole frames for the slave, time, a line that is
 * slow. After each step the drive must be as its rules want it, and all that the slave has sent must be
 * whole frames. */
#include <stddef.h>
#include <string.h>

#include "check.h"
#include "ht_drivers.h"
#include "ht_regfile.h"
#include "ht_xcp.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define LINE 4096u
#define STEPS 96u

typedef struct {
    ht_drive drive;
    ht_service service;
    ht_xcp xcp;
    ht_port port;
    ht_regfile registers;
    ht_store store;
    uint32_t memory[64];
    uint8_t in[LINE];
    size_t in_n, in_at;
    uint8_t out[2u * HT_XCP_DTO];
    size_t out_n;
    uint16_t room;    /* octets that a write takes at most */
    uint16_t counter; /* of the next frame to the slave */
    bool serial, started;
} bench;

static bench b;

static uint16_t line_read(void *at, uint16_t *octets, uint16_t n, bool *lost)
{
    uint16_t k;
    (void)at;
    *lost = false;
    for (k = 0; (k < n) && (b.in_at < b.in_n); k++) {
        octets[k] = (uint16_t)(b.in[b.in_at++] | ((k & 1u) << 8)); /* a cell has room for more */
    }
    return k;
}

/* Octets of a frame by its definition; 0 while it is not whole. */
static size_t frame(const uint8_t *octets, size_t n)
{
    size_t length;
    size_t k;
    unsigned sum = 0;
    if (n < 4) {
        return 0;
    }
    length = octets[0] + 256u * octets[1];
    CHECK((length >= 1) && (length <= HT_XCP_DTO));
    CHECK((octets[4 + 0] <= 31) ? (length >= 5) : (length <= HT_XCP_CTO));
    length += 4;
    if (!b.serial) {
        return (n >= length) ? length : 0;
    }
    length += length & 1u;
    if (n < length + 2) {
        return 0;
    }
    for (k = 0; k < length; k += 2) {
        sum += octets[k] + 256u * octets[k + 1];
    }
    CHECK((sum & 0xFFFFu) == octets[length] + 256u * octets[length + 1]);
    return length + 2;
}

/* What the link sends is not looked at. */
static uint16_t line_write(void *at, const uint16_t *octets, uint16_t n)
{
    uint16_t taken = (n < b.room) ? n : b.room;
    uint16_t k;
    size_t length;
    (void)at;
    for (k = 0; (k < taken) && b.xcp.ours && !b.xcp.link_first; k++) {
        CHECK(octets[k] <= 0xFFu);
        b.out[b.out_n++] = (uint8_t)octets[k];
        length = (b.out_n < 5) ? 0 : frame(b.out, b.out_n);
        if (length != 0) {
            CHECK(length == b.out_n);
            b.out_n = 0;
        }
    }
    if (!b.xcp.ours || b.xcp.link_first) {
        b.out_n = 0;
    }
    return taken;
}

static void begin(bool serial)
{
    ht_service_setup setup;
    ht_line line = {line_read, line_write, NULL, 125000u};
    ht_params p;
    unsigned k;
    memset(&b, 0, sizeof b);
    b.serial = serial;
    b.room = 16;
    ht_regfile_reset(&b.registers, ht_board_f28377s.map);
    ht_port_bind(&b.port, &b.registers, &ht_board_f28377s);
    CHECK(ht_board_start(&b.port));
    ht_params_default(&p);
    p.v[HT_P_f_isr_Hz] = 2500.0f;
    p.v[HT_P_encoder_trip_rpm] = 0.0f; /* no machine is connected */
    CHECK(ht_drive_init(&b.drive, &b.port, &p) == HT_OK);
    for (k = 0; k < 7u; k++) {
        b.registers.word[b.port.map->adc_result[k]] = (uint16_t)(2048u << b.port.map->adc_shift);
    }
    ht_store_none(&b.store);
    memset(&setup, 0, sizeof setup);
    setup.device = "bench";
    setup.build = "fuzz";
    setup.watchdog_ms = 100;
    setup.memory = b.memory;
    setup.memory_size = 64;
    setup.store = &b.store;
    ht_xcp_init(&b.xcp, &b.service, &line, (uint16_t)(serial ? HT_XCP_SERIAL : HT_XCP_NET));
    setup.line = ht_xcp_shared(&b.xcp);
    ht_service_init(&b.service, &b.drive, &setup);
}

static void put(const uint8_t *octets, size_t n)
{
    size_t k;
    for (k = 0; (k < n) && (b.in_n < LINE); k++) {
        b.in[b.in_n++] = octets[k];
    }
}

static void put_packet(const uint8_t *packet, size_t n)
{
    uint8_t made[300] = {0};
    size_t length = 4 + n;
    unsigned sum = 0;
    size_t k;
    made[0] = (uint8_t)n;
    made[2] = (uint8_t)b.counter;
    made[3] = (uint8_t)(b.counter >> 8);
    b.counter++;
    if (n != 0) {
        memcpy(&made[4], packet, n);
    }
    if (b.serial) {
        length += length & 1u;
        for (k = 0; k < length; k += 2) {
            sum += made[k] + 256u * made[k + 1];
        }
        made[length++] = (uint8_t)sum;
        made[length++] = (uint8_t)(sum >> 8);
    }
    if ((n >= 2) && (packet[0] == 0xF1) && (packet[1] == HT_OP_START)) {
        b.started = true; /* from now on the gates may be on */
    }
    put(made, length);
}

static void check(void)
{
    const ht_xcp_daq *a = &b.xcp.daq;
    unsigned k;
    for (k = 0; k < ht_param_count(); k++) {
        CHECK(ht_param_valid((uint16_t)k, ht_drive_get(&b.drive, (uint16_t)k)));
    }
    CHECK((a->lists <= HT_XCP_LISTS) && (a->odts <= HT_XCP_ODTS));
    CHECK((a->entries <= HT_XCP_ENTRIES) && (a->head < HT_XCP_RING) && (a->tail < HT_XCP_RING));
    CHECK(b.xcp.in.n <= HT_XCP_HEAD + HT_XCP_CTO + HT_XCP_TAIL);
    CHECK(b.xcp.reply.n <= HT_XCP_CTO);
    if (!b.started) {
        CHECK((b.drive.state == HT_STATE_IDLE) && ht_port_tripped(&b.port, HT_ALL_LEGS));
    }
}

static void pass(unsigned periods)
{
    for (; periods != 0; periods--) {
        ht_drive_fast_isr(&b.drive);
        ht_service_fast(&b.service);
        ht_xcp_fast(&b.xcp);
        if (b.serial) {
            ht_service_turn(&b.service);
        }
        ht_xcp_turn(&b.xcp);
        check();
    }
    ht_drive_slow_isr(&b.drive);
    ht_watchdog_first(&b.port);
    ht_watchdog_second(&b.port);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t connect[2] = {0xFF, 0};
    size_t at = 1;
    unsigned k;
    if (size == 0) {
        return 0;
    }
    begin((data[0] & 1u) != 0);
    if ((data[0] & 2u) != 0) {
        put_packet(connect, sizeof connect);
        pass(4);
    }
    for (k = 0; (k < STEPS) && (at + 1 < size); k++) {
        unsigned kind = data[at] & 3u;
        size_t n = data[at++] >> 2; /* up to 63 octets */
        n = (n < size - at) ? n : size - at;
        if (kind == 0) {
            put(&data[at], n);
        } else if (kind == 3) {
            b.room = (uint16_t)(data[at] % 17u);
            n = 1;
        } else {
            put_packet(&data[at], n);
        }
        at += n;
        pass((kind == 2) ? 1u : 6u);
    }
    b.room = 16;
    b.in_n = b.in_at;
    pass(200);
    return 0;
}
