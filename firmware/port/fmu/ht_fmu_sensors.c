/* Around the controller FMU: ideal sensors, to whose currents, voltage and angle the inputs belong. */
#include "ht_fmu.h"

#ifndef HT_FMU_PLANT

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ht_virtual_period.h"

/* With the suffix of a long double: a constant without one might be a float. */
#define TWO_PI ((double)6.283185307179586476925287L)
#define HALF ((double)0.5f)
/* Positions beyond this have no whole counts as double. */
#define MOST_COUNTS ((double)9.0e15L)
/* eQEP: registers and bits (docs/firmware.md) */
#define QCAPCTL 0x16u
#define QEPSTS 0x1Cu
#define QCTMR 0x1Du
#define QCPRD 0x1Eu
#define CEN 0x8000u
#define UPEVNT 0x80u
#define QDF 0x20u
#define COEF 0x08u
#define CDEF 0x04u
#define TIMER 0x10000

static void convert(ht_fmu_state *s, uint16_t channel, double counts)
{
    double whole = floor(counts + HALF);
    uint16_t reading = (uint16_t)fmin(fmax(whole, (double)0.0f), (double)(HT_ADC_FULL - 1));
    s->chip.word[s->port.map->adc_result[channel]] = (uint16_t)(reading << s->port.map->adc_shift);
}

/* Tick of the capture clock `way` counts after it showed `began`. */
static int64_t tick_at(double began, double slope, double way)
{
    return (int64_t)floor(began + slope * way);
}

/* The capture unit: edges since the last sample, timed as if the speed between two samples were
 * constant. The plant's sensors.py has the same. */
static void capture(ht_fmu_state *s, double counts, int64_t end, double system_clocks)
{
    ht_fmu_encoder *e = &s->encoder;
    uint16_t *word = &s->chip.word[s->port.eqep];
    uint16_t control = word[QCAPCTL];
    uint16_t status = word[QEPSTS];
    double began = e->ticks;
    double before = e->position_counts;
    int64_t start = e->counter;
    int64_t crossed = (end > start) ? (end - start) : (start - end);
    int64_t now;
    e->position_counts = counts;
    e->counter = end;
    e->ticks += system_clocks / (double)(1u << ((control >> 4) & 7u));
    now = (int64_t)floor(e->ticks);
    if ((control & CEN) == 0u) {
        e->event_tick = now;
        return;
    }
    if (crossed != 0) {
        bool forward = end > start;
        double slope = (e->ticks - began) / (counts - before);
        int64_t first = forward ? start : (start + 1);
        int64_t step = forward ? 1 : -1;
        int64_t unit = (int64_t)1 << (control & 15u);
        int64_t events = (e->edges + crossed) / unit;
        if (forward != ((status & QDF) != 0u)) {
            status = (uint16_t)((status ^ QDF) | CDEF);
        }
        if (events > 0) {
            int64_t k = unit - e->edges;
            int64_t tick = tick_at(began, slope, (double)(first + k * step) - before);
            if (tick - e->event_tick >= TIMER) {
                status = (uint16_t)(status | COEF);
            }
            if (events > 1) { /* the period is between the last two */
                k += (events - 1) * unit;
                e->event_tick = tick_at(began, slope, (double)(first + (k - unit) * step) - before);
                tick = tick_at(began, slope, (double)(first + k * step) - before);
            }
            word[QCPRD] = (uint16_t)((uint64_t)(tick - e->event_tick) & 0xFFFFu);
            e->event_tick = tick;
            status = (uint16_t)(status | UPEVNT);
        }
        e->edges += crossed - events * unit;
    }
    if (now - e->event_tick >= TIMER) {
        e->event_tick += (now - e->event_tick) / TIMER * TIMER;
        status = (uint16_t)(status | COEF);
    }
    word[QEPSTS] = status;
    word[QCTMR] = (uint16_t)(now - e->event_tick);
}

static double counts_turned(const ht_fmu_state *s)
{
    double turned_rad = s->input[HT_FMU_POSITION] - s->encoder.zero_rad;
    return turned_rad / TWO_PI * (double)s->drive.params.v[HT_P_encoder_counts_rev];
}

/* Thermistors are at 25 degC. */
static void sample_slow(ht_fmu_state *s)
{
    const ht_c2000_map *m = s->port.map;
    const float *p = s->drive.params.v;
    const float ohm[HT_SLOW_CHANNELS] = {p[HT_P_winding_ntc_ohm], p[HT_P_sink_ntc_ohm]};
    uint16_t channel;
    for (channel = 0u; channel < (uint16_t)HT_SLOW_CHANNELS; channel++) {
        float counts = (float)HT_ADC_FULL * ohm[channel] / (ohm[channel] + p[HT_P_ntc_pull_up_ohm]);
        bool turn =
            (m->adc_slow_select == 0xFFFFu)
            || ((s->chip.word[m->adc_slow_select] >> 12) == s->port.board->slow_channel[channel]);
        if (turn) {
            s->chip.word[m->adc_slow_result[channel]] =
                (uint16_t)((uint16_t)counts << m->adc_shift);
        }
    }
}

/* The converters' and the encoder's registers get what the inputs are. The sensors are ideal, with the
 * ranges that the firmware expects. */
static void sample(ht_fmu_state *s)
{
    const ht_c2000_map *m = s->port.map;
    const float *p = s->drive.params.v;
    double per_A = (double)HT_ADC_FULL / ((double)2.0f * (double)p[HT_P_i_full_A]);
    double per_V = (double)HT_ADC_FULL / (double)p[HT_P_vdc_full_V];
    double turned = counts_turned(s);
    int64_t counter = (int64_t)floor(turned);
    uint16_t *position = &s->chip.word[s->port.eqep];
    uint16_t leg;
    for (leg = 0u; leg < HT_LEGS; leg++) {
        convert(s, leg, s->input[HT_FMU_I + leg] * per_A + (double)HT_ADC_MID);
    }
    convert(s, HT_ADC_VDC, s->input[HT_FMU_VDC] * per_V);
    sample_slow(s);
    s->chip.word[m->adc_flag] = (uint16_t)(s->chip.word[m->adc_flag] | m->adc_flag_bit);
    position[0] = (uint16_t)((uint64_t)counter & 0xFFFFu);
    position[1] = (uint16_t)(((uint64_t)counter >> 16) & 0xFFFFu);
    capture(s, turned, counter, ht_fmu_period_s(s) * (double)m->system_clock_Hz);
}

void ht_fmu_outside_reset(ht_fmu_state *s)
{
    memset(&s->encoder, 0, sizeof s->encoder);
}

ht_fmu_status ht_fmu_outside_put(ht_fmu *f, uint16_t row, double value)
{
    f->s.input[row] = value;
    return HT_FMU_OK;
}

double ht_fmu_outside_output(const ht_fmu_state *s, uint32_t row)
{
    (void)s;
    (void)row;
    return (double)0.0f; /* there is no other output */
}

ht_fmu_status ht_fmu_outside_begin(ht_fmu *f)
{
    ht_fmu_state *s = &f->s;
    char line[HT_FMU_LINE];
    if (!s->encoder.begun) {
        s->encoder.zero_rad = s->input[HT_FMU_POSITION];
        s->encoder.begun = true;
    }
    if (fabs(counts_turned(s)) > MOST_COUNTS) {
        (void)snprintf(line, HT_FMU_LINE, "position_rad = %g: too large for the encoder",
                       s->input[HT_FMU_POSITION]);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    return HT_FMU_OK;
}

ht_fmu_status ht_fmu_outside_period(ht_fmu *f)
{
    ht_fmu_state *s = &f->s;
    const float *p = s->drive.params.v;
    uint64_t slow_every = (uint64_t)(p[HT_P_f_isr_Hz] / p[HT_P_f_slow_Hz] + 0.5f);
    sample(s);
    ht_virtual_period(&s->drive);
    if ((s->periods % slow_every) == 0u) {
        ht_drive_slow_isr(&s->drive);
    }
    return HT_FMU_OK;
}

#endif
