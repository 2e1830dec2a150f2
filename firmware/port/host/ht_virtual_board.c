#include "ht_virtual_board.h"

#include "ht_drivers.h"

/* Bytes that pass between two turns of the background, less than a FIFO takes. */
#define AT_ONCE 8.0f

bool ht_virtual_init(ht_virtual_board *b, ht_drive *d, ht_port *port, const ht_service_setup *setup,
                     uint32_t baud)
{
    ht_service_setup with_line = *setup;
    if (!ht_sci_start(port, baud) || (ht_channel_count() > HT_VIRTUAL_CHANNELS)) {
        return false;
    }
    with_line.line = ht_sci_line(port);
    b->reset.cause = port->reset_cause;
    b->reset.watchdogs = 0u;
    with_line.reset = &b->reset;
    b->drive = d;
    b->port = port;
    ht_service_init(&b->service, d, &with_line);
    ht_channels_read(d, b->channel);
    b->credit_in = 0.0f;
    b->credit_out = 0.0f;
    b->in_head = 0u;
    b->in_tail = 0u;
    b->out_head = 0u;
    b->out_tail = 0u;
    b->lost = 0u;
    return true;
}

static void arrive(ht_virtual_board *b, float octets)
{
    b->credit_in += octets;
    while ((b->credit_in >= 1.0f) && (b->in_tail != b->in_head)) {
        (void)ht_regfile_sci_arrive(b->port->io, b->in[b->in_tail % HT_VIRTUAL_IN]);
        b->in_tail++;
        b->credit_in -= 1.0f;
    }
    b->credit_in = (b->credit_in > 1.0f) ? 1.0f : b->credit_in; /* a quiet line saves nothing up */
}

static void leave(ht_virtual_board *b, float octets)
{
    uint16_t octet = 0u;
    b->credit_out += octets;
    while ((b->credit_out >= 1.0f) && (octet != 0xFFFFu)) {
        octet = ht_regfile_sci_leave(b->port->io);
        if (octet != 0xFFFFu) {
            b->credit_out -= 1.0f;
            if ((b->out_head - b->out_tail) < HT_VIRTUAL_OUT) {
                b->out[b->out_head % HT_VIRTUAL_OUT] = octet;
                b->out_head++;
            } else {
                b->lost++;
            }
        }
    }
    b->credit_out = (b->credit_out > 1.0f) ? 1.0f : b->credit_out;
}

/* One period of the background loop and of the line. */
static void background(ht_virtual_board *b)
{
    float left = (float)b->service.setup.line.octets_per_s / b->drive->params.v[HT_P_f_isr_Hz];
    while (left > 0.0f) {
        float now = (left < AT_ONCE) ? left : AT_ONCE;
        left -= now;
        arrive(b, now);
        ht_service_turn(&b->service);
        ht_service_turn(&b->service); /* the loop turns faster than the line */
        leave(b, now);
    }
}

void ht_virtual_period(ht_drive *d)
{
    ht_port *port = d->port;
    uint32_t per_count = (uint32_t)(port->map->system_clock_Hz / port->map->pwm_clock_Hz + 0.5f);
    if (ht_regfile_pass(port->io, per_count * d->config->control.period.counts) != 0u) {
        port->io->int13 = 0u;
        ht_port_gates_off(port); /* as the image's routine does */
    }
    if (port->io->lost == 0u) {
        ht_drive_fast_isr(d);
    }
}

void ht_virtual_fast(ht_virtual_board *b)
{
    background(b);
    ht_virtual_period(b->drive);
    ht_service_fast(&b->service);
    ht_channels_read(b->drive, b->channel);
}

void ht_virtual_slow(ht_virtual_board *b)
{
    ht_drive_slow_isr(b->drive);
}

void ht_virtual_channels(const ht_virtual_board *b, float *out)
{
    uint16_t k;
    for (k = 0u; k < ht_channel_count(); k++) {
        out[k] = b->channel[k];
    }
}

uint32_t ht_virtual_put(ht_virtual_board *b, const uint16_t *octets, uint32_t n)
{
    uint32_t k;
    for (k = 0u; (k < n) && ((b->in_head - b->in_tail) < HT_VIRTUAL_IN); k++) {
        b->in[b->in_head % HT_VIRTUAL_IN] = octets[k];
        b->in_head++;
    }
    return k;
}

uint32_t ht_virtual_take(ht_virtual_board *b, uint16_t *octets, uint32_t n)
{
    uint32_t k;
    for (k = 0u; (k < n) && (b->out_tail != b->out_head); k++) {
        octets[k] = b->out[b->out_tail % HT_VIRTUAL_OUT];
        b->out_tail++;
    }
    return k;
}
