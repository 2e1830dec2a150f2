/* Instructions of the fast interrupt, counted on the emulated processor.
 *
 * Replays what the registers of a drive held in every period (file `trace`). Started
 * with -icount shift=10 an instruction takes 1024 ns of the emulator's clock, and
 * SysTick tells the time: exact, and the same on every run.
 *
 * The drivers access registers as on the DSP, by one load or store each; here there is
 * plain memory at their place. What the hardware would do to it happens in between,
 * uncounted.
 *
 *   trace   16-bit words: device (its row in ht_chips.def), parameters n, periods (low,
 *           high), n floats; then per period seven ADC counts, position (low, high), slow
 *   counts  written, 32-bit words: ticks of an empty interrupt; per period ticks of
 *           the fast interrupt, of the control step alone (0 outside `run`), of the slow
 *           interrupt (0 without), state, bytes of stack of the fast interrupt; at
 *           the end the telemetry channels
 *   states  written: SAMPLES times drive and inputs, spread over the end of the trace
 *
 * With the file `profile` present (any content) it replays only `states`, for the
 * emulator's log of executed instructions; each interrupt ends in `profile_end`.
 */
#include <string.h>

#include "ht_board_of_device.h"
#include "ht_drive.h"
#include "ht_port_c2000.h"
#include "semihost.h"

#define SYST_CSR (*(volatile uint32_t *)0xE000E010u)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014u)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018u)
#define SYST_MASK 0x00FFFFFFu
#define SAMPLES 64u
#define PERIOD_WORDS (HT_ADC_CHANNELS + 3u)
#define CHANNELS_MAX 128u
#define STACK_WORDS 512u
#define STACK_COLOUR 0xA5C3A5C3u

enum { EXIT_OK = 0, EXIT_FILE = 2, EXIT_REFUSED = 3, EXIT_NOT_RUNNING = 4 };

typedef struct {
    ht_drive drive;
    uint16_t inputs[PERIOD_WORDS];
} sample;

static sample now;
static ht_port port;

void profile_end(void);

__attribute__((noinline)) void profile_end(void)
{
    __asm volatile("");
}

__attribute__((noinline)) static void empty_isr(ht_drive *d)
{
    __asm volatile("" : : "r"(d));
}

static void read_all(int32_t file, void *data, uint32_t size)
{
    if (semihost_read(file, data, size) != size) {
        semihost_exit(EXIT_FILE);
    }
}

static void write_all(int32_t file, const void *data, uint32_t size)
{
    if (!semihost_write(file, data, size)) {
        semihost_exit(EXIT_FILE);
    }
}

static volatile uint16_t *word(uint32_t addr)
{
    return (volatile uint16_t *)HT_REGISTERS_AT + addr;
}

/* The hardware's reaction to the driver's writes. */
static void settle(void)
{
    const ht_c2000_map *m = port.map;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        uint32_t base = m->epwm + (uint32_t)leg * m->stride;
        *word(base + m->tzflg) = (uint16_t)((*word(base + m->tzflg) | *word(base + m->tzfrc))
                                            & (uint16_t)~*word(base + m->tzclr));
        *word(base + m->tzfrc) = 0u;
        *word(base + m->tzclr) = 0u;
    }
}

static void latch(const uint16_t *inputs)
{
    const ht_c2000_map *m = port.map;
    uint32_t channel;
    for (channel = 0u; channel < HT_ADC_CHANNELS; channel++) {
        *word(m->adc_result[channel]) = (uint16_t)(inputs[channel] << m->adc_shift);
    }
    *word(m->eqep) = inputs[HT_ADC_CHANNELS];
    *word(m->eqep + 1u) = inputs[HT_ADC_CHANNELS + 1u];
}

static uint32_t ticks(void (*isr)(ht_drive *), ht_drive *d)
{
    uint32_t begin = SYST_CVR;
    isr(d);
    return (begin - SYST_CVR) & SYST_MASK;
}

/* Bytes of stack that an interrupt takes, on a copy of the drive: whatever is below the
 * stack pointer gets a colour first. */
__attribute__((noinline)) static uint32_t stack_of(void (*isr)(ht_drive *), ht_drive *d)
{
    volatile uint32_t *sp;
    volatile uint32_t *word_at;
    __asm volatile("mov %0, sp" : "=r"(sp));
    for (word_at = sp - STACK_WORDS; word_at != sp; word_at++) {
        *word_at = STACK_COLOUR;
    }
    isr(d);
    for (word_at = sp - STACK_WORDS; *word_at == STACK_COLOUR; word_at++) {
    }
    return (uint32_t)(sp - word_at) * 4u;
}

/* The control step alone, on a copy. */
static void step(ht_drive *d)
{
    ht_compare out;
    ht_control_step(&d->config->control, &d->control, &d->in, false, &out);
}

static void bind(uint16_t device)
{
    ht_port_bind(&port, NULL, ht_board_of_device(device));
    *word(port.map->gpio_data) = 0xFFFFu; /* no pin is low */
    *word(port.map->gpio_data + 1u) = 0xFFFFu;
}

static int profile(int32_t states)
{
    uint32_t n;
    for (n = 0u; n < SAMPLES; n++) {
        read_all(states, &now, (uint32_t)sizeof now);
        bind((uint16_t)(now.inputs[PERIOD_WORDS - 1u] / 2u));
        port.shadow = now.drive.config->control.shadow;
        latch(now.inputs);
        ht_drive_fast_isr(&now.drive);
        profile_end();
    }
    return EXIT_OK;
}

static int count(int32_t trace, int32_t counts, int32_t states)
{
    static sample before;
    static ht_params params;
    static float channels[CHANNELS_MAX];
    uint16_t head[4];
    uint32_t periods;
    uint32_t period;
    uint32_t every;
    uint32_t row[5];
    read_all(trace, head, (uint32_t)sizeof head);
    periods = head[2] | ((uint32_t)head[3] << 16);
    every = periods / (2u * SAMPLES);
    if ((head[1] != (uint16_t)HT_PARAMS) || (every == 0u)) {
        return EXIT_FILE;
    }
    read_all(trace, params.v, (uint32_t)sizeof params.v);
    bind(head[0]);
    if (ht_drive_init(&now.drive, &port, &params) != HT_OK) {
        return EXIT_REFUSED;
    }
    (void)ht_drive_start(&now.drive);
    settle();
    (void)ticks(empty_isr, &now.drive);
    row[0] = ticks(empty_isr, &now.drive);
    write_all(counts, row, (uint32_t)sizeof row[0]);
    for (period = 0u; period < periods; period++) {
        read_all(trace, now.inputs, (uint32_t)sizeof now.inputs);
        latch(now.inputs);
        before = now;
        row[4] = stack_of(ht_drive_fast_isr, &before.drive);
        before = now;
        row[0] = ticks(ht_drive_fast_isr, &now.drive);
        row[1] = 0u;
        row[2] = 0u;
        row[3] = now.drive.state;
        settle();
        if (((period + 1u) % every == 0u) && (period >= (periods - every * SAMPLES))) {
            before.inputs[PERIOD_WORDS - 1u] = (uint16_t)(head[0] * 2u); /* the device */
            write_all(states, &before, (uint32_t)sizeof before);
        }
        if (before.drive.state == (uint16_t)HT_STATE_RUN) {
            before.drive.in = now.drive.in;
            row[1] = ticks(step, &before.drive);
        }
        if (now.inputs[PERIOD_WORDS - 1u] != 0u) {
            row[2] = ticks(ht_drive_slow_isr, &now.drive);
        }
        write_all(counts, row, (uint32_t)sizeof row);
    }
    ht_channels_read(&now.drive, channels);
    write_all(counts, channels, ht_channel_count() * (uint32_t)sizeof channels[0]);
    if (now.drive.state != (uint16_t)HT_STATE_RUN) {
        return EXIT_NOT_RUNNING;
    }
    /* The rest of the drive belongs into the image, for the look at its stack. */
    (void)ht_drive_set(&now.drive, HT_P_speed_ref_rpm, 0.0f);
    ht_drive_stop(&now.drive);
    (void)ht_drive_clear(&now.drive);
    return EXIT_OK;
}

int main(void)
{
    int32_t trace = semihost_open("trace", SEMIHOST_READ);
    SYST_RVR = SYST_MASK;
    SYST_CVR = 0u;
    SYST_CSR = 5u; /* on, processor clock, no interrupt */
    if (semihost_open("profile", SEMIHOST_READ) >= 0) {
        return profile(semihost_open("states", SEMIHOST_READ));
    }
    return count(trace, semihost_open("counts", SEMIHOST_WRITE),
                 semihost_open("states", SEMIHOST_WRITE));
}
