/* A chip's flash behind a fake of TI's API: a store_bench.h with counters of what happened. */
#ifndef FAKE_FLASH_H
#define FAKE_FLASH_H

#include "store_bench.h"

extern unsigned fake_flash_broken;  /* rules of the API or the flash that a caller broke */
extern const char *fake_flash_rule; /* the latest */
extern bool fake_flash_stuck;       /* planted: an erase never ends */
extern bool fake_flash_slow;        /* erases take longer than the watchdog waits */
extern ht_regfile *fake_flash_chip; /* the bench's own, unless set otherwise */
extern ht_port *fake_flash_port;
bool fake_flash_rest_is_untouched(void);

#endif
