/* Requests: the drive's parameters, states, its latest fault, and the parameters that are kept. */
#include "ht_octets.h"
#include "ht_requests.h"
#include "ht_service_requests.h"
#include "ht_snapshot.h"

#include <stddef.h>

#define PAIR 6u /* bytes of id and value */

uint16_t ht_request_get(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t k;
    if (((n & 1u) != 0u) || (n > (2u * HT_SERVICE_GET))) {
        return HT_SERVICE_LENGTH;
    }
    for (k = 0u; k < n; k += 2u) {
        uint16_t id = ht_get16(&in[k]);
        if (id >= ht_param_count()) {
            l->detail = id;
            return HT_ERROR_ID;
        }
        ht_packet_add_float(&l->reply, ht_drive_get(l->drive, id));
    }
    return HT_OK;
}

uint32_t ht_service_watchdog_ticks(const ht_service *l)
{
    float ticks = l->drive->params.v[HT_P_f_isr_Hz] * (float)l->setup.watchdog_ms * 0.001f;
    return (ticks < 1.0f) ? 1u : (uint32_t)ticks;
}

/* Id and value number k of a WRITE; false if the rate would change while it is used. */
static bool take_pair(ht_service *l, const uint16_t *pair, uint16_t k, bool fixed)
{
    uint16_t id = ht_get16(pair);
    float value = ht_float_of(ht_get32(&pair[2]));
    if (fixed && (id == (uint16_t)HT_P_f_isr_Hz) && (value != ht_drive_get(l->drive, id))) {
        l->detail = id;
        return false;
    }
    l->write_id[k] = id;
    l->write_value[k] = value;
    return true;
}

/* Ids and values of the payload, all of them or false. */
static bool take_pairs(ht_service *l, const uint16_t *in, uint16_t count)
{
    bool fixed = ht_request_rate_is_used(l);
    uint16_t k;
    for (k = 0u; k < count; k++) {
        if (!take_pair(l, &in[k * PAIR], k, fixed)) {
            return false;
        }
    }
    return true;
}

uint16_t ht_request_write(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t count = (uint16_t)(n / PAIR);
    uint16_t at = HT_REQUEST_NO_DETAIL;
    uint16_t result;
    uint16_t k;
    if ((n == 0u) || ((count * PAIR) != n) || (count > HT_SERVICE_WRITE)) {
        return HT_SERVICE_LENGTH;
    }
    if (!take_pairs(l, in, count)) {
        return HT_SERVICE_SAMPLING;
    }
    result = (uint16_t)ht_drive_write(l->drive, l->write_id, l->write_value, count, &at);
    if (result != (uint16_t)HT_OK) {
        bool told = (result == (uint16_t)HT_ERROR_ID) || (result == (uint16_t)HT_ERROR_VALUE)
                    || (result == (uint16_t)HT_ERROR_STATE)
                    || (result == (uint16_t)HT_ERROR_CONFIG);
        if (told) {
            l->detail = at;
        }
        return result;
    }
    l->burst.command = 1u;
    l->reply_waits = true;
    ht_packet_add32(&l->reply, 0u); /* the tick: once it is known */
    for (k = 0u; k < count; k++) {
        ht_packet_add_float(&l->reply, ht_drive_get(l->drive, l->write_id[k]));
    }
    return HT_OK;
}

uint16_t ht_request_start(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t result;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    if (l->started && (l->last_crc == l->start_crc)) {
        return HT_ERROR_STATE; /* repeated after another host's request, perhaps a STOP */
    }
    l->watchdog_ticks = ht_service_watchdog_ticks(l);
    result = (uint16_t)ht_drive_start(l->drive);
    if (result == (uint16_t)HT_ERROR_RESTART) {
        l->detail = ht_drive_restart_wait(l->drive);
    }
    if (result == (uint16_t)HT_OK) {
        l->started = true;
        l->start_crc = l->last_crc;
        l->watchdog_left = l->watchdog_ticks;
        l->fed = 1u;
        l->armed = 1u; /* last: the interrupt disarms what does not run */
        l->burst.command = 1u;
    }
    return result;
}

uint16_t ht_request_stop(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    ht_drive_stop(l->drive);
    l->armed = 0u;
    l->burst.command = 1u;
    return HT_OK;
}

uint16_t ht_request_clear(ht_service *l, const uint16_t *in, uint16_t n)
{
    uint16_t result;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    result = (uint16_t)ht_drive_clear(l->drive);
    if (result == (uint16_t)HT_OK) {
        l->burst.command = 1u;
    }
    return result;
}

uint16_t ht_request_snapshot(ht_service *l, const uint16_t *in, uint16_t n)
{
    const volatile ht_snapshot *s = &l->drive->snapshot;
    ht_packet *p = &l->reply;
    uint16_t begin = p->n;
    uint32_t tick;
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    do { /* again, if a fault came in between: its tick is another one */
        tick = s->tick;
        p->n = begin;
        ht_snapshot_add(p, s);
    } while (s->tick != tick);
    return HT_OK;
}

ht_result ht_service_keep(const ht_service *l)
{
    if (l->setup.store == NULL) {
        return HT_ERROR_STORE;
    }
    return ht_request_rate_is_used(l) ? HT_ERROR_STATE : ht_store_save(l->setup.store, l->drive);
}

ht_result ht_service_forget(const ht_service *l)
{
    if (l->setup.store == NULL) {
        return HT_ERROR_STORE;
    }
    return ht_request_rate_is_used(l) ? HT_ERROR_STATE : ht_store_forget(l->setup.store, l->drive);
}

/* The reply to a SAVE or FORGET tells a memory that fails from none at all. */
static uint16_t stored(ht_service *l, ht_result result)
{
    if ((result == HT_ERROR_STORE) && (l->setup.store != NULL)
        && (l->setup.store->port.read != NULL)) {
        l->detail = 0u;
    }
    return (uint16_t)result;
}

uint16_t ht_request_save(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    return (n != 0u) ? (uint16_t)HT_SERVICE_LENGTH : stored(l, ht_service_keep(l));
}

uint16_t ht_request_forget(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    return (n != 0u) ? (uint16_t)HT_SERVICE_LENGTH : stored(l, ht_service_forget(l));
}

uint16_t ht_request_forget_log(ht_service *l, const uint16_t *in, uint16_t n)
{
    (void)in;
    if (n != 0u) {
        return HT_SERVICE_LENGTH;
    }
    return (l->setup.log != NULL) ? (uint16_t)ht_log_forget(l->setup.log, l->drive)
                                  : (uint16_t)HT_ERROR_STORE;
}
