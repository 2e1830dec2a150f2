/* The emulated board with its serial link: the drive's plant and the time are the host's, by
 * processor in the loop; who commands the drive is at the other end of UART0.
 *
 *   setup   32-bit words: baud rate of UART0, milliseconds of the watchdog
 */
#include "cmsdk_uart.h"
#include "ht_service.h"
#include "pil_server.h"
#include "semihost.h"

/* 32-bit values of memory for captures: what the F28377S's image has. */
#define CAPTURE_VALUES 20480u

/* Octets that a turn of the background is sure to hand over while frames are waiting: it
 * takes up to 16, and a frame's rest. */
#define TURN_OCTETS 8.0f
#define TURNS_MIN 4
/* The emulator fetches an octet only once the one before has been read. Turns that it is
 * given for the next one, some 50 us: else a request would take a period an octet. */
#define TURNS_OCTET 200

typedef struct {
    ht_drive *drive;
    cmsdk_uart uart;
    ht_service service;
    ht_service_setup setup;
    uint32_t capture[CAPTURE_VALUES];
} board;

static void begin(void *at, ht_drive *drive)
{
    board *b = (board *)at;
    b->drive = drive;
    ht_service_init(&b->service, drive, &b->setup);
}

/* The background that ran since the one before, then the interrupt. */
static void fast(void *at)
{
    board *b = (board *)at;
    float period_s = 1.0f / b->drive->params.v[HT_P_f_isr_Hz];
    int turns = TURNS_MIN + (int)((float)b->uart.octets_per_s * period_s / TURN_OCTETS);
    cmsdk_uart_pass(&b->uart, period_s);
    while (turns > 0) {
        float credit = b->uart.credit_in;
        ht_service_turn(&b->service);
        turns--;
        if ((b->uart.credit_in < credit) && (turns < TURNS_OCTET)) {
            turns = TURNS_OCTET; /* no more often than there is credit */
        }
    }
    ht_drive_fast_isr(b->drive);
    ht_service_fast(&b->service);
}

int main(void)
{
    static ht_pil pil;
    static board b;
    uint32_t setup[2];
    int32_t file = semihost_open("setup", SEMIHOST_READ);
    if ((file < 0) || (semihost_read(file, setup, sizeof setup) != sizeof setup)) {
        return EXIT_FILE;
    }
    if (!cmsdk_uart_start(&b.uart, CMSDK_UART0, setup[0])) {
        return EXIT_SETUP;
    }
    b.setup.device = HT_MACHINE;
    b.setup.build = HT_BUILD;
    b.setup.watchdog_ms = (uint16_t)setup[1];
    b.setup.line = cmsdk_uart_line(&b.uart);
    b.setup.memory = b.capture;
    b.setup.memory_size = CAPTURE_VALUES;
    ht_pil_reset(&pil);
    pil.image.begin = begin;
    pil.image.fast = fast;
    pil.image.at = &b;
    return pil_server_run(&pil);
}
