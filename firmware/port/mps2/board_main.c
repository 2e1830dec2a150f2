/* The emulated board with its serial link: the drive's plant and the time are the host's, by
 * processor in the loop; who commands the drive is at the other end of UART0, which the link shares
 * with XCP, or at that of UART1, which is XCP's alone.
 *
 *   setup   32-bit words: baud rate of UART0, milliseconds of the watchdog
 *   store   the memory for parameters and log; without this file the board has none. Words lie in
 *           it as in memory, low byte first.
 */
#include "cmsdk_uart.h"
#include "ht_service.h"
#include "ht_xcp.h"
#include "pil_server.h"
#include "semihost.h"

#include <stddef.h>

/* 32-bit values of memory for captures: what the F28377S's image has. */
#define CAPTURE_VALUES 20480u

/* The fastest that a UART's divider makes. */
#define NET_BAUD (CMSDK_UART_CLOCK_HZ / 16u)

/* Bytes that a turn of the background is sure to hand over while frames are waiting: it
 * takes up to 16, and a frame's rest. */
#define TURN_OCTETS 8.0f
#define TURNS_MIN 4
/* The emulator fetches a byte only once the one before has been read. Turns that it is
 * given for the next one, some 50 us: else a request would take a period a byte. */
#define TURNS_OCTET 200

typedef struct {
    ht_drive *drive;
    cmsdk_uart uart;
    cmsdk_uart net;
    ht_service service;
    ht_xcp xcp_serial;
    ht_xcp xcp_net;
    ht_service_setup setup;
    ht_store store;
    ht_drive_log log;
    int32_t store_file;
    ht_params saved;
    uint32_t capture[CAPTURE_VALUES];
} board;

#define BLOCK_OCTETS ((uint32_t)HT_STORE_FILE_BLOCK)
#define LOG_FIRST ((uint32_t)HT_STORE_FILE_AREAS * (uint32_t)HT_STORE_FILE_BLOCKS) /* block */

static const uint16_t erased[HT_STORE_WORDS] = {HT_STORE_ERASED, HT_STORE_ERASED, HT_STORE_ERASED,
                                                HT_STORE_ERASED, HT_STORE_ERASED, HT_STORE_ERASED,
                                                HT_STORE_ERASED, HT_STORE_ERASED};

/* Blocks are counted over the whole file. */
static bool read_at(const board *b, uint32_t block, uint16_t *words)
{
    return semihost_seek(b->store_file, (uint32_t)HT_STORE_FILE_HEAD + (block * BLOCK_OCTETS))
           && (semihost_read(b->store_file, words, BLOCK_OCTETS) == BLOCK_OCTETS);
}

/* `words` = NULL: erase `n` blocks; else write one. */
static bool write_at(const board *b, uint32_t block, const uint16_t *words, uint16_t n)
{
    bool good = semihost_seek(b->store_file, (uint32_t)HT_STORE_FILE_HEAD + (block * BLOCK_OCTETS))
                != 0;
    uint16_t left = (words == NULL) ? n : 1u;
    for (; good && (left != 0u); left--) {
        good = semihost_write(b->store_file, (words == NULL) ? erased : words, BLOCK_OCTETS) != 0;
    }
    return good;
}

static uint32_t of_store(uint16_t area, uint16_t block)
{
    return ((uint32_t)area * (uint32_t)HT_STORE_FILE_BLOCKS) + block;
}

static uint32_t of_log(uint16_t area, uint16_t block)
{
    return LOG_FIRST + ((uint32_t)area * (uint32_t)HT_STORE_FILE_LOG_BLOCKS) + block;
}

static bool read_block(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    return (block < (uint16_t)HT_STORE_FILE_BLOCKS)
           && read_at((const board *)at, of_store(area, block), words);
}

static bool write_block(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    return (block < (uint16_t)HT_STORE_FILE_BLOCKS)
           && write_at((const board *)at, of_store(area, (words == NULL) ? 0u : block), words,
                       (uint16_t)HT_STORE_FILE_BLOCKS);
}

static bool read_log(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    return read_at((const board *)at, of_log(area, block), words);
}

static bool write_log(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    return write_at((const board *)at, of_log(area, (words == NULL) ? 0u : block), words,
                    (uint16_t)HT_STORE_FILE_LOG_BLOCKS);
}

/* The host has looked into the same file before it chose the parameters of INIT: a saved set that is
 * not in force was refused. Commands are never kept. */
static bool in_force(const ht_params *saved, const ht_params *p)
{
    uint16_t id;
    bool same = true;
    for (id = 0u; id < (uint16_t)HT_PARAMS; id++) {
        same = same && (ht_store_is_command(id) || (saved->v[id] == p->v[id]));
    }
    return same;
}

static void look_into_store(board *b)
{
    b->store.set = ht_store_load(&b->store, &b->saved);
    if ((b->store.set == (uint16_t)HT_SET_SAVED) && !in_force(&b->saved, &b->drive->params)) {
        b->store.set = (uint16_t)HT_SET_FOREIGN;
    }
}

static void begin(void *at, ht_drive *drive)
{
    board *b = (board *)at;
    ht_line serial = cmsdk_uart_line(&b->uart);
    ht_line net = cmsdk_uart_line(&b->net);
    b->drive = drive;
    look_into_store(b);
    ht_xcp_init(&b->xcp_serial, &b->service, &serial, (uint16_t)HT_XCP_SERIAL);
    ht_xcp_init(&b->xcp_net, &b->service, &net, (uint16_t)HT_XCP_NET);
    b->setup.line = ht_xcp_shared(&b->xcp_serial);
    ht_service_init(&b->service, drive, &b->setup);
}

/* The background that ran since the one before, then the interrupt. */
static void fast(void *at)
{
    board *b = (board *)at;
    float period_s = 1.0f / b->drive->params.v[HT_P_f_isr_Hz];
    int turns = TURNS_MIN + (int)((float)b->uart.octets_per_s * period_s / TURN_OCTETS);
    cmsdk_uart_pass(&b->uart, period_s);
    cmsdk_uart_pass(&b->net, period_s);
    while (turns > 0) {
        float credit = b->uart.credit_in + b->net.credit_in;
        ht_service_turn(&b->service);
        ht_xcp_turn(&b->xcp_serial);
        ht_xcp_turn(&b->xcp_net);
        turns--;
        if (((b->uart.credit_in + b->net.credit_in) < credit) && (turns < TURNS_OCTET)) {
            turns = TURNS_OCTET; /* no more often than there is credit */
        }
    }
    ht_drive_fast_isr(b->drive);
    ht_service_fast(&b->service);
    ht_xcp_fast(&b->xcp_serial);
    ht_xcp_fast(&b->xcp_net);
}

int main(void)
{
    static ht_pil_line line;
    static board b;
    uint32_t setup[2];
    int32_t file = semihost_open("setup", SEMIHOST_READ);
    if ((file < 0) || (semihost_read(file, setup, sizeof setup) != sizeof setup)) {
        return EXIT_FILE;
    }
    if (!cmsdk_uart_start(&b.uart, CMSDK_UART0, setup[0])
        || !cmsdk_uart_start(&b.net, CMSDK_UART1, NET_BAUD)) {
        return EXIT_SETUP;
    }
    b.setup.device = HT_MACHINE;
    b.setup.build = HT_BUILD;
    b.setup.watchdog_ms = (uint16_t)setup[1];
    b.setup.memory = b.capture;
    b.setup.memory_size = CAPTURE_VALUES;
    ht_store_none(&b.store);
    ht_log_none(&b.log);
    b.store_file = semihost_open("store", SEMIHOST_UPDATE);
    if (b.store_file >= 0) {
        b.store.port.read = read_block;
        b.store.port.write = write_block;
        b.store.port.at = &b;
        b.store.port.blocks = (uint16_t)HT_STORE_FILE_BLOCKS;
        b.log.ring.port.read = read_log;
        b.log.ring.port.write = write_log;
        b.log.ring.port.at = &b;
        b.log.ring.port.blocks = (uint16_t)HT_STORE_FILE_LOG_BLOCKS;
    }
    b.setup.store = &b.store;
    b.setup.log = &b.log;
    ht_pil_line_reset(&line);
    line.pil.image.begin = begin;
    line.pil.image.fast = fast;
    line.pil.image.at = &b;
    return pil_server_run(&line);
}
