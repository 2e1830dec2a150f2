#include "rig.h"

#include <stddef.h>
#include <string.h>

#include "check.h"
#include "ht_drivers.h"
#include "reference.h"
#include "rules.h"

#define MID 2048u

typedef struct {
    ht_drive drive;
    ht_service service;
    ht_port port;
    uint32_t memory[RIG_MEMORY];
    uint16_t word[HT_REGFILE_WORDS];
    unsigned char rest[sizeof(ht_regfile)]; /* behind the tables, which only say what is where */
    rules known;
    uint8_t id;
} picture;

rig the_rig;
static picture pictures[RIG_STARTS];

#define REST offsetof(ht_regfile, gate)

static void keep(picture *p)
{
    const rig *r = &the_rig;
    p->drive = r->drive;
    p->service = r->service;
    p->port = r->port;
    memcpy(p->memory, r->memory, sizeof p->memory);
    memcpy(p->word, r->registers->word, sizeof p->word);
    memcpy(p->rest, (const unsigned char *)r->registers + REST, sizeof(ht_regfile) - REST);
    p->known = the_rules;
    p->id = r->id;
}

static void put_back(const picture *p)
{
    rig *r = &the_rig;
    r->drive = p->drive;
    r->service = p->service;
    r->port = p->port;
    memcpy(r->memory, p->memory, sizeof p->memory);
    memcpy(r->registers->word, p->word, sizeof p->word);
    memcpy((unsigned char *)r->registers + REST, p->rest, sizeof(ht_regfile) - REST);
    the_rules = p->known;
    r->id = p->id;
    r->in_n = 0;
    r->in_at = 0;
    r->room = UINT32_MAX;
    r->lost = false;
    r->isr_in_read = false;
    r->isr_in_write = false;
    r->ticks = 0;
    memset(r->stored, 0xFF, sizeof r->stored);
    memset(r->logged, 0xFF, sizeof r->logged);
    r->store_writes = 0;
}

/* --- the parameter store ------------------------------------------------------------------ */

static bool store_read(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    const rig *r = at;
    CHECK((area < HT_STORE_AREAS) && (block < RIG_BLOCKS));
    memcpy(words, &r->stored[area][block * HT_STORE_WORDS], HT_STORE_WORDS * sizeof *words);
    return true;
}

static bool store_write(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    rig *r = at;
    CHECK((area < HT_STORE_AREAS) && (block < RIG_BLOCKS));
    CHECK(rig_gates_off());
    r->store_writes++;
    if (words == NULL) {
        memset(r->stored[area], 0xFF, sizeof r->stored[area]);
    } else {
        CHECK(r->stored[area][block * HT_STORE_WORDS] == HT_STORE_ERASED);
        memcpy(&r->stored[area][block * HT_STORE_WORDS], words, HT_STORE_WORDS * sizeof *words);
    }
    return true;
}

/* --- the log ------------------------------------------------------------------------------ */

static bool log_read(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    const rig *r = at;
    CHECK((area < HT_STORE_AREAS) && (block < RIG_LOG_BLOCKS));
    memcpy(words, &r->logged[area][block * HT_STORE_WORDS], HT_STORE_WORDS * sizeof *words);
    return true;
}

static bool log_write(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    rig *r = at;
    unsigned k;
    CHECK((area < HT_STORE_AREAS) && (block < RIG_LOG_BLOCKS));
    CHECK(rig_gates_off());
    CHECK((r->drive.state == HT_STATE_IDLE) || (r->drive.state == HT_STATE_FAULT));
    if (words == NULL) {
        CHECK(r->service.session == 0u); /* no client waits */
        memset(r->logged[area], 0xFF, sizeof r->logged[area]);
        return true;
    }
    for (k = 0; k < HT_STORE_WORDS; k++) {
        CHECK(r->logged[area][block * HT_STORE_WORDS + k] == HT_STORE_ERASED);
        r->logged[area][block * HT_STORE_WORDS + k] = words[k];
    }
    return true;
}

/* --- the line ----------------------------------------------------------------------------- */

static uint16_t line_read(void *at, uint16_t *octets, uint16_t n, bool *lost)
{
    rig *r = at;
    uint16_t k;
    if (r->isr_in_read) {
        rig_fast();
    }
    *lost = r->lost;
    for (k = 0; (k < n) && (r->in_at < r->in_n); k++) {
        octets[k] = r->in[r->in_at];
        r->in_at++;
    }
    rules_read(octets, k, r->lost);
    r->lost = false;
    return k;
}

static uint16_t line_write(void *at, const uint16_t *octets, uint16_t n)
{
    rig *r = at;
    uint16_t taken = (n < r->room) ? n : (uint16_t)r->room;
    r->room -= taken;
    rules_write(octets, taken);
    if (r->isr_in_write) {
        rig_fast();
    }
    return taken;
}

void rig_put(const uint8_t *octets, size_t n)
{
    rig *r = &the_rig;
    size_t k;
    for (k = 0; (k < n) && (r->in_n < RIG_LINE); k++) {
        r->in[r->in_n++] = (uint16_t)(octets[k] | ((k & 1u) << 8)); /* a cell has room for more */
    }
}

void rig_put_body(const uint8_t *body, size_t n)
{
    uint8_t frame[REFERENCE_FRAME];
    rig_put(frame, reference_frame(body, n, frame));
}

void rig_ask(uint8_t opcode, uint16_t session, const uint8_t *payload, size_t n)
{
    uint8_t body[REFERENCE_BODY];
    uint32_t dictionary = the_rig.service.dictionary;
    body[0] = opcode;
    body[1] = ++the_rig.id;
    body[2] = (uint8_t)session;
    body[3] = (uint8_t)(session >> 8);
    body[4] = (uint8_t)dictionary;
    body[5] = (uint8_t)(dictionary >> 8);
    n = (n < REFERENCE_BODY - 6) ? n : (REFERENCE_BODY - 6);
    if (n != 0) {
        memcpy(&body[6], payload, n);
    }
    rig_put_body(body, n + 6);
}

/* --- time --------------------------------------------------------------------------------- */

void rig_fast(void)
{
    if (the_rig.ticks++ < RIG_TICKS) {
        ht_drive_fast_isr(&the_rig.drive);
        ht_service_fast(&the_rig.service);
        rules_fast();
    }
}

void rig_turn(void)
{
    rules_before_turn();
    the_rig.store_writes = 0;
    ht_service_turn(&the_rig.service);
    ht_watchdog_first(&the_rig.port); /* the chip's own watchdog is not tested here */
    ht_watchdog_second(&the_rig.port);
    rules_turn();
}

void rig_slow(void)
{
    ht_drive_slow_isr(&the_rig.drive);
}

void rig_settle(void)
{
    const ht_service *s = &the_rig.service;
    unsigned k;
    the_rig.room = UINT32_MAX;
    for (k = 0; k < 300u; k++) {
        if ((the_rig.in_at == the_rig.in_n) && !s->reply_due && (s->out.sent == s->out.n)) {
            break;
        }
        rig_turn();
        if (k % 8u == 7u) {
            rig_fast();
        }
    }
}

void rig_sense(unsigned which, uint16_t value)
{
    const ht_c2000_map *m = the_rig.port.map;
    if (which < 7u) {
        the_rig.registers->word[m->adc_result[which]] =
            (uint16_t)((value & 0xFFFu) << m->adc_shift);
    } else {
        the_rig.registers->word[m->eqep] = (uint16_t)(the_rig.registers->word[m->eqep] + value);
    }
}

void rig_trip_pin(bool high)
{
    ht_regfile_pin(the_rig.registers, the_rig.port.board->trip.gpio, high ? 1u : 0u);
}

bool rig_trip_pin_low(void)
{
    uint16_t gpio = the_rig.port.board->trip.gpio; /* of port A */
    return ((*ht_regfile_word(the_rig.registers, 0x7F00u) >> gpio) & 1u) == 0u;
}

/* From the registers. */
bool rig_gates_off(void)
{
    const ht_port *port = &the_rig.port;
    unsigned leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        if ((the_rig.registers->word[port->leg[leg] + port->map->tzflg] & 4u) == 0u) {
            return false;
        }
    }
    return true;
}

/* --- where inputs begin ------------------------------------------------------------------- */

static void power_up(void)
{
    rig *r = &the_rig;
    ht_params p;
    ht_service_setup setup;
    unsigned k;
    r->registers = malloc(sizeof *r->registers);
    r->memory = malloc(RIG_MEMORY * sizeof *r->memory); /* where a sanitizer sees its end */
    CHECK((r->registers != NULL) && (r->memory != NULL));
    memset(r->memory, 0, RIG_MEMORY * sizeof *r->memory);
    ht_regfile_reset(r->registers, ht_board_f28377s.map);
    ht_port_bind(&r->port, r->registers, &ht_board_f28377s);
    CHECK(ht_board_start(&r->port));
    ht_params_default(&p);
    p.v[HT_P_f_isr_Hz] = 2500.0f;
    p.v[HT_P_calibration_s] = 0.001f;  /* 2 interrupts */
    p.v[HT_P_build_s] = 0.01f;         /* 25 */
    p.v[HT_P_encoder_trip_rpm] = 0.0f; /* no machine is connected */
    p.v[HT_P_flux_check] = 0.0f;
    p.v[HT_P_stuck_trip_A] = 0.0f;
    p.v[HT_P_loss_check] = 0.0f;
    p.v[HT_P_flux_trip_Wb] = 100.0f;
    CHECK(ht_drive_init(&r->drive, &r->port, &p) == HT_OK);
    r->drive.tick = (uint32_t)-80; /* it wraps in the middle of what follows */
    for (k = 0; k < 7u; k++) {
        rig_sense(k, MID);
    }
    ht_store_none(&r->store);
    r->store.port.read = store_read;
    r->store.port.write = store_write;
    r->store.port.at = r;
    r->store.port.blocks = RIG_BLOCKS;
    setup.device = "rig";
    setup.build = "fuzz";
    setup.watchdog_ms = RIG_WATCHDOG_MS;
    setup.line.read = line_read;
    setup.line.write = line_write;
    setup.line.at = r;
    setup.line.octets_per_s = 125000u;
    setup.memory = r->memory;
    setup.memory_size = RIG_MEMORY;
    ht_log_none(&r->log);
    r->log.ring.port.read = log_read;
    r->log.ring.port.write = log_write;
    r->log.ring.port.at = r;
    r->log.ring.port.blocks = RIG_LOG_BLOCKS;
    setup.store = &r->store;
    setup.log = &r->log;
    setup.reset = NULL;
    ht_service_init(&r->service, &r->drive, &setup);
    CHECK(ht_service_watchdog_ticks(&r->service) == RIG_WATCHDOG_TICKS);
    rules_begin();
    keep(&pictures[RIG_IDLE]);
}

static void ask(uint8_t opcode, const char *payload, size_t n)
{
    rig_ask(opcode, RIG_NONCE, (const uint8_t *)payload, n);
    rig_settle();
    CHECK(the_rig.service.reply.octet[2] == 0u);
}

/* Let time pass, while the host asks for the status. */
static void pass(unsigned ticks)
{
    unsigned k;
    for (k = 0; k < ticks; k++) {
        rig_fast();
        rig_turn();
        if (k % 8u == 0u) {
            ask(0x05, "", 0);
        }
    }
}

static void streams(void)
{
    ask(0x0B, "\0\2\3\0\2\0\3\0", 8); /* two channels of every third interrupt */
    ask(0x0B, "\3\1\40\0\25\0", 6);
}

static void arm(char trigger)
{
    /* 3 channels, 32 samples, 8 before the trigger */
    char set_up[24] = "\3?\1\0\40\0\0\0\10\0\0\0\1\0\0\0\0\0\1\0\2\0\25";
    set_up[1] = trigger;
    ask(0x0C, set_up, sizeof set_up);
}

static void go_on(unsigned from)
{
    put_back(&pictures[from]);
}

void rig_begin(unsigned start)
{
    static bool ready = false;
    unsigned k;
    if (!ready) {
        ready = true;
        power_up();
        go_on(RIG_IDLE);
        ask(0x03, "\64\22\1\0\0\0", 6);
        keep(&pictures[RIG_SESSION]);
        go_on(RIG_SESSION);
        ask(0x08, "", 0);
        pass(40);
        CHECK(the_rig.drive.state == (uint16_t)HT_STATE_RUN);
        keep(&pictures[RIG_RUNNING]);
        go_on(RIG_RUNNING);
        for (k = 0; k < 90u; k++) {
            rig_fast();
            rig_turn();
        }
        CHECK((the_rig.drive.faults == (uint16_t)HT_FAULT_LINK) && (the_rig.service.session == 0u));
        keep(&pictures[RIG_LOST]);
        go_on(RIG_SESSION);
        streams();
        arm(0);
        pass(12);
        ask(0x0F, "", 0);
        pass(40);
        CHECK(the_rig.service.burst.state == (uint16_t)HT_BURST_COMPLETE);
        keep(&pictures[RIG_CAPTURED]);
        go_on(RIG_RUNNING);
        streams();
        arm(5);
        pass(12);
        CHECK(the_rig.service.burst.state == (uint16_t)HT_BURST_WAITING);
        keep(&pictures[RIG_BUSY]);
        go_on(RIG_SESSION);
        rules_debugger_starts(ht_drive_start(&the_rig.drive) == HT_OK);
        pass(40);
        CHECK(the_rig.drive.state == (uint16_t)HT_STATE_RUN);
        keep(&pictures[RIG_DEBUGGER]);
    }
    put_back(&pictures[start % RIG_STARTS]);
}
