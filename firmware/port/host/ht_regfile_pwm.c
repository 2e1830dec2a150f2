/* Register model: what stands between the PWM and the switches. Pins, dead band, trip zone,
 * and the level of the trip pin. */
#include "ht_regfile_model.h"

#define TZ_OST 0x0004u
#define OSHT1 0x0100u /* TZSEL: trip pin, clock failure, emulation stop */
#define OSHT5 0x1000u
#define OSHT6 0x2000u
#define TZSEL_DCAEVT1 0x4000u
#define TZ_DCAEVT1 0x0008u
/* F28377S: registers of the digital compare, and what the ePWM X-BAR makes of eCAP1 */
#define TZDCSEL 0x82u
#define TZOSTFLG 0x95u
#define OST_DCAEVT1 0x0040u
#define DCTRIPSEL 0xC0u
#define TRIP4MUX 0x7A00u
#define TRIP4ENABLE 0x7A20u
/* ... and of the comparators, whose high and low one come together at position 1 */
#define TZSEL_DCBEVT1 0x8000u
#define TZ_DCBEVT1 0x0020u
#define OST_DCBEVT1 0x0080u
#define TRIP5MUX 0x7A04u
#define TRIP5ENABLE 0x7A22u
#define CMPSS_WORDS 0x20u
#define COMPSTS 0x02u
#define HIGH_LATCH 0x0002u
#define LOW_LATCH 0x0200u
#define VDDA_V 3.3f
#define OUT_MODE 0x0003u /* DBCTL: both delays on, none bypassed */
#define MODULES 12u
#define PORT_PINS 32u
#define PORT_WORDS 8u

static void order(ht_regfile *rf, uint32_t addr, uint32_t value, const char *why)
{
    ht_model_violation(rf, addr, value, HT_REG_ORDER, why);
}

static uint32_t of_module(ht_regfile *rf, uint32_t base, uint16_t offset)
{
    return ht_model_peek(rf, base + offset, 16u);
}

/* --- pins of the modules -------------------------------------------------------------- */

int32_t ht_model_module_of(const ht_regfile *rf, uint32_t pin, uint32_t mux)
{
    if ((mux == 1u) && (pin < rf->chip->pwm_pins)) {
        return (int32_t)(pin / 2u);
    }
    if ((mux == 5u) && (pin >= 16u) && (pin < rf->chip->pwm_pins_group)) {
        return (int32_t)(pin / 2u);
    }
    return -1;
}

/* Position of a pin's multiplexer. */
static uint32_t position(ht_regfile *rf, uint32_t pin)
{
    uint32_t half = rf->chip->gpio + ((pin / PORT_PINS) * rf->chip->gpio_stride)
                    + (((pin % PORT_PINS) < 16u) ? 0u : 2u);
    uint32_t shift = 2u * (pin % 16u);
    uint32_t mux = (ht_model_peek(rf, half + 0x06u, 32u) >> shift) & 3u;
    if (rf->chip->pin_groups != 0u) {
        mux |= ((ht_model_peek(rf, half + 0x20u, 32u) >> shift) & 3u) << 2;
    }
    return mux;
}

/* Does a pin follow the module at `base`? All of them are on port A. */
static uint16_t has_pin(ht_regfile *rf, uint32_t base)
{
    int32_t module = (int32_t)((base - rf->chip->epwm) / rf->chip->epwm_stride);
    uint32_t pin;
    for (pin = 0u; pin < PORT_PINS; pin++) {
        if (ht_model_module_of(rf, pin, position(rf, pin)) == module) {
            return 1u;
        }
    }
    return 0u;
}

/* --- what a module must have in place ---------------------------------------------------- */

static uint16_t without_dead_band(ht_regfile *rf, uint32_t base)
{
    uint32_t wanted = (rf->gates_active_low != 0u) ? 0x0007u : 0x000Bu; /* A or B inverted */
    return ((of_module(rf, base, rf->chip->dbctl) & 0x000Fu) != wanted) ? 1u : 0u;
}

static uint16_t without_dead_time(ht_regfile *rf, uint32_t base)
{
    return ((of_module(rf, base, rf->chip->dbred) == 0u)
            || (of_module(rf, base, rf->chip->dbfed) == 0u))
               ? 1u
               : 0u;
}

/** 1 if the event is selected as a trip, but its action, from bit `shift` on, does not switch off. */
static uint32_t event_leaves_on(ht_regfile *rf, uint32_t base, uint32_t select, uint32_t shift,
                                uint32_t off)
{
    return ((of_module(rf, base, rf->chip->tzsel) & select) != 0u)
           && (((of_module(rf, base, rf->chip->tzctl) >> shift) & 3u) != (off & 3u));
}

void ht_model_check_pin(ht_regfile *rf, uint32_t addr, uint32_t value, int32_t module)
{
    uint32_t base = rf->chip->epwm + (uint32_t)module * rf->chip->epwm_stride;
    uint32_t off = (rf->gates_active_low != 0u) ? 0x0005u : 0x000Au; /* both high, both low */
    if (ht_model_clocked(rf, base) == 0u) {
        order(rf, addr, value, "pin to a PWM module without clock");
    } else if ((of_module(rf, base, rf->chip->tzflg) & TZ_OST) == 0u) {
        order(rf, addr, value, "pin to a PWM module that is not tripped");
    } else if ((of_module(rf, base, rf->chip->tzctl) & 0x000Fu) != off) {
        order(rf, addr, value, "pin to a PWM module whose trip does not switch off");
    } else if (event_leaves_on(rf, base, TZSEL_DCAEVT1, 4u, off) != 0u) {
        order(rf, addr, value, "pin to a PWM module whose digital compare does not switch off");
    } else if (event_leaves_on(rf, base, TZSEL_DCBEVT1, 8u, off) != 0u) {
        order(rf, addr, value, "pin to a PWM module whose comparators do not switch off");
    } else if (without_dead_band(rf, base) != 0u) {
        order(rf, addr, value, "pin to a PWM module without dead band");
    } else if (without_dead_time(rf, base) != 0u) {
        order(rf, addr, value, "pin to a PWM module with DBRED or DBFED = 0");
    } else {
        /* safe */
    }
}

/* TZCTL while the counters run. A trip may switch both gates off. It may switch the lower one on if the
 * module is tripped already, and neither an upper one nor both. What the digital compares do stays. */
void ht_model_check_action(ht_regfile *rf, uint32_t base, uint32_t addr, uint32_t value)
{
    uint32_t off = (rf->gates_active_low != 0u) ? 0x0005u : 0x000Au;
    uint32_t lower = (rf->gates_active_low != 0u) ? 0x0009u : 0x0006u;
    uint32_t before = of_module(rf, base, rf->chip->tzctl);
    if (((value ^ before) & 0xFFF0u) != 0u) {
        order(rf, addr, value, "the digital compares' actions change while the PWM counters run");
    } else if ((value & 0x000Fu) == off) {
        /* safe */
    } else if ((value & 0x000Fu) != lower) {
        order(rf, addr, value, "a trip that switches an upper gate on, or lets one float");
    } else if ((of_module(rf, base, rf->chip->tzflg) & TZ_OST) == 0u) {
        order(rf, addr, value, "a trip that switches on, at a module that is not tripped");
    } else {
        /* safe */
    }
}

void ht_model_check_dead_time(ht_regfile *rf, uint32_t base, uint32_t addr, uint32_t value)
{
    uint32_t offset = addr - base;
    if (((offset != rf->chip->dbctl) && (offset != rf->chip->dbred) && (offset != rf->chip->dbfed))
        || (has_pin(rf, base) == 0u)) {
        return;
    }
    if (without_dead_band(rf, base) != 0u) {
        order(rf, addr, value, "no dead band at a module with pins");
    } else if (without_dead_time(rf, base) != 0u) {
        order(rf, addr, value, "DBRED or DBFED = 0 at a module with pins");
    } else {
        /* safe */
    }
}

void ht_model_check_off(ht_regfile *rf, uint32_t addr, uint32_t value, const char *why)
{
    uint32_t n;
    for (n = 0u; n < MODULES; n++) {
        uint32_t base = rf->chip->epwm + n * rf->chip->epwm_stride;
        if ((ht_model_clocked(rf, base) != 0u)
            && ((of_module(rf, base, rf->chip->tzflg) & TZ_OST) == 0u)
            && (has_pin(rf, base) != 0u)) {
            order(rf, addr, value, why);
            return;
        }
    }
}

/* --- trips ------------------------------------------------------------------------------ */

/* Level of the pin that the trip zone listens to. */
static uint16_t trip_pin_low(ht_regfile *rf)
{
    uint32_t pin = rf->chip->trip_pin;
    uint32_t data;
    if (rf->chip->trip_select != 0u) {
        pin = ht_model_peek(rf, rf->chip->trip_select, 16u);
    } else if (position(rf, pin) != 1u) {
        return 0u; /* its multiplexer does not make it the trip pin */
    } else {
        /* the fixed one */
    }
    data = rf->chip->gpio_data + ((pin / PORT_PINS) * PORT_WORDS);
    if (ht_regfile_word(rf, data) == 0) {
        return 0u;
    }
    return (((ht_model_peek(rf, data, 32u) >> (pin % PORT_PINS)) & 1u) == 0u) ? 1u : 0u;
}

/* One-shot trip of all modules whose TZSEL has the bit. */
static void trip(ht_regfile *rf, uint16_t source)
{
    uint32_t n;
    for (n = 0u; n < MODULES; n++) {
        uint32_t base = rf->chip->epwm + n * rf->chip->epwm_stride;
        if ((ht_model_clocked(rf, base) != 0u)
            && ((of_module(rf, base, rf->chip->tzsel) & source) != 0u)) {
            rf->word[base + rf->chip->tzflg] |= TZ_OST;
        }
    }
}

/* TRIP4 is high: the digital compare event DCAEVT1 of each module that listens to it. */
void ht_model_ecap_out(ht_regfile *rf)
{
    uint32_t n;
    if ((rf->ecap_high == 0u) || ((ht_model_peek(rf, TRIP4MUX, 32u) & 3u) != 3u)
        || ((ht_model_peek(rf, TRIP4ENABLE, 32u) & 1u) == 0u)) {
        return;
    }
    for (n = 0u; n < MODULES; n++) {
        uint32_t base = rf->chip->epwm + n * rf->chip->epwm_stride;
        if ((ht_model_clocked(rf, base) != 0u) && ((of_module(rf, base, DCTRIPSEL) & 0xFu) == 3u)
            && ((of_module(rf, base, TZDCSEL) & 7u) == 2u)) {
            rf->word[base + rf->chip->tzflg] |= TZ_DCAEVT1;
            if ((of_module(rf, base, rf->chip->tzsel) & TZSEL_DCAEVT1) != 0u) {
                rf->word[base + rf->chip->tzflg] |= TZ_OST;
                rf->word[base + TZOSTFLG] |= OST_DCAEVT1;
            }
        }
    }
}

/* --- comparators --------------------------------------------------------------------------- */

/* Does the X-BAR let a comparator through to TRIP5? */
static uint16_t trip5(ht_regfile *rf)
{
    uint32_t selected = ht_model_peek(rf, TRIP5MUX, 32u);
    uint32_t enabled = ht_model_peek(rf, TRIP5ENABLE, 32u);
    uint32_t n;
    for (n = 0u; n < HT_REGFILE_COMPARATORS; n++) {
        uint32_t position_of = (selected >> (4u * n)) & 3u;
        uint32_t heard = (position_of == 1u) ? 3u : ((position_of == 0u) ? 1u : 0u);
        if ((((enabled >> (2u * n)) & 1u) != 0u) && ((rf->trips[n] & heard) != 0u)) {
            return 1u;
        }
    }
    return 0u;
}

/* TRIP5 is high: the digital compare event DCBEVT1 of each module that listens to it. */
static void comparators_out(ht_regfile *rf)
{
    uint32_t n;
    if (rf->chip->cmpss == 0u) {
        return;
    }
    /* A latch that is cleared while its filter's output is high is set again. */
    for (n = 0u; n < HT_REGFILE_COMPARATORS; n++) {
        uint16_t latches = (uint16_t)((((rf->trips[n] & 1u) != 0u) ? HIGH_LATCH : 0u)
                                      | (((rf->trips[n] & 2u) != 0u) ? LOW_LATCH : 0u));
        rf->word[rf->chip->cmpss + n * CMPSS_WORDS + COMPSTS] |= latches;
    }
    if (trip5(rf) == 0u) {
        return;
    }
    for (n = 0u; n < MODULES; n++) {
        uint32_t base = rf->chip->epwm + n * rf->chip->epwm_stride;
        if ((ht_model_clocked(rf, base) != 0u)
            && (((of_module(rf, base, DCTRIPSEL) >> 8) & 0xFu) == 4u)
            && (((of_module(rf, base, TZDCSEL) >> 6) & 7u) == 2u)) {
            rf->word[base + rf->chip->tzflg] |= TZ_DCBEVT1;
            if ((of_module(rf, base, rf->chip->tzsel) & TZSEL_DCBEVT1) != 0u) {
                rf->word[base + rf->chip->tzflg] |= TZ_OST;
                rf->word[base + TZOSTFLG] |= OST_DCBEVT1;
            }
        }
    }
}

/* Time that a comparator's filter takes, ns: THRESH + 1 samples. A shorter excursion begins anew. */
static uint32_t filter_ns(ht_regfile *rf, uint32_t control)
{
    uint32_t samples = ((ht_model_peek(rf, control, 16u) >> 9) & 0x1Fu) + 1u;
    uint32_t clocks = (ht_model_peek(rf, control + 1u, 16u) & 0x03FFu) + 1u;
    return samples * clocks * 5u;
}

/* One comparator: 0 high, 1 low. */
static void compare(ht_regfile *rf, uint32_t n, uint32_t which, float volts, uint32_t ns)
{
    uint32_t base = rf->chip->cmpss + n * CMPSS_WORDS;
    uint32_t control = ht_model_peek(rf, base, 16u) >> (8u * which);
    float level_V = (float)ht_model_peek(rf, base + ((which == 0u) ? 0x06u : 0x12u), 16u) * VDDA_V
                    / 4096.0f;
    uint16_t inverted = (uint16_t)((control >> 1) & 1u);
    uint16_t above = (volts > level_V) ? 1u : 0u;
    uint16_t bit = (uint16_t)(1u << which);
    uint16_t passed = 0u;
    if ((above ^ inverted) == 0u) {
        rf->beyond_ns[n][which] = 0u;
    } else {
        rf->beyond_ns[n][which] += ns;
        if (((control >> 2) & 3u) == 2u) {
            uint32_t filter = base + ((which == 0u) ? 0x18u : 0x16u);
            passed = (rf->beyond_ns[n][which] >= filter_ns(rf, filter)) ? 1u : 0u;
        } else {
            passed = 1u;
        }
    }
    if (passed != 0u) {
        rf->trips[n] |= bit;
        rf->word[base + COMPSTS] |= (uint16_t)(1u << (8u * which));
    } else {
        rf->trips[n] &= (uint16_t)~bit;
        rf->word[base + COMPSTS] &= (uint16_t)~(1u << (8u * which));
    }
}

void ht_regfile_analog(ht_regfile *rf, uint16_t number, float volts, uint16_t ns)
{
    uint32_t n = (uint32_t)number - 1u;
    uint32_t base = rf->chip->cmpss + n * CMPSS_WORDS;
    if ((rf->chip->cmpss == 0u) || (n >= HT_REGFILE_COMPARATORS)
        || (ht_model_clocked(rf, base) == 0u) || ((ht_model_peek(rf, base, 16u) & 0x8000u) == 0u)) {
        return; /* the DACs do not run */
    }
    compare(rf, n, 0u, volts, ns);
    compare(rf, n, 1u, volts, ns);
    ht_regfile_pins(rf);
}

void ht_regfile_pins(ht_regfile *rf)
{
    ht_model_ecap_out(rf);
    comparators_out(rf);
    if (trip_pin_low(rf) != 0u) {
        trip(rf, OSHT1);
    }
}

void ht_regfile_pin(ht_regfile *rf, uint16_t gpio, uint16_t level)
{
    uint32_t data = rf->chip->gpio_data + ((gpio / PORT_PINS) * PORT_WORDS);
    uint32_t bit = (uint32_t)1u << (gpio % PORT_PINS);
    uint32_t levels = ht_model_peek(rf, data, 32u);
    ht_model_poke(rf, data, 32u, (level != 0u) ? (levels | bit) : (levels & ~bit));
    ht_regfile_pins(rf);
}

void ht_regfile_clock_fails(ht_regfile *rf)
{
    if (rf->chip->trips_without_pin != 0u) {
        trip(rf, OSHT5);
    }
}

void ht_regfile_emulation_stops(ht_regfile *rf)
{
    if (rf->chip->trips_without_pin != 0u) {
        trip(rf, OSHT6);
    }
}

void ht_model_check_clear(ht_regfile *rf, uint32_t base, uint32_t addr, uint32_t value)
{
    uint32_t off = (rf->gates_active_low != 0u) ? 0x0005u : 0x000Au; /* both high, both low */
    if ((value & TZ_OST) == 0u) {
        return;
    }
    if ((trip_pin_low(rf) != 0u) && ((of_module(rf, base, rf->chip->tzsel) & OSHT1) != 0u)) {
        order(rf, addr, value, "trip cleared while its pin is low");
    }
    if ((has_pin(rf, base) != 0u) && ((of_module(rf, base, rf->chip->tzctl) & 0x000Fu) != off)) {
        order(rf, addr, value, "trip cleared at a module whose trip does not switch off");
    }
    if ((has_pin(rf, base) != 0u) && (without_dead_band(rf, base) != 0u)) {
        order(rf, addr, value, "trip cleared at a module without dead band");
    } else if (((has_pin(rf, base) != 0u)
                || ((of_module(rf, base, rf->chip->dbctl) & OUT_MODE) == OUT_MODE))
               && (without_dead_time(rf, base) != 0u)) {
        order(rf, addr, value, "trip cleared with DBRED or DBFED = 0");
    } else {
        /* safe */
    }
}
