/** @file ht_pil_server.h
 *  The target's end of processor in the loop, byte by byte. One drive on one chip, so its state is
 *  static. It does not depend on the chip: ht_pil_chip.c has the drivers, this has the drive. Each
 *  has its own `struct ht_port`, so neither file includes the other's headers.
 */
#ifndef HT_PIL_SERVER_H
#define HT_PIL_SERVER_H

#include <stdbool.h>
#include <stdint.h>

/** Before the first byte. */
void ht_pil_server_reset(void);

/** A byte has come from the host. At the end of a request this carries it out. Not while a
 *  reply is waiting: one request at a time. */
void ht_pil_server_take(uint16_t octet);

/** True while a byte of a reply waits to be sent. It stays the same one until
 *  `ht_pil_server_sent`. */
bool ht_pil_server_give(uint16_t *octet);
void ht_pil_server_sent(void);

#endif
