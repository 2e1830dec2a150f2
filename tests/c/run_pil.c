/* Runs the C2000 image for processor in the loop on the register model: its own main,
 * from reset on, its serial line connected to standard input and output.
 *
 *   run_pil registers   prints what the start has written ("register ADDRESS VALUE")
 *   run_pil BAUD        serves a host whose end of the line has this rate
 *
 * Octets take their time on the line in both directions. If the rates of the two ends differ by
 * more than 2.5 %, they arrive damaged. SIGUSR1: the next octets come all at once. SIGUSR2: a
 * framing error. The program ends with status 70 and a line on standard error at the first
 * forbidden access, at a reset by the watchdog, or as soon as a pin of the PWM is not an input. It
 * ends with status 0 when the host closes the line. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "ht_board.h"
#include "ht_regfile.h"

#define TURN_US 4         /* of the background loop */
#define IDLE_US 1000      /* while the line is quiet: about real time */
#define TIMER_US 10000.0f /* no timer is shorter */
#define TOLERANCE 0.025f

int ht_target_main(void);
extern const ht_board HT_BOARD_UNDER_TEST;

ht_regfile ht_image_registers;

/* Symbols that the linker would provide: see main.c. The sizes are on the command line. */
const uint16_t ht_code_load[64] = {1};
uint16_t ht_code_run[64];
const uint16_t ht_const_load[32] = {2};
uint16_t ht_const_run[32];

static float host_baud; /* 0: only print the registers */
static unsigned char in[4096];
static size_t have;
static size_t given;
static unsigned char out[64];
static size_t waiting;
static float in_us;  /* until the next octet has arrived */
static float out_us; /* ... has left */
static float timer_us;
static volatile sig_atomic_t burst;
static volatile sig_atomic_t broken;

static void on_signal(int number)
{
    burst = (number == SIGUSR1) ? 1 : burst;
    broken = (number == SIGUSR2) ? 1 : broken;
}

/* --- what the chip has been set to --------------------------------------------------- */

static uint32_t word(uint32_t addr)
{
    return *ht_regfile_word(&ht_image_registers, addr);
}

static float divided(float clock_Hz, uint32_t setting)
{
    return (setting == 0u) ? clock_Hz : clock_Hz / (2.0f * (float)setting);
}

static float system_Hz(void)
{
    if (HT_BOARD_UNDER_TEST.map == &ht_f28335) { /* PLLCR, DIVSEL = /2 */
        return ((word(0x7011u) & 0x0180u) == 0x0100u) ? 30.0e6f * (float)word(0x7021u) / 2.0f
                                                      : 0.0f;
    } else { /* SYSPLLMULT, SYSCLKDIVSEL; the crystal of the LaunchPad has 10 MHz */
        float crystal_Hz = (HT_BOARD_UNDER_TEST.pwm[0].gpio == 2u) ? 10.0e6f : 20.0e6f;
        return divided(crystal_Hz * (float)(word(0x5D214u) & 0x7Fu), word(0x5D222u));
    }
}

static float chip_baud(void)
{
    int old = HT_BOARD_UNDER_TEST.map == &ht_f28335;
    uint32_t sci = old ? 0x7050u : 0x7200u;
    uint32_t counts = ((word(sci + 2u) << 8) | word(sci + 3u)) + 1u;
    float low_speed_Hz = divided(system_Hz(), word(old ? 0x701Bu : 0x5D22Cu) & 7u);
    return (word(sci) == 7u) ? low_speed_Hz / (8.0f * (float)counts) : 0.0f;
}

static unsigned on_the_line(unsigned octet)
{
    float ratio = chip_baud() / host_baud;
    return ((ratio > 1.0f - TOLERANCE) && (ratio < 1.0f + TOLERANCE)) ? octet : octet ^ 0x55u;
}

/* --- what must never be ------------------------------------------------------------------ */

static void show_violations(FILE *file)
{
    char name[HT_REGFILE_LINE];
    const ht_violation *v = &ht_image_registers.log[0];
    if (ht_image_registers.violations != 0u) {
        ht_regfile_name(&ht_image_registers, v->address, name);
        fprintf(file, "violation %06lX %s: %s%s%s (%08lX)\n", (unsigned long)v->address, name,
                ht_regfile_kind(v->kind), (v->why[0] != '\0') ? ", " : "", v->why,
                (unsigned long)v->value);
    }
}

/* Direction and multiplexer of port A, where all boards have them. */
static int gates_are_inputs(void)
{
    uint32_t gpio = (HT_BOARD_UNDER_TEST.map == &ht_f28335) ? 0x6F80u : 0x7C00u;
    const uint16_t *mux = &ht_image_registers.word[gpio + 6u];         /* eight pins a word */
    const uint16_t *direction = &ht_image_registers.word[gpio + 0xAu]; /* sixteen */
    unsigned bad = 0;
    unsigned n;
    for (n = 0; n < 2 * HT_LEGS; n++) {
        unsigned pin = HT_BOARD_UNDER_TEST.pwm[n].gpio;
        bad |= (mux[pin / 8u] >> (2u * (pin % 8u))) & 3u;
        bad |= (direction[pin / 16u] >> (pin % 16u)) & 1u;
    }
    return bad == 0;
}

static void insist(void)
{
    if (ht_image_registers.violations != 0u) {
        show_violations(stderr);
        exit(70);
    }
    if (!gates_are_inputs()) {
        fprintf(stderr, "a pin of the PWM is not an input\n");
        exit(70);
    }
}

/* --- time ------------------------------------------------------------------------------ */

static void pass(unsigned us)
{
    ht_regfile_wait(&ht_image_registers, (uint16_t)us);
    timer_us += (float)us;
    if (timer_us >= TIMER_US) {
        float counts = (float)(word(0xC02u) | (word(0xC03u) << 16)) + 1.0f;
        if (timer_us >= counts / system_Hz() * 1.0e6f) {
            timer_us = 0.0f;
            (void)ht_regfile_timer(&ht_image_registers);
        }
    }
}

static void arrive(void)
{
    if (broken != 0) { /* SCIRXST: RXERROR, FE */
        broken = 0;
        *ht_regfile_word(&ht_image_registers,
                         (HT_BOARD_UNDER_TEST.map == &ht_f28335) ? 0x7055u : 0x7205u) = 0x0090u;
    }
    if ((burst != 0) && (given < have)) {
        burst = 0;
        while (given < have) {
            (void)ht_regfile_sci_arrive(&ht_image_registers, (uint16_t)on_the_line(in[given++]));
        }
    }
    in_us = (in_us > 0.0f) ? in_us - (float)TURN_US : 0.0f;
    while ((given < have) && (in_us <= 0.0f)) {
        (void)ht_regfile_sci_arrive(&ht_image_registers, (uint16_t)on_the_line(in[given++]));
        in_us += 10.0e6f / host_baud;
    }
}

static void leave(void)
{
    out_us = (out_us > 0.0f) ? out_us - (float)TURN_US : 0.0f;
    while ((ht_image_registers.sci_out_count != 0u) && (out_us <= 0.0f)) {
        out[waiting++] = (unsigned char)on_the_line(ht_regfile_sci_leave(&ht_image_registers));
        out_us += 10.0e6f / chip_baud();
    }
    /* In larger pieces, as a USB adapter does. */
    if ((waiting == sizeof out) || ((waiting != 0u) && (ht_image_registers.sci_out_count == 0u))) {
        if (write(STDOUT_FILENO, out, waiting) != (ssize_t)waiting) {
            exit(0);
        }
        waiting = 0;
    }
}

/* One turn of the background loop, or of an image whose start has failed, is over. */
static void idle(ht_regfile *rf)
{
    insist();
    if (host_baud == 0.0f) {
        uint16_t n;
        for (n = 0; n < rf->bound_count; n++) {
            if (rf->bound[n].written != 0u) {
                printf("register %06lX %08lX\n", (unsigned long)ht_regfile_address(rf, n),
                       (unsigned long)ht_regfile_value(rf, n));
            }
        }
        exit(0);
    }
    if ((given == have) && (rf->sci_in_count == 0u) && (rf->sci_out_count == 0u)) {
        struct pollfd p = {.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
        if (poll(&p, 1, IDLE_US / 1000) > 0) {
            ssize_t n = read(STDIN_FILENO, in, sizeof in);
            if (n <= 0) {
                if ((n < 0) && (errno == EINTR)) {
                    return;
                }
                exit(0);
            }
            have = (size_t)n;
            given = 0;
        } else {
            pass(IDLE_US);
        }
    }
    arrive();
    leave();
    pass(TURN_US);
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        return 2;
    }
    host_baud = (strcmp(argv[1], "registers") == 0) ? 0.0f : (float)atol(argv[1]);
    (void)signal(SIGUSR1, on_signal);
    (void)signal(SIGUSR2, on_signal);
    ht_regfile_reset(&ht_image_registers, HT_BOARD_UNDER_TEST.map);
    ht_image_registers.idle = idle;
    if (host_baud != 0.0f) { /* another image ran before: all pins of port A to the PWM */
        uint32_t gpio = (HT_BOARD_UNDER_TEST.map == &ht_f28335) ? 0x6F80u : 0x7C00u;
        unsigned n;
        for (n = 6; n < 10; n++) {
            ht_image_registers.word[gpio + n] = 0x5555u;
        }
        ht_image_registers.word[gpio + 0xAu] = 0xFFFFu;
        ht_image_registers.word[gpio + 0xBu] = 0xFFFFu;
    }
    return ht_target_main();
}
