#include "ht_pil_snapshot.h"

#include <string.h>

void ht_pil_snapshot_add(ht_frame *reply, const ht_snapshot *s)
{
    uint16_t n;
    ht_frame_add32(reply, s->tick);
    ht_frame_add(reply, s->state);
    ht_frame_add(reply, s->faults);
    for (n = 0u; n < (uint16_t)HT_ADC_CHANNELS; n++) {
        ht_frame_add(reply, s->samples.adc[n]);
    }
    ht_frame_add32(reply, s->samples.position);
    for (n = 0u; n < (uint16_t)HT_LEGS; n++) {
        ht_frame_add_float(reply, s->in.i_A.p[n]);
    }
    ht_frame_add_float(reply, s->in.vdc_V);
    ht_frame_add_float(reply, s->in.torque_ref_Nm);
    ht_frame_add_float(reply, s->in.flux_ref_Wb);
    ht_frame_add_float(reply, s->estimate.psi_Wb.alpha);
    ht_frame_add_float(reply, s->estimate.psi_Wb.beta);
    ht_frame_add_float(reply, s->estimate.torque_Nm);
    ht_frame_add_float(reply, s->speed_rpm);
}

void ht_pil_snapshot_take(const uint16_t *words, ht_snapshot *s)
{
    const uint16_t *at = words;
    uint16_t n;
    (void)memset(s, 0, sizeof *s);
    s->tick = ht_frame_32(&at[0]);
    s->state = at[2];
    s->faults = at[3];
    at = &at[4];
    for (n = 0u; n < (uint16_t)HT_ADC_CHANNELS; n++) {
        s->samples.adc[n] = at[n];
    }
    at = &at[HT_ADC_CHANNELS];
    s->samples.position = ht_frame_32(at);
    at = &at[2];
    for (n = 0u; n < (uint16_t)HT_LEGS; n++) {
        s->in.i_A.p[n] = ht_frame_float(&at[2u * n]);
    }
    at = &at[2 * HT_LEGS];
    s->in.vdc_V = ht_frame_float(&at[0]);
    s->in.torque_ref_Nm = ht_frame_float(&at[2]);
    s->in.flux_ref_Wb = ht_frame_float(&at[4]);
    s->estimate.psi_Wb.alpha = ht_frame_float(&at[6]);
    s->estimate.psi_Wb.beta = ht_frame_float(&at[8]);
    s->estimate.torque_Nm = ht_frame_float(&at[10]);
    s->speed_rpm = ht_frame_float(&at[12]);
}
