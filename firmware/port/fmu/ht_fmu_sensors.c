/* Around the controller FMU: ideal sensors, to whose currents and voltage the inputs belong, and the
 * set-up's encoder. */
#include "ht_fmu.h"

#ifndef HT_FMU_PLANT

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ht_plant_data.h"
#include "ht_virtual_period.h"

/* With the suffix of a long double: a constant without one might be a float. */
#define TWO_PI ((double)6.283185307179586476925287L)
#define HALF ((double)0.5f)
/* Positions beyond this have no whole counts as double. */
#define MOST_COUNTS ((double)9.0e15L)

static void convert(ht_fmu_state *s, uint16_t channel, double counts)
{
    double whole = floor(counts + HALF);
    uint16_t reading = (uint16_t)fmin(fmax(whole, (double)0.0f), (double)(HT_ADC_FULL - 1));
    s->chip.word[s->port.map->adc_result[channel]] = (uint16_t)(reading << s->port.map->adc_shift);
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

/* An incremental encoder's counter is 0 at the first angle. Index and absolute encoder are where they are
 * on the shaft. */
static void count_from(ht_fmu_encoder *e, double zero_rad)
{
    struct plant_sensors *se = &e->sensors;
    double turns = zero_rad / TWO_PI;
    double within = (turns - floor(turns)) * se->encoder_counts_rev;
    if (se->index_counts >= 0) {
        se->index_counts += (int64_t)(se->encoder_counts_rev - floor(within + HALF));
    }
    se->absolute_rev -= turns;
    e->zero_rad = zero_rad;
    e->begun = true;
}

/* The converters' and the encoder's registers get what the inputs are. The sensors are ideal, with the
 * ranges that the firmware expects. */
static void sample(ht_fmu_state *s)
{
    const ht_c2000_map *m = s->port.map;
    const float *p = s->drive.params.v;
    double per_A = (double)HT_ADC_FULL / ((double)2.0f * (double)p[HT_P_i_full_A]);
    double per_V = (double)HT_ADC_FULL / (double)p[HT_P_vdc_full_V];
    ht_fmu_encoder *e = &s->encoder;
    int failed = 0; /* nothing in the encoder fails */
    uint16_t leg;
    for (leg = 0u; leg < HT_LEGS; leg++) {
        convert(s, leg, s->input[HT_FMU_I + leg] * per_A + (double)HT_ADC_MID);
    }
    convert(s, HT_ADC_VDC, s->input[HT_FMU_VDC] * per_V);
    sample_slow(s);
    s->chip.word[m->adc_flag] = (uint16_t)(s->chip.word[m->adc_flag] | m->adc_flag_bit);
    e->sensors.system_clocks = ht_fmu_period_s(s) * (double)m->system_clock_Hz;
    plant_encoder(&e->sensors, s->input[HT_FMU_POSITION] - e->zero_rad, s->chip.word, &failed);
}

void ht_fmu_outside_reset(ht_fmu_state *s)
{
    memset(&s->encoder, 0, sizeof s->encoder);
    s->encoder.sensors = sensors_data;
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
    double counts_rev = s->encoder.sensors.encoder_counts_rev;
    char line[HT_FMU_LINE];
    if (fabs(s->input[HT_FMU_POSITION]) / TWO_PI * counts_rev > MOST_COUNTS) {
        (void)snprintf(line, HT_FMU_LINE, "position_rad = %g: too large for the encoder",
                       s->input[HT_FMU_POSITION]);
        return ht_fmu_tell(f, HT_FMU_DISCARD, line);
    }
    if (!s->encoder.begun) {
        count_from(&s->encoder, s->input[HT_FMU_POSITION]);
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
