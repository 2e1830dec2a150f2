/** @file ht_service_requests.h
 *  The requests of docs/protocol.md, carried out: for ht_service.c, which receives them and
 *  sends the replies. Nothing in here calls back into that file.
 */
#ifndef HT_SERVICE_REQUESTS_H
#define HT_SERVICE_REQUESTS_H

#include "ht_service.h"

/** Tenths of the line that streams may take. The rest is for everything else. */
#define HT_SERVICE_STREAM_TENTHS 9u

/** Carry out the request `octets[0 .. n - 1]`, a body without its CRC, into `l->reply`. */
void ht_service_execute(ht_service *l, const uint16_t *octets, uint16_t n);

/** Fast interrupts that the watchdog waits, at least 1. */
uint32_t ht_service_watchdog_ticks(const ht_service *l);

#endif
