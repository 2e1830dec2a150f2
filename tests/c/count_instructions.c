/* Instructions of the fast interrupt and of the control step in it, on the host,
 * counted by single stepping: exact and repeatable, unlike time. The interrupt
 * includes the register model behind the drivers, the step is the control core
 * alone.
 *
 *   count_instructions TRACE
 *
 * TRACE (text, written by `hexatorque evidence speed`): a line "device N" (its row in
 * ht_chips.def), a line "params" and one value per parameter, then per period
 * "sample a0..a6 position slow". The drive replays it; PERIODS periods
 * of its second half are counted. Prints "isr MEAN MAX step MEAN MAX periods N". Linux only (ptrace).
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ht_board_of_device.h"
#include "ht_drive.h"
#include "ht_port_c2000.h"

#define PERIODS 32

static ht_regfile registers;
static ht_port port;
static ht_drive drive;

/* Brackets of the counted stretch: the tracer counts from one to the next. */
static void mark(void)
{
    (void)kill(getpid(), SIGUSR1);
}

static int replay(const char *path)
{
    FILE *file = fopen(path, "r");
    ht_params params;
    int device = 0;
    unsigned id;
    long period = 0;
    long count = 0;
    long every;
    if (file == NULL) {
        return 2;
    }
    if ((fscanf(file, " device %d periods %ld params", &device, &count) != 2)
        || (count < 2 * PERIODS)) {
        return 2;
    }
    ht_params_default(&params);
    for (id = 0; id < HT_PARAMS; id++) {
        if (fscanf(file, "%f", &params.v[id]) != 1) {
            return 2;
        }
    }
    ht_port_bind(&port, &registers, ht_board_of_device((uint16_t)device));
    ht_regfile_reset(&registers, port.map);
    if (!ht_board_start(&port) || (ht_drive_init(&drive, &port, &params) != HT_OK)) {
        return 3;
    }
    (void)ht_drive_start(&drive);
    every = count / (2 * PERIODS);
    mark(); /* an empty stretch: the cost of the brackets */
    mark();
    for (period = 0; period < count; period++) {
        unsigned adc[HT_ADC_CHANNELS];
        unsigned long position;
        int slow;
        int channel;
        if (fscanf(file, "%u %u %u %u %u %u %u %lu %d", &adc[0], &adc[1], &adc[2], &adc[3], &adc[4],
                   &adc[5], &adc[6], &position, &slow)
            != 9) {
            return 2;
        }
        for (channel = 0; channel < HT_ADC_CHANNELS; channel++) {
            registers.word[port.map->adc_result[channel]] =
                (uint16_t)(adc[channel] << port.map->adc_shift);
        }
        registers.word[port.map->eqep] = (uint16_t)(position & 0xFFFFu);
        registers.word[port.map->eqep + 1u] = (uint16_t)(position >> 16);
        if ((period >= count - every * PERIODS) && (period % every == 0)) {
            static ht_drive before;
            ht_compare out;
            before = drive;
            mark();
            ht_drive_fast_isr(&drive);
            mark();
            before.in = drive.in;
            mark();
            ht_control_step(&before.config->control, &before.control, &before.in, false, &out);
            mark();
        } else {
            ht_drive_fast_isr(&drive);
        }
        if (slow != 0) {
            ht_drive_slow_isr(&drive);
        }
    }
    (void)fclose(file);
    return (drive.state == (uint16_t)HT_STATE_RUN) ? 0 : 4;
}

/* Run to the next bracket; with `counting` in single steps. */
static long to_mark(pid_t child, int counting, int *status)
{
    long steps = 0;
    for (;;) {
        if (ptrace(counting ? PTRACE_SINGLESTEP : PTRACE_CONT, child, NULL, NULL) != 0) {
            return -1;
        }
        if ((waitpid(child, status, 0) != child) || WIFEXITED(*status) || WIFSIGNALED(*status)) {
            return -1;
        }
        if (WSTOPSIG(*status) == SIGUSR1) {
            return steps;
        }
        steps++;
    }
}

int main(int argc, char **argv)
{
    pid_t child;
    int status = 0;
    long overhead;
    long total[2] = {0, 0};
    long most[2] = {0, 0};
    long stretches = 0;
    if (argc != 2) {
        fprintf(stderr, "usage: %s TRACE\n", argv[0]);
        return 2;
    }
    child = fork();
    if (child == 0) {
        if (ptrace(PTRACE_TRACEME, 0, NULL, NULL) != 0) {
            _exit(5);
        }
        (void)raise(SIGSTOP);
        _exit(replay(argv[1]));
    }
    if ((child < 0) || (waitpid(child, &status, 0) != child) || !WIFSTOPPED(status)) {
        fprintf(stderr, "%s: cannot trace here (%s)\n", argv[0], strerror(errno));
        return 1;
    }
    if ((to_mark(child, 0, &status) < 0) || ((overhead = to_mark(child, 1, &status)) < 0)) {
        fprintf(stderr, "%s: replay failed with status %d\n", argv[0], WEXITSTATUS(status));
        return 1;
    }
    while (to_mark(child, 0, &status) >= 0) {
        long which = stretches % 2; /* interrupt and step alternate */
        long steps = to_mark(child, 1, &status);
        if (steps < 0) {
            break;
        }
        steps -= overhead;
        total[which] += steps;
        most[which] = (steps > most[which]) ? steps : most[which];
        stretches++;
    }
    if (!WIFEXITED(status) || (WEXITSTATUS(status) != 0) || (stretches < 2)) {
        fprintf(stderr, "%s: replay failed with status %d\n", argv[0], WEXITSTATUS(status));
        return 1;
    }
    stretches /= 2;
    printf("isr %ld %ld step %ld %ld periods %ld\n", (total[0] + stretches / 2) / stretches,
           most[0], (total[1] + stretches / 2) / stretches, most[1], stretches);
    return 0;
}
