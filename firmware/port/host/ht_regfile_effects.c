/* Register model: what particular registers do besides holding a value. */
#include "ht_regfile_model.h"

#define LOOKS_TO_LOCK 3u /* any number: a driver has to wait */
#define SCI_RUNS 0x0020u /* SCICTL1.SWRESET */

static void order(ht_regfile *rf, uint32_t addr, uint32_t value, const char *why)
{
    ht_model_violation(rf, addr, value, HT_REG_ORDER, why);
}

/* --- clocks ------------------------------------------------------------------------------ */

#define INTERNAL_HZ 10.0e6f     /* both internal oscillators of the F28377S */
#define UNTRIMMED 0.9f          /* of them before Device_cal: outside 3 % */
#define CYCLES_PER_ACCESS 20.0f /* what counters see of the time that a driver takes */

/* The crystal's frequency, unless another one is planted. */
static float crystal_Hz(ht_regfile *rf)
{
    const ht_chip *chip = rf->chip;
    uint32_t multiplier = ht_model_peek(rf, chip->pll_multiplier, 16u);
    float usual = chip->crystal_Hz;
    if (!(usual > 0.0f)) {
        usual = (multiplier != 0u) ? (chip->crystal_pll_Hz / (float)multiplier)
                                   : chip->first_crystal_Hz;
    }
    return (rf->no_crystal != 0u) ? 0.0f : ((rf->crystal_Hz > 0.0f) ? rf->crystal_Hz : usual);
}

static float system_Hz(ht_regfile *rf)
{
    float clock = crystal_Hz(rf);
    uint32_t n;
    if (rf->chip->internal_oscillators == 0u) {
        uint32_t status = ht_model_peek(rf, 0x7011u, 16u);
        static const float divisor[] = {4.0f, 4.0f, 2.0f, 1.0f};
        n = ht_model_peek(rf, 0x7021u, 16u);
        if (((status & 1u) != 0u) && (n != 0u)) {
            clock *= (float)n * rf->pll_share;
        }
        return clock / divisor[(status >> 7) & 3u];
    }
    if (((ht_model_peek(rf, 0x5D208u, 32u) & 3u) != 1u) || (rf->no_crystal != 0u)) {
        clock = INTERNAL_HZ;
    }
    if (((ht_model_peek(rf, 0x5D20Eu, 32u) & 2u) != 0u)
        && ((ht_model_peek(rf, 0x5D22Eu, 32u) & 1u) == 0u)) {
        clock *= (float)ht_model_peek(rf, 0x5D214u, 32u) * rf->pll_share;
    }
    n = ht_model_peek(rf, 0x5D222u, 32u);
    return (n == 0u) ? clock : (clock / (2.0f * (float)n));
}

/* The clock of CPU timer 1 (index 0) or 2. */
static float counted_Hz(ht_regfile *rf, uint16_t index)
{
    uint32_t source = ((index == 1u) && (rf->chip->internal_oscillators != 0u))
                          ? (ht_model_peek(rf, 0x5D37Cu, 32u) & 7u)
                          : 0u;
    if (source == 3u) {
        return crystal_Hz(rf);
    }
    return (source == 0u) ? system_Hz(rf)
                          : INTERNAL_HZ * ((rf->device_calibrated != 0u) ? 1.0f : UNTRIMMED);
}

/* Counts since it was started. */
static float counted(ht_regfile *rf, uint16_t index)
{
    float cycles = (float)(rf->accesses - rf->timer_at[index]) * CYCLES_PER_ACCESS;
    return (rf->timer_at[index] == 0u) ? 0.0f : (cycles / system_Hz(rf) * counted_Hz(rf, index));
}

static uint32_t timer_value(ht_regfile *rf, const ht_bound *b, uint32_t value)
{
    uint16_t index = (uint16_t)(b->number - 1u);
    float counts = counted(rf, index);
    return (counts < (float)value) ? (value - (uint32_t)counts) : 0u;
}

static uint32_t timer_flag(ht_regfile *rf, const ht_bound *b, uint32_t value)
{
    uint16_t index = (uint16_t)(b->number - 1u);
    float first = (float)ht_model_peek(rf, b->base, 32u);
    return value | (((rf->timer_at[index] != 0u) && (counted(rf, index) > first)) ? 0x8000u : 0u);
}

static uint32_t timer_control(ht_regfile *rf, const ht_bound *b, uint32_t old, uint32_t value)
{
    uint16_t index = (uint16_t)(b->number - 1u);
    uint32_t flag = timer_flag(rf, b, old) & ~value & 0x8000u;
    uint32_t now = timer_value(rf, b, ht_model_peek(rf, b->base, 32u));
    rf->timer1 = (index == 0u) ? 0u : rf->timer1; /* each start, each reload */
    rf->timer_at[index] = ((value & 0x0010u) != 0u) ? 0u : rf->accesses;
    if ((value & 0x0020u) != 0u) {
        now = ht_model_peek(rf, b->base + 2u, 32u);
    }
    ht_model_poke(rf, b->base, 32u, now);
    return (value & 0x4C10u) | flag;
}

/* eCAP1 as a PWM generator: its output is high below the compare value, and after the end of a
 * period until the compare value is passed; a counter that jumps over it leaves the output high. */
static uint16_t generates(ht_regfile *rf)
{
    uint32_t ecap = rf->chip->ecap;
    return ((ecap != 0u) && (ht_model_clocked(rf, ecap) != 0u)
            && ((ht_model_peek(rf, ecap + 0x15u, 16u) & 0x0210u) == 0x0210u))
               ? 1u
               : 0u;
}

void ht_model_ecap_written(ht_regfile *rf)
{
    uint32_t ecap = rf->chip->ecap;
    if (generates(rf) == 0u) {
        rf->ecap_high = 0u;
    } else if (ht_model_peek(rf, ecap, 32u) < ht_model_peek(rf, ecap + 6u, 32u)) {
        rf->ecap_high = 1u;
        ht_model_ecap_out(rf);
    } else {
        /* as it was */
    }
}

static void ecap_counts(ht_regfile *rf, uint32_t clocks)
{
    uint32_t ecap = rf->chip->ecap;
    uint32_t compare;
    uint32_t period;
    uint32_t before;
    uint32_t now;
    if (generates(rf) == 0u) {
        return;
    }
    period = ht_model_peek(rf, ecap + 4u, 32u) + 1u;
    compare = ht_model_peek(rf, ecap + 6u, 32u);
    before = ht_model_peek(rf, ecap, 32u);
    now = before + clocks;
    if (now >= period) {
        rf->word[ecap + 0x17u] |= 0x0040u; /* CTR_PRD */
        rf->ecap_high = 1u;
        ht_model_ecap_out(rf);
        before = 0u;
        now %= period;
    }
    if ((before < compare) && (now >= compare)) {
        rf->ecap_high = 0u;
    }
    ht_model_poke(rf, ecap, 32u, now);
}

static void timer1_counts(ht_regfile *rf, uint32_t clocks)
{
    uint32_t control = ht_model_peek(rf, 0x0C0Cu, 16u);
    uint32_t last = ht_model_peek(rf, 0x0C0Au, 32u);
    if ((ht_model_clocked(rf, 0x0C0Cu) == 0u) || ((control & 0x0010u) != 0u)) {
        return;
    }
    rf->timer1 += clocks;
    if (rf->timer1 > last) {
        rf->timer1 %= last + 1u;
        ht_model_poke(rf, 0x0C0Cu, 16u, control | 0x8000u);
        if ((control & 0x4000u) != 0u) {
            rf->int13 = 1u;
        }
    }
}

uint16_t ht_regfile_pass(ht_regfile *rf, uint32_t clocks)
{
    ecap_counts(rf, clocks);
    timer1_counts(rf, clocks);
    ht_model_serve(rf);
    return rf->int13;
}

/* Missing clock: shows at once, and again unless another source has been chosen. */
static uint32_t mcdcr(ht_regfile *rf, uint32_t old, uint32_t value)
{
    uint32_t missing = (((value & 2u) != 0u) ? 0u : (old & 1u));
    if (((ht_model_peek(rf, 0x5D208u, 32u) & 3u) == 1u) && (rf->no_crystal != 0u)) {
        missing = 1u;
    }
    return (value & 0x000Cu) | missing;
}

static void lock_at_last(ht_regfile *rf)
{
    rf->pll_share = 1.0f;
    if (rf->wrong_locks != 0u) {
        rf->wrong_locks--;
        rf->pll_share = (float)rf->wrong_percent * 0.01f;
    }
}

/* Counters stop: what the outputs do then, they do for good. Counters start: from now on ePWM1
 * starts conversions. */
static void check_sync(ht_regfile *rf, uint32_t addr, uint32_t old, uint32_t value)
{
    uint32_t bit = (uint32_t)1u << rf->chip->sync_bit;
    if ((addr == rf->chip->sync) && ((old & ~value & bit) != 0u)) { /* they stop */
        ht_model_check_off(rf, addr, value, "the PWM counters stop with a gate on");
    }
    if ((addr == rf->chip->sync) && ((value & ~old & bit) != 0u) && (rf->powered != 0u)
        && ((rf->time_us - rf->powered_us) < rf->chip->adc_settle_us)) {
        order(rf, addr, value, "the ADC has not settled yet");
    }
}

static uint32_t pllsts(ht_regfile *rf, uint32_t addr, uint32_t old, uint32_t value)
{
    if (((value & 0x0180u) != 0u) && ((old & 0x0001u) == 0u)) {
        order(rf, addr, value, "divider before the PLL has locked");
    }
    return (old & ~(uint32_t)0x01F4u) | (value & 0x01F4u);
}

static uint32_t pllcr(ht_regfile *rf, uint32_t addr, uint32_t old, uint32_t value)
{
    uint32_t status = ht_model_peek(rf, 0x7011u, 16u);
    ht_model_check_off(rf, addr, value, "the clock changes with a gate on");
    if ((status & 0x0180u) != 0u) {
        order(rf, addr, value, "PLLCR with DIVSEL not 0");
        return old;
    }
    if ((status & 0x0040u) == 0u) {
        order(rf, addr, value, "PLLCR with the missing-clock detection on");
    }
    if (value != old) {
        ht_model_poke(rf, 0x7011u, 16u, status & ~(uint32_t)0x0001u);
        rf->looks = LOOKS_TO_LOCK;
    }
    return value & 0x000Fu;
}

/* One look at a lock flag (bit 0). */
static uint32_t look(ht_regfile *rf, uint32_t addr, uint16_t bits, uint32_t value)
{
    if ((rf->looks != 0u) && (rf->never_locks == 0u)) {
        rf->looks--;
        if (rf->looks == 0u) {
            rf->locks++;
            lock_at_last(rf);
            value |= 1u;
            ht_model_poke(rf, addr, bits, value);
        }
    }
    return value;
}

static uint32_t pllctl(ht_regfile *rf, uint32_t addr, uint32_t old, uint32_t value)
{
    if (((value & ~old & 2u) != 0u) && ((ht_model_peek(rf, 0x5D216u, 32u) & 1u) == 0u)) {
        order(rf, addr, value, "PLL selected before it has locked");
    }
    if (((old & ~value & 1u) != 0u) && ((old & 2u) != 0u)) {
        order(rf, addr, value, "PLL stopped while selected");
    }
    if ((value & 1u) == 0u) {
        ht_model_poke(rf, 0x5D216u, 32u, 0u);
    }
    return value & 3u;
}

static uint32_t pllmult(ht_regfile *rf, uint32_t addr, uint32_t value)
{
    uint32_t control = ht_model_peek(rf, 0x5D20Eu, 32u);
    ht_model_check_off(rf, addr, value, "the clock changes with a gate on");
    if ((control & 2u) != 0u) {
        order(rf, addr, value, "multiplier changed while the PLL is selected");
    }
    ht_model_poke(rf, 0x5D20Eu, 32u, control | 1u); /* the write starts the PLL */
    ht_model_poke(rf, 0x5D216u, 32u, 0u);
    rf->looks = LOOKS_TO_LOCK;
    return value & 0x037Fu;
}

static uint32_t oscsel(ht_regfile *rf, uint32_t addr, uint32_t old, uint32_t value)
{
    if ((((value ^ old) & 3u) != 0u) && ((ht_model_peek(rf, 0x5D20Eu, 32u) & 2u) != 0u)) {
        order(rf, addr, value, "clock source changed while the PLL is selected");
    }
    if (((value & 3u) == 1u) && ((value & 0x10u) != 0u)) {
        order(rf, addr, value, "crystal selected but off");
    }
    if (((value & 3u) == 1u) && (rf->no_crystal != 0u)) {
        ht_model_poke(rf, 0x5D22Eu, 32u, ht_model_peek(rf, 0x5D22Eu, 32u) | 1u);
    }
    return value & 0x003Bu;
}

/* --- watchdog ------------------------------------------------------------------------------ */

#define COUNTS 256.0f

static void watch(ht_regfile *rf)
{
    uint32_t control = ht_model_peek(rf, 0x7029u, 16u);
    uint32_t wdps = control & 7u;
    float prescaler = (wdps < 2u) ? 1.0f : (float)((uint32_t)1u << (wdps - 1u));
    float limit_us = COUNTS * prescaler / rf->chip->watchdog_Hz * 1.0e6f;
    if ((control & 0x40u) != 0u) {
        rf->dog_us = rf->time_us; /* off */
    } else if ((float)(rf->time_us - rf->dog_us) > limit_us) {
        ht_model_violation(rf, 0x7023u, 0u, HT_REG_WATCHDOG, "not serviced in time");
        rf->dog_resets++;
        rf->dog_us = rf->time_us;
    } else {
        /* in time */
    }
}

static uint32_t wdcntr(ht_regfile *rf)
{
    uint32_t wdps = ht_model_peek(rf, 0x7029u, 16u) & 7u;
    float prescaler = (wdps < 2u) ? 1.0f : (float)((uint32_t)1u << (wdps - 1u));
    float clock = (rf->chip->internal_oscillators != 0u) ? INTERNAL_HZ : crystal_Hz(rf);
    float counts = (float)rf->accesses * CYCLES_PER_ACCESS / system_Hz(rf) * clock
                   / (512.0f * prescaler);
    return (uint32_t)counts & 0x00FFu;
}

static uint32_t wdkey(ht_regfile *rf, uint32_t addr, uint32_t value)
{
    if (value == 0x55u) {
        rf->dog_armed = 1u;
    } else if (value == 0xAAu) {
        if (rf->dog_armed != 0u) {
            rf->dog_us = rf->time_us;
            rf->dog_services++;
        }
        rf->dog_armed = 0u;
    } else {
        ht_model_violation(rf, addr, value, HT_REG_KEY, "neither 0x55 nor 0xAA");
        rf->dog_armed = 0u;
    }
    return 0u;
}

static uint32_t wdcr(ht_regfile *rf, uint32_t addr, uint32_t old, uint32_t value)
{
    if ((value & 0x38u) != 0x28u) {
        ht_model_violation(rf, addr, value, HT_REG_KEY, "WDCHK is not 101: resets the chip");
        rf->dog_resets++;
    }
    return (value & 0x47u) | (old & ~value & 0x80u); /* WDCHK reads 0; a one clears WDFLAG */
}

void ht_regfile_wait(ht_regfile *rf, uint16_t us)
{
    rf->time_us += us;
    (void)ht_regfile_pass(rf, (uint32_t)((float)us * 1.0e-6f * system_Hz(rf)));
    watch(rf);
}

void ht_regfile_busy(ht_regfile *rf, uint16_t us)
{
    ht_model_check_off(rf, 0u, us, "waiting with a gate on");
    ht_regfile_wait(rf, us);
}

/* --- flash, pins ------------------------------------------------------------------------------ */

static uint32_t pump(ht_regfile *rf, uint32_t addr, uint32_t old, uint32_t value)
{
    if ((value >> 16) != 0x5A5Au) {
        ht_model_violation(rf, addr, value, HT_REG_KEY, "pump semaphore: 0x5A5A is missing");
        return old;
    }
    return value & 3u;
}

static uint32_t flash(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t old,
                      uint32_t value)
{
    if (ht_model_peek(rf, 0x50024u, 32u) != 2u) {
        order(rf, addr, value, "the flash pump is not bank 0's");
    }
    if ((b->reg->what == HT_FX_RWAIT) && (ht_model_peek(rf, 0x5F980u, 32u) != 0u)) {
        order(rf, addr, value, "wait states changed with cache or prefetch on");
    }
    return (old & ~b->reg->writable) | (value & b->reg->writable);
}

static uint32_t mux(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t old, uint32_t value)
{
    uint32_t first = ((b->base - rf->chip->gpio) / rf->chip->gpio_stride) * 32u
                     + (((b->reg->offset & 2u) != 0u) ? 0u : 16u); /* MUX1 at 6, MUX2 at 8 */
    uint32_t group = (rf->chip->pin_groups != 0u)
                         ? ht_model_peek(rf, b->base + b->reg->offset + 0x1Au, 32u)
                         : 0u;
    uint32_t n;
    for (n = 0u; n < 16u; n++) {
        uint32_t to = (value >> (2u * n)) & 3u;
        if (to != ((old >> (2u * n)) & 3u)) {
            int32_t module =
                ht_model_module_of(rf, first + n, (((group >> (2u * n)) & 3u) << 2) | to);
            if ((to != 0u) && (module >= 0)) {
                ht_model_check_pin(rf, addr, value, module);
            }
        }
    }
    return value;
}

static uint32_t gmux(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t old, uint32_t value)
{
    uint32_t now = ht_model_peek(rf, b->base + b->reg->offset - 0x1Au, 32u);
    uint32_t n;
    for (n = 0u; n < 16u; n++) {
        uint32_t field = (uint32_t)3u << (2u * n);
        if ((((value ^ old) & field) != 0u) && ((now & field) != 0u)) {
            order(rf, addr, value, "pin group changed under a peripheral");
        }
    }
    return value;
}

/* --- ADC ------------------------------------------------------------------------------ */

static void power(ht_regfile *rf, uint32_t addr, uint32_t value, uint32_t on)
{
    uint16_t one = (addr == 0x7480u) ? 2u : 1u; /* ADC-B or the first */
    if ((on != 0u) && ((rf->powered & one) == 0u)) {
        rf->powered_us = rf->time_us;
        if ((rf->calibrated & one) == 0u) {
            order(rf, addr, value, "ADC powered up without calibration");
        }
        if ((rf->chip->device_cal != 0u) && (rf->device_calibrated == 0u)) {
            order(rf, addr, value, "ADC powered up without Device_cal");
        }
    }
    rf->powered = (uint16_t)((rf->powered & (uint16_t)~one) | ((on != 0u) ? one : 0u));
}

static uint32_t adctrl2(ht_regfile *rf, uint32_t value)
{
    if ((value & 0x4000u) != 0u) {
        rf->stands = 0u;
    }
    return value & 0xADADu; /* the resets of the sequencers read 0 */
}

/* A chip without the function has 0 for its address. */
static uint16_t calls(uint32_t addr, uint32_t function)
{
    return ((function != 0u) && (addr == function)) ? 1u : 0u;
}

uint16_t ht_regfile_call(ht_regfile *rf, uint32_t addr, uint16_t argument)
{
    const ht_chip *chip = rf->chip;
    uint16_t result = 0u;
    if (calls(addr, chip->adc_cal) != 0u) {
        if (ht_model_clocked(rf, 0x7100u) == 0u) {
            ht_model_violation(rf, addr, 0u, HT_REG_UNCLOCKED, "calibration without ADC clock");
        } else {
            ht_model_poke(rf, 0x711Cu, 16u, 0x4000u);
            ht_model_poke(rf, 0x711Du, 16u, 0x0003u);
            rf->calibrated = 1u;
        }
    } else if (calls(addr, chip->device_cal) != 0u) {
        if ((rf->eallow == 0u) || (ht_model_clocked(rf, 0x7400u) == 0u)
            || (ht_model_clocked(rf, 0x7480u) == 0u)) {
            ht_model_violation(rf, addr, 0u, HT_REG_NO_EALLOW,
                               "Device_cal without EALLOW or ADC clocks");
        } else {
            rf->device_calibrated = 1u;
            rf->eallow = 0u; /* whether TI's code leaves it on is not known */
        }
    } else if ((calls(addr, chip->linearity_trim[0]) | calls(addr, chip->linearity_trim[1]))
               != 0u) {
        uint32_t adc = (addr == chip->linearity_trim[0]) ? 0x7400u : 0x7480u;
        if ((rf->eallow == 0u) || (ht_model_clocked(rf, adc) == 0u)) {
            ht_model_violation(rf, addr, 0u, HT_REG_NO_EALLOW, "trim without EALLOW or ADC clock");
        } else {
            uint16_t n;
            for (n = 0u; n < 6u; n++) {
                ht_model_poke(rf, adc + 0x70u + 2u * (uint32_t)n, 32u, 0x00010001u * (n + 1u));
            }
            rf->calibrated |= (adc == 0x7400u) ? 1u : 2u;
        }
    } else if (calls(addr, chip->offset_trim) != 0u) {
        result = (uint16_t)(0x0025u + argument);
    } else {
        ht_model_violation(rf, addr, argument, HT_REG_HOLE, "no function of TI's there");
    }
    return result;
}

/* --- SCI ------------------------------------------------------------------------------ */

static uint32_t sci_format(ht_regfile *rf, uint32_t addr, uint32_t value)
{
    if ((ht_model_peek(rf, rf->chip->sci + 1u, 16u) & SCI_RUNS) != 0u) {
        order(rf, addr, value, "changed while the SCI runs");
    }
    return value & 0x00FFu;
}

static void sci_transmit(ht_regfile *rf, uint32_t addr, uint32_t value)
{
    if (rf->sci_out_count >= HT_REGFILE_FIFO) {
        order(rf, addr, value, "transmit FIFO is full");
    } else {
        rf->sci_out[rf->sci_out_count] = (uint16_t)(value & 0x00FFu);
        rf->sci_out_count++;
    }
}

static uint16_t first_out(uint16_t *fifo, uint16_t *count)
{
    uint16_t octet = 0xFFFFu;
    if (*count != 0u) {
        uint16_t n;
        octet = fifo[0];
        for (n = 1u; n < *count; n++) {
            fifo[n - 1u] = fifo[n];
        }
        (*count)--;
    }
    return octet;
}

uint16_t ht_regfile_sci_leave(ht_regfile *rf)
{
    return first_out(rf->sci_out, &rf->sci_out_count);
}

uint16_t ht_regfile_sci_arrive(ht_regfile *rf, uint16_t octet)
{
    uint32_t control = ht_model_peek(rf, rf->chip->sci + 1u, 16u);
    uint32_t fifo = ht_model_peek(rf, rf->chip->sci + 0xBu, 16u);
    uint32_t error = ht_model_peek(rf, rf->chip->sci + 5u, 16u) & 0x0080u;
    if (((control & 0x0021u) != 0x0021u) || ((fifo & 0x2000u) == 0u) || (error != 0u)) {
        return 0u;
    }
    if (rf->sci_in_count >= HT_REGFILE_FIFO) {
        ht_model_poke(rf, rf->chip->sci + 0xBu, 16u, fifo | 0x8000u);
        return 0u;
    }
    rf->sci_in[rf->sci_in_count] = octet;
    rf->sci_in_count++;
    return 1u;
}

/* --- dispatch ------------------------------------------------------------------------------ */

uint32_t ht_model_written(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t old,
                          uint32_t value)
{
    uint32_t plain = (old & ~b->reg->writable) | (value & b->reg->writable);
    switch (b->reg->what) {
    case HT_FX_CLOCKS:
        check_sync(rf, addr, old, value);
        return plain;
    case HT_FX_WDKEY:
        return wdkey(rf, addr, value);
    case HT_FX_WDCR:
        return wdcr(rf, addr, old, value);
    case HT_FX_PLLSTS:
        return pllsts(rf, addr, old, value);
    case HT_FX_PLLCR:
        return pllcr(rf, addr, old, value);
    case HT_FX_OSCSEL:
        return oscsel(rf, addr, old, value);
    case HT_FX_PLLCTL:
        return pllctl(rf, addr, old, value);
    case HT_FX_PLLMULT:
        return pllmult(rf, addr, value);
    case HT_FX_PUMP:
        return pump(rf, addr, old, value);
    case HT_FX_FLASH:
    case HT_FX_RWAIT:
        return flash(rf, b, addr, old, value);
    case HT_FX_MUX:
        return mux(rf, b, addr, old, value);
    case HT_FX_GMUX:
        return gmux(rf, b, addr, old, value);
    case HT_FX_ADCTRL2:
        return adctrl2(rf, value);
    case HT_FX_ADCTRL3:
        power(rf, addr, value, (uint32_t)((value & 0x00E0u) == 0x00E0u));
        return plain;
    case HT_FX_ADCCTL1:
        power(rf, addr, value, (value >> 7) & 1u);
        return plain;
    case HT_FX_ADCST: /* bits 4 and 5 clear 0 and 1 */
        return old & ~((value >> 4) & 3u);
    case HT_FX_MCDCR:
        return mcdcr(rf, old, value);
    case HT_FX_COUNTING:
        return timer_control(rf, b, old, value);
    case HT_FX_QCAPCTL:
        if (((old & 0x8000u) != 0u) && (((old ^ value) & 0x007Fu) != 0u)) {
            order(rf, addr, value, "prescaler changed while the capture unit runs");
        }
        return plain;
    case HT_FX_TCR: /* TIF is cleared by 1, TRB reloads and reads 0 */
        if ((value & 0x0020u) != 0u) {
            ht_model_poke(rf, b->base, 32u, ht_model_peek(rf, b->base + 2u, 32u));
        }
        return (value & 0x4C10u) | (old & ~value & 0x8000u);
    case HT_FX_SCIFORMAT:
        return sci_format(rf, addr, value);
    case HT_FX_SCICTL1: /* the software reset clears the receiver's flags */
        if ((plain & SCI_RUNS) == 0u) {
            ht_model_poke(rf, rf->chip->sci + 5u, 16u, 0u);
        }
        return plain;
    case HT_FX_SCITXBUF:
        sci_transmit(rf, addr, value);
        return value & 0x00FFu;
    case HT_FX_SCIFFTX: /* a FIFO in reset is empty; the levels are counted */
        rf->sci_out_count = ((value & 0x2000u) != 0u) ? rf->sci_out_count : 0u;
        return value & 0xE03Fu;
    case HT_FX_SCIFFRX: /* RXFFOVF is cleared by RXFFOVRCLR */
        rf->sci_in_count = ((value & 0x2000u) != 0u) ? rf->sci_in_count : 0u;
        return (value & 0x203Fu) | (((value & 0x4000u) != 0u) ? 0u : (old & 0x8000u));
    default:
        return plain;
    }
}

uint32_t ht_model_read(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t value)
{
    uint32_t result = value;
    switch (b->reg->what) {
    case HT_FX_PLLSTS:
        result = look(rf, addr, 16u, value);
        break;
    case HT_FX_PLLLOCK:
        result = look(rf, addr, 32u, value) | ((rf->slips != 0u) ? 2u : 0u);
        break;
    case HT_FX_WDCNTR:
        result = wdcntr(rf);
        break;
    case HT_FX_COUNTING:
        result = timer_flag(rf, b, value);
        break;
    case HT_FX_COUNT:
        result = timer_value(rf, b, value);
        break;
    case HT_FX_SCIRXBUF:
        result = first_out(rf->sci_in, &rf->sci_in_count) & 0x00FFu;
        break;
    case HT_FX_SCIFFTX:
        result = value | ((uint32_t)rf->sci_out_count << 8);
        break;
    case HT_FX_SCIFFRX:
        result = value | ((uint32_t)rf->sci_in_count << 8);
        break;
    default:
        break;
    }
    return result;
}
