/** @file ht_pil_server.h
 *  The target's end of processor in the loop, octet by octet. One drive on one chip, so
 *  its state is static. It knows no chip: ht_pil_chip.c has the drivers, this has the
 *  drive, and their two `ht_port` are different things.
 */
#ifndef HT_PIL_SERVER_H
#define HT_PIL_SERVER_H

#include <stdbool.h>
#include <stdint.h>

/** Before the first octet. */
void ht_pil_server_reset(void);

/** An octet has come from the host. At the end of a request this carries it out. Not while
 *  a reply is waiting: one request at a time. */
void ht_pil_server_take(uint16_t octet);

/** True while an octet of a reply waits to be sent. It stays the same one until
 *  `ht_pil_server_sent`. */
bool ht_pil_server_give(uint16_t *octet);
void ht_pil_server_sent(void);

/** No octet has come for a while: forget a request that began and did not end. */
void ht_pil_server_forget(void);

#endif
