/* A command of XCP: which function carries it out, and the answer's head. */
#include "ht_xcp_commands.h"

#include "ht_octets.h"
#include "ht_requests.h"

#include <stddef.h>

#define CAL_AND_DAQ 0x05u
#define OPTIONAL_COMMANDS 0x80u
#define LAYER_VERSION 1u
#define DAQ_RUNNING 0x40u
#define US_PER_S 1.0e6f

typedef struct {
    uint16_t octets; /* of its packet, at least */
    uint16_t (*carry_out)(ht_xcp *x, const uint16_t *in);
} executor;

bool ht_xcp_owns(ht_xcp *x)
{
    ht_service *l = x->service;
    if (l->session == 0u) {
        l->session = x->session;
        l->session_tick = l->drive->tick;
    }
    return l->session == x->session;
}

/* As the request does that this command stands for. */
static uint16_t done(ht_xcp *x, uint16_t result)
{
    x->detail = result;
    return (result == (uint16_t)HT_OK) ? (uint16_t)HT_XCP_OK : (uint16_t)HT_XCP_ACCESS_DENIED;
}

static uint16_t user_command(ht_xcp *x, const uint16_t *in)
{
    ht_service *l = x->service;
    if (in[1] == (uint16_t)HT_OP_STOP) {
        return done(x, ht_request_stop(l, in, 0u));
    }
    if ((in[1] != (uint16_t)HT_OP_START) && (in[1] != (uint16_t)HT_OP_CLEAR)) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if (!ht_xcp_owns(x)) {
        return HT_XCP_ACCESS_DENIED;
    }
    if (in[1] == (uint16_t)HT_OP_CLEAR) {
        return done(x, ht_request_clear(l, in, 0u));
    }
    l->started = false; /* this START is no repetition of one that came as a request */
    return done(x, ht_request_start(l, in, 0u));
}

static uint16_t connect(ht_xcp *x, const uint16_t *in)
{
    ht_xcp_packet *p = &x->reply;
    uint32_t tick = x->service->drive->tick;
    if (in[1] > 1u) {
        return HT_XCP_OUT_OF_RANGE;
    }
    if ((x->session == 0u) || (x->service->session != x->session)) {
        x->session = (uint16_t)(((tick * 40503u) >> 4) & 0xFFFCu) | (x->serial ? 3u : 1u);
        if (x->session == x->service->session) { /* another host has this number */
            x->session ^= 4u;
        }
    }
    x->us_per_count = US_PER_S / ht_port_pwm_clock_Hz(x->service->drive->port);
    x->connected = true;
    x->page = (uint16_t)HT_XCP_WORKING;
    x->mta = 0u;
    x->text = NULL;
    x->event = 0u;
    (void)ht_xcp_free_daq(x, in);
    ht_xcp_add8(p, CAL_AND_DAQ);
    ht_xcp_add8(p, OPTIONAL_COMMANDS);
    ht_xcp_add8(p, HT_XCP_CTO);
    ht_xcp_add16(p, HT_XCP_DTO);
    ht_xcp_add8(p, LAYER_VERSION);
    ht_xcp_add8(p, LAYER_VERSION);
    return HT_XCP_OK;
}

static uint16_t disconnect(ht_xcp *x, const uint16_t *in)
{
    (void)ht_xcp_free_daq(x, in);
    if (x->service->session == x->session) {
        (void)ht_request_close(x->service, in, 0u);
    }
    x->connected = false;
    return HT_XCP_OK;
}

static uint16_t get_status(ht_xcp *x, const uint16_t *in)
{
    ht_xcp_packet *p = &x->reply;
    (void)in;
    ht_xcp_add8(p, ht_xcp_daq_any(&x->daq) ? DAQ_RUNNING : 0u);
    ht_xcp_add16(p, 0u); /* nothing is locked */
    ht_xcp_add16(p, 0u); /* no configuration is kept */
    return HT_XCP_OK;
}

static uint16_t synch(ht_xcp *x, const uint16_t *in)
{
    (void)x;
    (void)in;
    return HT_XCP_CMD_SYNCH; /* an error by XCP's own will */
}

static uint16_t comm_mode(ht_xcp *x, const uint16_t *in)
{
    ht_xcp_packet *p = &x->reply;
    (void)in;
    ht_xcp_add32(p, 0u); /* no blocks, one command at a time */
    ht_xcp_add16(p, 0u);
    ht_xcp_add8(p, 0x10u); /* version of this slave, 1.0 */
    return HT_XCP_OK;
}

static uint16_t get_id(ht_xcp *x, const uint16_t *in)
{
    uint16_t letters = 0u;
    if (in[1] == 0u) {
        x->text = x->service->setup.device;
    } else if (in[1] == 1u) {
        x->text = "hexatorque"; /* name of the A2L file */
    } else {
        x->text = "";
    }
    while (x->text[letters] != '\0') {
        letters++;
    }
    ht_xcp_add8(&x->reply, 0u); /* to be uploaded */
    ht_xcp_add16(&x->reply, 0u);
    ht_xcp_add32(&x->reply, letters);
    return HT_XCP_OK;
}

/* By their number. */
static const executor executors[] = {
    [HT_XCP_CONNECT - HT_XCP_FIRST] = {2u, connect},
    [HT_XCP_DISCONNECT - HT_XCP_FIRST] = {1u, disconnect},
    [HT_XCP_GET_STATUS - HT_XCP_FIRST] = {1u, get_status},
    [HT_XCP_SYNCH - HT_XCP_FIRST] = {1u, synch},
    [HT_XCP_GET_COMM_MODE_INFO - HT_XCP_FIRST] = {1u, comm_mode},
    [HT_XCP_GET_ID - HT_XCP_FIRST] = {2u, get_id},
    [HT_XCP_SET_REQUEST - HT_XCP_FIRST] = {4u, ht_xcp_set_request},
    [HT_XCP_SET_MTA - HT_XCP_FIRST] = {8u, ht_xcp_set_mta},
    [HT_XCP_UPLOAD - HT_XCP_FIRST] = {2u, ht_xcp_upload},
    [HT_XCP_SHORT_UPLOAD - HT_XCP_FIRST] = {8u, ht_xcp_short_upload},
    [HT_XCP_BUILD_CHECKSUM - HT_XCP_FIRST] = {8u, ht_xcp_build_checksum},
    [HT_XCP_USER_CMD - HT_XCP_FIRST] = {2u, user_command},
    [HT_XCP_DOWNLOAD - HT_XCP_FIRST] = {2u, ht_xcp_download},
    [HT_XCP_SET_CAL_PAGE - HT_XCP_FIRST] = {4u, ht_xcp_set_cal_page},
    [HT_XCP_GET_CAL_PAGE - HT_XCP_FIRST] = {3u, ht_xcp_get_cal_page},
    [HT_XCP_GET_PAG_PROCESSOR_INFO - HT_XCP_FIRST] = {1u, ht_xcp_page_processor},
    [HT_XCP_GET_SEGMENT_INFO - HT_XCP_FIRST] = {5u, ht_xcp_segment},
    [HT_XCP_GET_PAGE_INFO - HT_XCP_FIRST] = {4u, ht_xcp_page},
    [HT_XCP_CLEAR_DAQ_LIST - HT_XCP_FIRST] = {4u, ht_xcp_clear_list},
    [HT_XCP_SET_DAQ_PTR - HT_XCP_FIRST] = {6u, ht_xcp_set_daq_ptr},
    [HT_XCP_WRITE_DAQ - HT_XCP_FIRST] = {8u, ht_xcp_write_daq},
    [HT_XCP_SET_DAQ_LIST_MODE - HT_XCP_FIRST] = {8u, ht_xcp_set_list_mode},
    [HT_XCP_GET_DAQ_LIST_MODE - HT_XCP_FIRST] = {4u, ht_xcp_get_list_mode},
    [HT_XCP_START_STOP_DAQ_LIST - HT_XCP_FIRST] = {4u, ht_xcp_start_stop_list},
    [HT_XCP_START_STOP_SYNCH - HT_XCP_FIRST] = {2u, ht_xcp_start_stop_all},
    [HT_XCP_GET_DAQ_CLOCK - HT_XCP_FIRST] = {1u, ht_xcp_clock},
    [HT_XCP_READ_DAQ - HT_XCP_FIRST] = {1u, ht_xcp_read_daq},
    [HT_XCP_GET_DAQ_PROCESSOR_INFO - HT_XCP_FIRST] = {1u, ht_xcp_daq_processor},
    [HT_XCP_GET_DAQ_RESOLUTION_INFO - HT_XCP_FIRST] = {1u, ht_xcp_daq_resolution},
    [HT_XCP_GET_DAQ_EVENT_INFO - HT_XCP_FIRST] = {4u, ht_xcp_event},
    [HT_XCP_FREE_DAQ - HT_XCP_FIRST] = {1u, ht_xcp_free_daq},
    [HT_XCP_ALLOC_DAQ - HT_XCP_FIRST] = {4u, ht_xcp_alloc_daq},
    [HT_XCP_ALLOC_ODT - HT_XCP_FIRST] = {5u, ht_xcp_alloc_odt},
    [HT_XCP_ALLOC_ODT_ENTRY - HT_XCP_FIRST] = {6u, ht_xcp_alloc_entry},
};

static uint16_t carry_out(ht_xcp *x, const uint16_t *in, uint16_t n)
{
    const executor *e;
    if (in[0] < (uint16_t)HT_XCP_FIRST) {
        return HT_XCP_UNKNOWN;
    }
    e = &executors[in[0] - (uint16_t)HT_XCP_FIRST];
    if (e->carry_out == NULL) {
        return HT_XCP_UNKNOWN;
    }
    if ((n < e->octets) || ((in[0] == (uint16_t)HT_XCP_DOWNLOAD) && (n < (2u + in[1])))) {
        return HT_XCP_SYNTAX;
    }
    return e->carry_out(x, in);
}

/* As a request of its host does. */
static void feed(const ht_xcp *x)
{
    ht_service *l = x->service;
    if ((l->session != 0u) && (l->session == x->session)) {
        l->session_tick = l->drive->tick;
        l->fed = 1u;
    }
}

bool ht_xcp_execute(ht_xcp *x, const uint16_t *in, uint16_t n)
{
    ht_xcp_packet *p = &x->reply;
    uint16_t result;
    if (!x->connected && (in[0] != (uint16_t)HT_XCP_CONNECT)) {
        return false;
    }
    feed(x);
    p->n = 0u;
    ht_xcp_add8(p, HT_XCP_RES);
    x->detail = (uint16_t)HT_OK;
    result = carry_out(x, in, n);
    if (result != (uint16_t)HT_XCP_OK) {
        p->n = 0u;
        ht_xcp_add8(p, HT_XCP_ERR);
        ht_xcp_add8(p, result);
        if (x->detail != (uint16_t)HT_OK) {
            ht_xcp_add8(p, x->detail);
        }
    }
    return true;
}
