/** @file ht_store_port.h
 *  Memory that survives power-off, as the parameter store (ht_store.h) and the log (ht_log_ring.h)
 *  see one each: two areas of blocks of eight 16-bit words, as a flash has them. A target provides two functions for it; a
 *  target without such a memory provides none.
 *
 *  Who calls what, and when: `read` from the set-up and from the background; `write` from the
 *  background only, with interrupts enabled and with the gates off (state idle or fault).
 *
 *  Both block until they are done. `read` takes some microseconds. `write` of a block takes up
 *  to 1 ms, an erase of a flash sector up to seconds; interrupts may be held off all this time.
 *  A function that holds them off services the watchdog, and gives up after a limited time: a
 *  memory that never gets ready must end in a refusal or in a reset.
 *
 *  Power may fail at any instant. A block that was being written, or an area that was being erased,
 *  can then hold anything. All other blocks are as they were.
 */
#ifndef HT_STORE_PORT_H
#define HT_STORE_PORT_H

#include <stdbool.h>
#include <stdint.h>

#define HT_STORE_AREAS 2u       /**< each is erased separately */
#define HT_STORE_WORDS 8u       /**< of a block: what a flash takes at once */
#define HT_STORE_ERASED 0xFFFFu /**< a word of an erased area */

/** Both in a file (virtual and emulated boards): its head, the store's areas, the log's areas, low byte
 *  first. */
enum {
    HT_STORE_FILE_HEAD = 16,       /**< bytes before the areas */
    HT_STORE_FILE_AREAS = 2,       /**< as in memory */
    HT_STORE_FILE_BLOCKS = 128,    /**< of an area */
    HT_STORE_FILE_BLOCK = 16,      /**< bytes of a block */
    HT_STORE_FILE_LOG_BLOCKS = 512 /**< of an area of the log */
};

typedef struct {
    /** Read block `block` of area `area` into `words`. False: it cannot be read. From a block that
     *  was written in part or is damaged it may read anything, but it returns. */
    bool (*read)(void *at, uint16_t area, uint16_t block, uint16_t *words);
    /** Write a block that has not been written since its area was erased; `words` = NULL: erase the
     *  whole area, `block` does not matter. False: it failed, and the block (the area) can hold
     *  anything. */
    bool (*write)(void *at, uint16_t area, uint16_t block, const uint16_t *words);
    void *at;        /**< the calls' first argument */
    uint16_t blocks; /**< of an area */
} ht_store_port;

#endif
