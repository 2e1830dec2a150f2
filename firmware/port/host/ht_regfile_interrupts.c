/* Register model: events of the hardware, and what the interrupt controller and the
 * CPU make of them. Both interrupts are in PIE group 1. */
#include "ht_regfile_model.h"

#define PIECTRL 0x0CE0u
#define PIEACK 0x0CE1u
#define PIEIER1 0x0CE2u
#define PIEIFR1 0x0CE3u
#define PIEVECT 0x0D00u
#define GROUP1 1u
#define VECTOR_1_1 32u
#define INT_1_1 0x0001u
#define INT_1_7 0x0040u
#define INT13 0x1000u
#define VECTOR_INT13 13u
#define TCR 0x0C04u

static void take(ht_regfile *rf, uint16_t n, uint16_t mask)
{
    void (*isr)(void) = rf->vector[n];
    uint16_t eallow = rf->eallow;
    uint16_t ier = rf->ier;
    if (isr == 0) {
        ht_model_violation(rf, PIEVECT + 2u * (uint32_t)n, 0u, HT_REG_ORDER,
                           "interrupt without a vector");
        return;
    }
    rf->depth++;
    rf->deepest = (rf->depth > rf->deepest) ? rf->depth : rf->deepest;
    /* The CPU saves what it changes on the way in and restores it on the way out. */
    rf->eallow = 0u;
    rf->intm = 1u;
    rf->ier = (uint16_t)(ier & (uint16_t)~mask);
    isr();
    rf->eallow = eallow;
    rf->ier = ier;
    rf->intm = 0u;
    rf->depth--;
}

/* CPU timer 1 goes past the interrupt controller. Group 1 comes first. */
static void serve_int13(ht_regfile *rf)
{
    if ((rf->int13 != 0u) && (rf->intm == 0u) && ((rf->ier & INT13) != 0u)) {
        rf->int13 = 0u;
        take(rf, VECTOR_INT13, INT13);
    }
}

void ht_model_serve(ht_regfile *rf)
{
    for (;;) {
        uint16_t pending = (uint16_t)(rf->word[PIEIFR1] & rf->word[PIEIER1]);
        uint16_t line = 0u;
        uint16_t bit = 1u;
        if ((pending == 0u) || (rf->intm != 0u) || ((rf->ier & GROUP1) == 0u)
            || ((rf->word[PIECTRL] & 1u) == 0u) || ((rf->word[PIEACK] & GROUP1) != 0u)) {
            serve_int13(rf);
            return;
        }
        while ((pending & bit) == 0u) {
            bit = (uint16_t)(bit << 1);
            line++;
        }
        rf->word[PIEIFR1] = (uint16_t)(rf->word[PIEIFR1] & (uint16_t)~bit);
        rf->word[PIEACK] |= GROUP1;
        take(rf, (uint16_t)(VECTOR_1_1 + line), GROUP1);
    }
}

static void request(ht_regfile *rf, uint16_t line)
{
    rf->word[PIEIFR1] |= line;
    ht_model_serve(rf);
}

/* Functions are numbered as they come: their addresses differ from run to run. */
static uint32_t number_of(ht_regfile *rf, void (*isr)(void))
{
    uint32_t n = 0u;
    while ((n < (HT_REGFILE_ISRS - 1u)) && (rf->isr[n] != 0) && (rf->isr[n] != isr)) {
        n++;
    }
    rf->isr[n] = isr;
    return n + 1u;
}

void ht_regfile_vector(ht_regfile *rf, uint32_t addr, void (*isr)(void))
{
    uint32_t n = (addr - PIEVECT) / 2u;
    ht_regfile_write32(rf, addr, number_of(rf, isr));
    if ((rf->eallow != 0u) && (addr >= PIEVECT) && (n < HT_REGFILE_VECTORS)) {
        rf->vector[n] = isr;
    }
}

void ht_regfile_intm(ht_regfile *rf, uint16_t masked)
{
    if ((masked == 0u) && (rf->acknowledged_at != 0u) && (rf->acknowledged_at == rf->accesses)) {
        ht_model_violation(rf, PIEACK, 0u, HT_REG_ORDER, "EINT right after PIEACK");
    }
    rf->intm = masked;
    ht_model_serve(rf);
}

void ht_regfile_ier(ht_regfile *rf, uint16_t mask)
{
    rf->ier = mask;
    ht_model_serve(rf);
}

void ht_regfile_ifr_clear(ht_regfile *rf)
{
    rf->int13 = 0u; /* between PIE and CPU nothing else is kept here */
}

void ht_regfile_idle(ht_regfile *rf)
{
    if (rf->idle != 0) {
        rf->idle(rf);
    }
}

void ht_regfile_end_of_sequence(ht_regfile *rf)
{
    uint32_t flag = rf->chip->adc_flag;
    uint32_t enabled;
    uint16_t blocked = (uint16_t)(rf->word[flag] & 1u); /* by a flag that is not cleared yet */
    if (rf->chip->sequencer != 0u) {                    /* ADCTRL2.INT_ENA_SEQ1 */
        enabled = rf->word[0x7101] & 0x0800u;
    } else { /* ADCINTSEL1N2: INT1E, INT1SEL = EOC3 */
        enabled = (uint32_t)((rf->word[0x7407] & 0x002Fu) == 0x0023u);
        if (blocked != 0u) {
            rf->word[0x7405] |= 1u; /* ADCINTOVF */
        }
        if ((rf->word[0x7407] & 0x0040u) != 0u) { /* INT1CONT */
            blocked = 0u;
        }
    }
    enabled = (rf->lost != 0u) ? 0u : enabled;
    rf->word[flag] |= 1u;
    rf->ended_at = rf->accesses;
    if ((enabled != 0u) && (blocked == 0u)) {
        request(rf, INT_1_1);
    }
}

/* Would ePWM1's SOCA start the conversion of seven channels and of the slow ones? */
static uint16_t armed(const ht_regfile *rf)
{
    uint16_t n;
    if (rf->chip->sequencer != 0u) { /* cascaded, 8 conversions, started by SOCA */
        return (uint16_t)(((rf->word[0x7100] & 0x0010u) != 0u) && (rf->word[0x7102] == 7u)
                          && ((rf->word[0x7101] & 0x0100u) != 0u));
    }
    for (n = 0u; n < 9u; n++) { /* ADC-A: SOC0..4, ADC-B: SOC0..3; TRIGSEL 5 */
        uint32_t soc = (n < 5u) ? (0x7411u + 2u * (uint32_t)n)
                                : (0x7491u + 2u * (uint32_t)(n - 5u));
        if (((rf->word[soc] >> 4) & 0x1Fu) != 5u) {
            return 0u;
        }
    }
    return (uint16_t)(rf->powered == 3u);
}

uint16_t ht_regfile_period(ht_regfile *rf)
{
    const ht_chip *chip = rf->chip;
    uint16_t etsel = rf->word[chip->epwm + chip->etsel];
    uint16_t etps = rf->word[chip->epwm + chip->etps];
    if ((ht_model_counting(rf) == 0u) || (ht_model_clocked(rf, chip->epwm) == 0u)
        || ((etsel & 0x0F00u) != 0x0900u) || ((etps & 0x0300u) != 0x0100u) || (rf->powered == 0u)
        || (armed(rf) == 0u)) {
        return 0u;
    }
    if (rf->stands != 0u) {
        ht_model_violation(rf, 0x7101u, 0u, HT_REG_ORDER, "sequencer started at its end");
    }
    rf->stands = rf->chip->sequencer;
    ht_regfile_end_of_sequence(rf);
    return 1u;
}

uint16_t ht_regfile_timer(ht_regfile *rf)
{
    uint16_t control = rf->word[TCR];
    if ((ht_model_clocked(rf, TCR) == 0u) || ((control & 0x0010u) != 0u)) {
        return 0u;
    }
    rf->word[TCR] = (uint16_t)(control | 0x8000u);
    if ((control & 0x4000u) != 0u) {
        request(rf, INT_1_7);
    }
    return 1u;
}
