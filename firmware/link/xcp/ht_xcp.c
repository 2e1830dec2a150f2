/* Receiving and sending, and the line that XCP shares with the link. */
#include "ht_xcp_commands.h"

#include "ht_octets.h"
#include "ht_requests.h"
#include "ht_service_requests.h"

#include <stddef.h>

#define CONNECT_OCTETS 2u
#define SILENCE_S 0.05f /* after it a frame that has begun is not whole any more */

void ht_xcp_init(ht_xcp *x, ht_service *service, const ht_line *line, uint16_t kind)
{
    x->service = service;
    x->line = *line;
    x->serial = kind == (uint16_t)HT_XCP_SERIAL;
    x->ours = !x->serial;
    x->connected = false;
    x->reply_due = false;
    x->reply_waits = false;
    x->link_first = false;
    x->event = 0u;
    x->session = 0u;
    x->page = (uint16_t)HT_XCP_WORKING;
    x->counter = 0u;
    x->detail = (uint16_t)HT_OK;
    x->pointer_list = HT_XCP_NOTHING;
    x->pointer_odt = 0u;
    x->pointer_entry = 0u;
    x->pending_n = 0u;
    x->damaged = 0u;
    x->mta = 0u;
    x->text = NULL;
    x->overtaken = 0u;
    x->heard_tick = 0u;
    x->time = 0u;
    x->time_part = 0.0f;
    x->us_per_count = 0.0f;
    x->slow_tick = 0u;
    ht_xcp_incoming_reset(&x->in);
    x->out.n = 0u;
    x->out.sent = 0u;
    x->daq.head = 0u;
    ht_xcp_daq_free(&x->daq);
}

/* --- whose line it is ---------------------------------------------------------------------- */

/* A master has come: nothing of the link's goes out any more, but for the rest of a frame. */
static void take_line(ht_xcp *x)
{
    ht_service *l = x->service;
    x->ours = true;
    x->damaged = l->damaged;
    x->link_first = l->out.sent < l->out.n;
    ht_streams_reset(&l->streams);
    l->begins = HT_STREAMS;
    l->read_left = 0u;
    l->reply_due = false;
}

/* A host of the link has come. A zero ends what it may have received of XCP. */
static void give_back(ht_xcp *x)
{
    static const uint16_t zero = 0u;
    x->ours = false;
    x->connected = false;
    x->reply_due = false;
    x->event = 0u;
    x->out.sent = x->out.n;
    ht_xcp_daq_free(&x->daq);
    (void)x->line.write(x->line.at, &zero, 1u);
}

/* --- receiving ----------------------------------------------------------------------------- */

static void command(ht_xcp *x, const uint16_t *in, uint16_t n)
{
    if (!x->ours) {
        if (in[0] != (uint16_t)HT_XCP_CONNECT) {
            return;
        }
        take_line(x);
    }
    if (!x->reply_due) { /* else the master did not wait for the answer */
        x->reply_due = ht_xcp_execute(x, in, n);
    }
}

static void look(ht_xcp *x)
{
    uint16_t most = x->ours ? HT_XCP_CTO : CONNECT_OCTETS;
    uint16_t n = ht_xcp_incoming_next(&x->in, most, x->serial);
    while (n != 0u) {
        command(x, &x->in.octet[HT_XCP_HEAD], n);
        ht_xcp_incoming_drop(&x->in, n, x->serial);
        most = x->ours ? HT_XCP_CTO : CONNECT_OCTETS;
        n = ht_xcp_incoming_next(&x->in, most, x->serial);
    }
}

static void receive(ht_xcp *x)
{
    uint32_t tick = x->service->drive->tick;
    uint32_t silent = tick - x->heard_tick;
    bool lost = false;
    uint16_t k;
    if (!x->serial) {
        x->pending_n = x->line.read(x->line.at, x->pending, HT_XCP_FIFO, &lost);
    }
    if (x->pending_n != 0u) {
        x->heard_tick = tick;
    } else if ((x->in.n != 0u) && ((float)silent > (SILENCE_S * ht_request_rate_Hz(x->service)))) {
        ht_xcp_incoming_reset(&x->in);
    } else {
        /* nothing new */
    }
    for (k = 0u; k < x->pending_n; k++) {
        ht_xcp_incoming_add(&x->in, x->pending[k]);
        look(x);
    }
    x->pending_n = 0u;
}

/* --- the shared line ----------------------------------------------------------------------- */

static uint16_t shared_read(void *at, uint16_t *octets, uint16_t n, bool *lost)
{
    ht_xcp *x = (ht_xcp *)at;
    uint16_t most = (n < HT_XCP_FIFO) ? n : HT_XCP_FIFO;
    uint16_t k;
    receive(x); /* what is left of the last time, if the link alone has turned */
    x->pending_n = x->line.read(x->line.at, octets, most, lost);
    for (k = 0u; k < x->pending_n; k++) {
        x->pending[k] = octets[k];
    }
    return x->pending_n;
}

/* While the line is XCP's, the link has only the reply to a whole frame to send. */
static uint16_t shared_write(void *at, const uint16_t *octets, uint16_t n)
{
    ht_xcp *x = (ht_xcp *)at;
    if (x->ours && !x->link_first) {
        give_back(x);
    }
    return x->line.write(x->line.at, octets, n);
}

ht_line ht_xcp_shared(ht_xcp *x)
{
    ht_line line = x->line;
    line.read = shared_read;
    line.write = shared_write;
    line.at = x;
    return line;
}

/* --- sending ------------------------------------------------------------------------------- */

static bool event_packet(ht_xcp *x)
{
    if (x->daq.overload != 0u) {
        x->daq.overload = 0u;
        x->event = (uint16_t)HT_XCP_EV_DAQ_OVERLOAD;
    }
    if (x->event == 0u) {
        return false;
    }
    x->data.n = 0u;
    ht_xcp_add8(&x->data, HT_XCP_EV);
    ht_xcp_add8(&x->data, x->event);
    x->event = 0u;
    return true;
}

static void put(ht_xcp *x, const ht_xcp_packet *p)
{
    ht_xcp_outgoing_set(&x->out, p, x->counter, x->serial);
    x->counter = (uint16_t)((x->counter + 1u) & 0xFFFFu);
}

static void next_packet(ht_xcp *x)
{
    bool ready;
    if (x->reply_waits && (x->service->drive->staged == NULL)) {
        x->reply_waits = false;
    }
    ready = x->reply_due && !x->reply_waits;
    if (!(ready && (x->overtaken >= (HT_SERVICE_STREAM_TENTHS * (uint32_t)x->reply.n)))
        && ht_xcp_daq_next(&x->daq, &x->data)) {
        put(x, &x->data);
        x->overtaken += ready ? x->out.n : 0u;
    } else if (ready) {
        x->reply_due = false;
        x->overtaken = 0u;
        put(x, &x->reply);
        ht_xcp_begin(x);
    } else if (event_packet(x)) {
        put(x, &x->data);
    } else {
        /* nothing to send */
    }
}

static void transmit(ht_xcp *x)
{
    const ht_service *l = x->service;
    if (x->link_first && (l->out.sent == l->out.n)) {
        x->link_first = false;
    }
    if (!x->ours || x->link_first) {
        return;
    }
    if (x->out.sent == x->out.n) {
        next_packet(x);
    }
    if (x->out.sent < x->out.n) {
        uint16_t left = (uint16_t)(x->out.n - x->out.sent);
        uint16_t n = (left < HT_XCP_FIFO) ? left : HT_XCP_FIFO;
        uint16_t taken = x->line.write(x->line.at, &x->out.octet[x->out.sent], n);
        x->out.sent = (uint16_t)(x->out.sent + taken);
    }
}

void ht_xcp_turn(ht_xcp *x)
{
    receive(x);
    if (x->serial && x->ours) {
        x->service->damaged = x->damaged; /* what XCP's octets look like to the link */
    }
    transmit(x);
}
