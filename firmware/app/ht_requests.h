/** @file ht_requests.h
 *  One function for each request of docs/protocol.md: the payload `in[0 .. n - 1]` goes in, a status
 *  comes out, the reply's payload is appended to `l->reply`. For ht_service_requests.c, which finds them
 *  by the opcode.
 */
#ifndef HT_REQUESTS_H
#define HT_REQUESTS_H

#include "ht_service.h"

/** `detail` of a refusal that has none. */
#define HT_REQUEST_NO_DETAIL 0xFFFFu

/* Who is there, and who may command: ht_requests_session.c */
uint16_t ht_request_hello(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_list(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_open(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_close(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_status(ht_service *l, const uint16_t *in, uint16_t n);

/* The drive's parameters, states, store and log: ht_requests_drive.c */
uint16_t ht_request_get(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_write(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_start(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_stop(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_clear(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_snapshot(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_save(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_forget(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_forget_log(ht_service *l, const uint16_t *in, uint16_t n);

/* Streams and captures: ht_requests_sampling.c */
uint16_t ht_request_stream(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_arm(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_capture(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_read(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_trigger(ht_service *l, const uint16_t *in, uint16_t n);
uint16_t ht_request_cancel(ht_service *l, const uint16_t *in, uint16_t n);

/** The rate of the interrupt is the streams' and captures' unit of time: true if they use it. */
bool ht_request_rate_is_used(const ht_service *l);

/** Fast interrupts per second: the PWM clock divided by whole counts, next to f_isr_Hz. */
float ht_request_rate_Hz(const ht_service *l);

/** Bytes per second that streams may take. */
uint32_t ht_request_budget(const ht_service *l);

/** The field at `offset` of the payload is out of range. */
static inline uint16_t ht_request_field(ht_service *l, uint16_t offset)
{
    l->detail = offset;
    return HT_SERVICE_FIELD;
}

#endif
