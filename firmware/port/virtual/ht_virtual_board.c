#include "ht_virtual_board.h"

#include "ht_drivers.h"
#include "ht_virtual_period.h"

/* Bytes that pass between two turns of the background, less than a FIFO takes. */
#define AT_ONCE 8.0f

/* --- the second line ------------------------------------------------------------------------ */

static uint16_t net_read(void *at, uint16_t *octets, uint16_t n, bool *lost)
{
    ht_virtual_board *b = (ht_virtual_board *)at;
    uint16_t k;
    *lost = false;
    for (k = 0u; (k < n) && (b->net.in_tail != b->net.in_head); k++) {
        octets[k] = b->net.in[b->net.in_tail % HT_VIRTUAL_IN];
        b->net.in_tail++;
    }
    return k;
}

static void put_out(ht_virtual_line *line, uint16_t octet)
{
    if ((line->out_head - line->out_tail) < HT_VIRTUAL_OUT) {
        line->out[line->out_head % HT_VIRTUAL_OUT] = octet;
        line->out_head++;
    } else {
        line->lost++;
    }
}

static uint16_t net_write(void *at, const uint16_t *octets, uint16_t n)
{
    ht_virtual_board *b = (ht_virtual_board *)at;
    uint16_t k;
    for (k = 0u; (k < n) && (b->credit_net >= 1.0f); k++) {
        put_out(&b->net, octets[k]);
        b->credit_net -= 1.0f;
    }
    return k;
}

/* One period of it. */
static void network(ht_virtual_board *b)
{
    uint32_t passed;
    float octets = (float)HT_VIRTUAL_NET_OCTETS_PER_S / b->drive->params.v[HT_P_f_isr_Hz];
    b->credit_net = ((b->credit_net > 1.0f) ? 1.0f : b->credit_net) + octets;
    do {
        passed = b->net.in_tail + b->net.out_head;
        ht_xcp_turn(&b->xcp_net);
    } while ((passed != (b->net.in_tail + b->net.out_head)) && (b->credit_net >= 1.0f));
}

/* --- the board ------------------------------------------------------------------------------ */

static void clear(ht_virtual_line *line)
{
    line->in_head = 0u;
    line->in_tail = 0u;
    line->out_head = 0u;
    line->out_tail = 0u;
    line->lost = 0u;
}

static void empty_lines(ht_virtual_board *b)
{
    b->credit_in = 0.0f;
    b->credit_out = 0.0f;
    b->credit_net = 0.0f;
    clear(&b->serial);
    clear(&b->net);
}

bool ht_virtual_init(ht_virtual_board *b, ht_drive *d, ht_port *port, const ht_service_setup *setup,
                     uint32_t baud)
{
    ht_service_setup with_line = *setup;
    ht_line net = {net_read, net_write, b, HT_VIRTUAL_NET_OCTETS_PER_S};
    ht_line serial;
    if (!ht_sci_start(port, baud) || (ht_channel_count() > HT_VIRTUAL_CHANNELS)) {
        return false;
    }
    serial = ht_sci_line(port);
    ht_xcp_init(&b->xcp_serial, &b->service, &serial, (uint16_t)HT_XCP_SERIAL);
    ht_xcp_init(&b->xcp_net, &b->service, &net, (uint16_t)HT_XCP_NET);
    with_line.line = ht_xcp_shared(&b->xcp_serial);
    b->reset.cause = port->reset_cause;
    b->reset.watchdogs = 0u;
    with_line.reset = &b->reset;
    b->drive = d;
    b->port = port;
    ht_service_init(&b->service, d, &with_line);
    ht_channels_read(d, b->channel);
    empty_lines(b);
    return true;
}

static void arrive(ht_virtual_board *b, float octets)
{
    ht_virtual_line *line = &b->serial;
    b->credit_in += octets;
    while ((b->credit_in >= 1.0f) && (line->in_tail != line->in_head)) {
        (void)ht_regfile_sci_arrive(b->port->io, line->in[line->in_tail % HT_VIRTUAL_IN]);
        line->in_tail++;
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
            put_out(&b->serial, octet);
        }
    }
    b->credit_out = (b->credit_out > 1.0f) ? 1.0f : b->credit_out;
}

static void turn(ht_virtual_board *b)
{
    ht_service_turn(&b->service);
    ht_xcp_turn(&b->xcp_serial);
}

/* One period of the background loop and of the lines. */
static void background(ht_virtual_board *b)
{
    float left = (float)b->service.setup.line.octets_per_s / b->drive->params.v[HT_P_f_isr_Hz];
    while (left > 0.0f) {
        float now = (left < AT_ONCE) ? left : AT_ONCE;
        left -= now;
        arrive(b, now);
        turn(b);
        turn(b); /* the loop turns faster than the line */
        leave(b, now);
    }
    network(b);
}

void ht_virtual_fast(ht_virtual_board *b)
{
    background(b);
    ht_virtual_period(b->drive);
    ht_service_fast(&b->service);
    ht_xcp_fast(&b->xcp_serial);
    ht_xcp_fast(&b->xcp_net);
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

uint32_t ht_virtual_put(ht_virtual_line *line, const uint16_t *octets, uint32_t n)
{
    uint32_t k;
    for (k = 0u; (k < n) && ((line->in_head - line->in_tail) < HT_VIRTUAL_IN); k++) {
        line->in[line->in_head % HT_VIRTUAL_IN] = octets[k];
        line->in_head++;
    }
    return k;
}

uint32_t ht_virtual_take(ht_virtual_line *line, uint16_t *octets, uint32_t n)
{
    uint32_t k;
    for (k = 0u; (k < n) && (line->out_tail != line->out_head); k++) {
        octets[k] = line->out[line->out_tail % HT_VIRTUAL_OUT];
        line->out_tail++;
    }
    return k;
}
