/* A request: which function carries it out, whether its host may ask for it, and the reply's head. */
#include "ht_service_requests.h"

#include "ht_octets.h"
#include "ht_requests.h"

#include <stddef.h>

enum { NEEDS_NOTHING = 0, NEEDS_DICTIONARY = 1, NEEDS_SESSION = 2, NEEDS_BOTH = 3 };

typedef struct {
    uint16_t needs;
    uint16_t (*carry_out)(ht_service *l, const uint16_t *in, uint16_t n);
} handler;

/* By opcode. There is none for 0. */
static const handler handlers[(uint16_t)HT_OP_LAST + 1u] = {
    [HT_OP_HELLO] = {NEEDS_NOTHING, ht_request_hello},
    [HT_OP_LIST] = {NEEDS_NOTHING, ht_request_list},
    [HT_OP_OPEN] = {NEEDS_NOTHING, ht_request_open},
    [HT_OP_CLOSE] = {NEEDS_SESSION, ht_request_close},
    [HT_OP_STATUS] = {NEEDS_NOTHING, ht_request_status},
    [HT_OP_GET] = {NEEDS_DICTIONARY, ht_request_get},
    [HT_OP_WRITE] = {NEEDS_BOTH, ht_request_write},
    [HT_OP_START] = {NEEDS_BOTH, ht_request_start},
    [HT_OP_STOP] = {NEEDS_NOTHING, ht_request_stop},
    [HT_OP_CLEAR] = {NEEDS_BOTH, ht_request_clear},
    [HT_OP_STREAM] = {NEEDS_BOTH, ht_request_stream},
    [HT_OP_ARM] = {NEEDS_BOTH, ht_request_arm},
    [HT_OP_CAPTURE] = {NEEDS_NOTHING, ht_request_capture},
    [HT_OP_READ] = {NEEDS_SESSION, ht_request_read},
    [HT_OP_TRIGGER] = {NEEDS_SESSION, ht_request_trigger},
    [HT_OP_CANCEL] = {NEEDS_SESSION, ht_request_cancel},
    [HT_OP_SNAPSHOT] = {NEEDS_NOTHING, ht_request_snapshot},
    [HT_OP_SAVE] = {NEEDS_BOTH, ht_request_save},
    [HT_OP_FORGET] = {NEEDS_BOTH, ht_request_forget},
    [HT_OP_FORGET_LOG] = {NEEDS_BOTH, ht_request_forget_log},
};

static uint16_t carry_out(ht_service *l, const uint16_t *octets, uint16_t n)
{
    const handler *h;
    uint16_t dictionary;
    bool owner;
    if (n < HT_SERVICE_REQUEST_HEAD) {
        return HT_SERVICE_LENGTH;
    }
    if (octets[0] > (uint16_t)HT_OP_LAST) {
        return HT_SERVICE_OPCODE;
    }
    h = &handlers[octets[0]];
    if (h->carry_out == NULL) {
        return HT_SERVICE_OPCODE;
    }
    l->asks = ht_get16(&octets[2]);
    dictionary = ht_get16(&octets[4]);
    owner = (l->session != 0u) && (l->asks == l->session);
    if (owner && (octets[0] != (uint16_t)HT_OP_START)) {
        l->started = false; /* its host has gone on: no repetition of that START will come */
    }
    if (((h->needs & (uint16_t)NEEDS_SESSION) != 0u) && !owner) {
        return HT_SERVICE_SESSION;
    }
    if (((h->needs & (uint16_t)NEEDS_DICTIONARY) != 0u)
        && (dictionary != (uint16_t)(l->dictionary & 0xFFFFu))) {
        return HT_SERVICE_DICTIONARY;
    }
    return h->carry_out(l, &octets[HT_SERVICE_REQUEST_HEAD],
                        (uint16_t)(n - HT_SERVICE_REQUEST_HEAD));
}

static bool has_detail(uint16_t status_code)
{
    return ((status_code >= (uint16_t)HT_ERROR_ID) && (status_code < (uint16_t)HT_SERVICE_OPCODE))
           || (status_code == (uint16_t)HT_SERVICE_BUDGET)
           || (status_code == (uint16_t)HT_SERVICE_FIELD)
           || (status_code == (uint16_t)HT_SERVICE_SAMPLING);
}

void ht_service_execute(ht_service *l, const uint16_t *octets, uint16_t n)
{
    ht_packet *p = &l->reply;
    uint16_t result;
    uint16_t k;
    ht_packet_begin(p);
    for (k = 0u; k < HT_SERVICE_REPLY_HEAD; k++) {
        ht_packet_add8(p, 0u);
    }
    l->detail = HT_REQUEST_NO_DETAIL;
    result = carry_out(l, octets, n);
    if (result != (uint16_t)HT_OK) {
        p->n = HT_SERVICE_REPLY_HEAD;
        if (has_detail(result)) {
            ht_packet_add16(p, (uint16_t)l->detail);
        }
        if (result == (uint16_t)HT_SERVICE_MEMORY) {
            ht_packet_add32(p, l->detail);
        }
    }
    p->octet[0] = (uint16_t)(octets[0] | (uint16_t)HT_OP_REPLY);
    p->octet[1] = octets[1];
    p->octet[2] = result;
    p->octet[3] = l->drive->state;
    ht_put16(&p->octet[4], HT_LOW_FAULTS(l->drive->faults)); /* HT_LIST_FAULTS has all of them */
    ht_put32(&p->octet[6], l->drive->tick);
}
