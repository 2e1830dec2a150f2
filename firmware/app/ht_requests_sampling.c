/* Requests: streams and captures, which count in fast interrupts. */
#include "ht_drive_inside.h"
#include "ht_octets.h"
#include "ht_requests.h"
#include "ht_service_requests.h"

#define SAMPLE_HEAD 12.0f /* bytes of a sample on the line that are no values */

bool ht_request_rate_is_used(const ht_service *l)
{
    return ht_streams_any(&l->streams)
           || ((l->burst.state != (uint16_t)HT_BURST_NONE)
               && (l->burst.state < (uint16_t)HT_BURST_SUMMING));
}

float ht_request_rate_Hz(const ht_service *l)
{
    uint16_t counts = ht_config_in_force(l->drive)->control.period.counts;
    return ht_port_pwm_clock_Hz(l->drive->port) / (float)counts;
}

uint32_t ht_request_budget(const ht_service *l)
{
    return l->setup.line.octets_per_s / 10u * HT_SERVICE_STREAM_TENTHS;
}

static bool take_channels(ht_service *l, const uint16_t *in, uint16_t n, uint16_t *ids)
{
    uint16_t k;
    for (k = 0u; k < n; k++) {
        ids[k] = ht_get16(&in[2u * k]);
        if (ids[k] >= ht_channel_count()) {
            l->detail = ids[k];
            return false;
        }
    }
    return true;
}

/* Bytes a second of a stream: rounded up. */
static uint32_t load(float interrupts_Hz, uint16_t n, uint16_t decimation)
{
    float octets = 4.0f * (float)n + SAMPLE_HEAD;
    float samples_Hz = interrupts_Hz / (float)decimation;
    float sum = octets * samples_Hz;
    return (n == 0u) ? 0u : ((uint32_t)sum + 1u);
}

/* Smallest decimation with which a stream of `n` channels takes up to `rest` bytes a
 * second; 0: none. */
static uint16_t smallest(float interrupts_Hz, uint16_t n, uint32_t rest)
{
    uint32_t least;
    if (rest == 0u) {
        return 0u;
    }
    least = load(interrupts_Hz, n, 1u) / rest; /* this one or the next */
    if (least >= 0xFFFFu) {
        return 0u;
    }
    if ((least == 0u) || (load(interrupts_Hz, n, (uint16_t)least) > rest)) {
        least++;
    }
    return (load(interrupts_Hz, n, (uint16_t)least) > rest) ? 0u : (uint16_t)least;
}

uint16_t ht_request_stream(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t ids[HT_STREAM_CHANNELS];
    uint32_t others = 0u;
    uint32_t budget = ht_request_budget(l);
    float interrupts_Hz = ht_request_rate_Hz(l);
    uint32_t needed;
    uint16_t slot;
    uint16_t count;
    uint16_t decimation;
    uint16_t k;
    if ((n < 4u) || (n != (4u + (2u * in[1])))) {
        return HT_SERVICE_LENGTH;
    }
    slot = in[0];
    count = in[1];
    decimation = ht_get16(&in[2]);
    if (slot >= HT_STREAMS) {
        return HT_SERVICE_NO_STREAM;
    }
    if (count > HT_STREAM_CHANNELS) {
        return ht_request_field(l, 1u);
    }
    if (decimation == 0u) {
        return ht_request_field(l, 2u);
    }
    if (!take_channels(l, &in[4], count, ids)) {
        return HT_ERROR_ID;
    }
    for (k = 0u; k < HT_STREAMS; k++) {
        if ((k != slot) && (l->streams.stream[k].active != 0u)) {
            others += load(interrupts_Hz, l->streams.stream[k].n, l->streams.stream[k].decimation);
        }
    }
    needed = load(interrupts_Hz, count, decimation);
    if ((others + needed) > budget) {
        l->detail = smallest(interrupts_Hz, count, (others < budget) ? (budget - others) : 0u);
        return HT_SERVICE_BUDGET;
    }
    ht_streams_set(&l->streams, slot, ids, count, decimation);
    l->begins = slot;
    ht_packet_add32(&l->reply, others + needed);
    ht_packet_add32(&l->reply, budget);
    return HT_OK;
}

#define ARM_HEAD 18u

uint16_t ht_request_arm(ht_service *l, const uint16_t *in, uint16_t n)
{
    /* by ht_burst_answer */
    static const uint16_t offset[HT_BURST_TOO_LARGE] = {0u, 0u, 1u, 2u, 4u, 8u, 14u};
    ht_burst_setup setup;
    ht_burst_answer answer;
    if ((n < ARM_HEAD) || (n != (ARM_HEAD + (2u * in[0])))) {
        return HT_SERVICE_LENGTH;
    }
    setup.n = in[0];
    setup.trigger = in[1];
    setup.prescaler = ht_get16(&in[2]);
    setup.samples = ht_get32(&in[4]);
    setup.before = ht_get32(&in[8]);
    setup.channel = ht_get16(&in[12]);
    setup.level = ht_float_of(ht_get32(&in[14]));
    if (setup.n > HT_BURST_CHANNELS) {
        return ht_request_field(l, 0u);
    }
    if (setup.channel >= ht_channel_count()) {
        l->detail = setup.channel;
        return HT_ERROR_ID;
    }
    if (!take_channels(l, &in[ARM_HEAD], setup.n, setup.id)) {
        return HT_ERROR_ID;
    }
    answer = ht_burst_arm(&l->burst, &setup);
    if (answer == HT_BURST_TOO_LARGE) {
        l->detail = l->burst.size / setup.n;
        return HT_SERVICE_MEMORY;
    }
    if (answer != HT_BURST_ARMED) {
        return ht_request_field(l, offset[answer]);
    }
    l->read_left = 0u; /* of the capture that was there */
    ht_packet_add8(&l->reply, l->burst.number);
    return HT_OK;
}

uint16_t ht_request_capture(ht_service *l, const uint16_t *in, uint16_t n)
{
    const ht_burst *b = &l->burst;
    ht_packet *p = &l->reply;
    uint16_t state = b->state; /* once: the interrupt moves it on */
    uint16_t k;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_packet_add8(p, state);
    ht_packet_add8(p, b->number);
    ht_packet_add16(p, b->setup.prescaler);
    ht_packet_add32(p, b->setup.samples);
    ht_packet_add32(p, b->setup.before);
    ht_packet_add32(p, b->tick);
    ht_packet_add32(p, (state == (uint16_t)HT_BURST_COMPLETE) ? b->crc : 0u);
    for (k = 0u; k < b->setup.n; k++) {
        ht_packet_add16(p, b->setup.id[k]);
    }
    return HT_OK;
}

uint16_t ht_request_read(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint32_t first;
    uint32_t count;
    uint32_t values = ht_burst_values(&l->burst);
    if (n != 8u) {
        return HT_SERVICE_LENGTH;
    }
    first = ht_get32(in);
    count = ht_get32(&in[4]);
    if (l->burst.state != (uint16_t)HT_BURST_COMPLETE) {
        return HT_SERVICE_CAPTURE;
    }
    if (first > values) {
        return ht_request_field(l, 0u);
    }
    if (count > (values - first)) {
        return ht_request_field(l, 4u);
    }
    l->read_at = first;
    l->read_left = count;
    return HT_OK;
}

uint16_t ht_request_trigger(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    if ((l->burst.state != (uint16_t)HT_BURST_FILLING)
        && (l->burst.state != (uint16_t)HT_BURST_WAITING)) {
        return HT_SERVICE_CAPTURE;
    }
    l->burst.manual = 1u;
    return HT_OK;
}

uint16_t ht_request_cancel(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_burst_cancel(&l->burst);
    l->read_left = 0u;
    return HT_OK;
}
