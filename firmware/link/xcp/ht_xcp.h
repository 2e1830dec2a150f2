/** @file ht_xcp.h
 *  An XCP slave beside the link of a drive (ht_service.h, docs/xcp.md). An image that does not call
 *  it does not have it.
 *
 *  Addresses are virtual: parameters and channels by their number, each a float of four octets. No
 *  address reaches the memory. What a master writes goes through the checks of the link's WRITE.
 *
 *  Who may command. A master that reads or measures needs nothing. The first command that changes
 *  something takes the link's session, if it is free: from then on the master is the link's host, and
 *  each of its commands feeds the watchdog, as a request does. USER_CMD starts, stops and clears the
 *  drive by the link's opcodes; STOP needs no session.
 *
 *  The order of what is sent is the link's: samples first, until those that overtook an answer have
 *  nine times its length.
 *
 *  A line of its own, or one that it shares with the link: then a CONNECT gives the line to XCP, and a
 *  whole frame of the link's gives it back. The frame of a CONNECT cannot be part of what a host of the
 *  link sends: it has zeros where none can be.
 *
 *  Concurrency: `ht_xcp_fast` runs in the fast interrupt, after `ht_service_fast`. Everything else
 *  runs in the background.
 */
#ifndef HT_XCP_H
#define HT_XCP_H

#include "ht_service.h"
#include "ht_xcp_daq.h"

/** Virtual addresses: of number i of a table, its start + 4 i. */
#define HT_XCP_CHANNELS_AT 0x1000u
#define HT_XCP_PARAMETERS_AT 0x2000u
#define HT_XCP_VALUE 4u /**< octets */

/** Pages of the parameters: those in force; those that are kept, or else the built-in ones. */
enum { HT_XCP_WORKING = 0, HT_XCP_KEPT = 1, HT_XCP_PAGES = 2 };

/** Octets that pass at once. */
#define HT_XCP_FIFO 16u

/** The kinds of a line. */
enum {
    HT_XCP_NET = 0,   /**< its own, by TCP or UDP: nothing is damaged, so there is no sum */
    HT_XCP_SERIAL = 1 /**< serial, shared with the link: with a sum */
};

typedef struct {
    ht_service *service;
    ht_line line;
    bool serial;
    bool ours;      /**< the line carries XCP */
    bool connected; /**< a master is */
    bool reply_due;
    bool reply_waits;      /**< until the fast interrupt has taken the parameters over */
    bool link_first;       /**< the link sends the rest of a frame */
    uint16_t event;        /**< to be told; 0: none */
    uint16_t session;      /**< number that this master has as the link's host */
    uint16_t page;         /**< that the master reads */
    uint16_t counter;      /**< of the next frame */
    uint16_t detail;       /**< of an error: a number of ht_results.def; HT_OK: none */
    uint16_t pointer_list; /**< of the next WRITE_DAQ, as are the next two */
    uint16_t pointer_odt;
    uint16_t pointer_entry;
    uint16_t pending_n; /**< octets of a shared line that are still to be looked at */
    uint16_t pending[HT_XCP_FIFO];
    uint32_t damaged;            /**< the link's count, while octets on its line are not its own */
    uint32_t mta;                /**< address of the next transfer ... */
    const char *text;            /**< ... or a text, if it is not NULL */
    uint32_t overtaken;          /**< octets of samples that went before the answer that is due */
    uint32_t heard_tick;         /**< of the latest octet */
    volatile uint32_t time;      /**< since the first CONNECT, in microseconds, modulo 2^32 */
    float time_part;             /**< and the rest; the fast interrupt's, as is the next */
    volatile float us_per_count; /**< of the PWM; 0: there was no CONNECT yet */
    uint32_t slow_tick;          /**< of the latest slow interrupt that was noticed */
    ht_params kept;
    ht_xcp_incoming in;
    ht_xcp_packet reply;
    ht_xcp_packet data;
    ht_xcp_outgoing out;
    ht_xcp_daq daq;
} ht_xcp;

/** Prepare it before the link: `service` is that of the image, `line` the real one, `kind` one of
 *  HT_XCP_NET and HT_XCP_SERIAL. */
void ht_xcp_init(ht_xcp *x, ht_service *service, const ht_line *line, uint16_t kind);

/** The line that the link is given in place of the one that it shares. Its octets pass through
 *  `x`, in both directions. */
ht_line ht_xcp_shared(ht_xcp *x);

/** The fast interrupt, after `ht_service_fast`. */
void ht_xcp_fast(ht_xcp *x);

/** One turn of the background, after `ht_service_turn`. Never waits, but for a memory in which a
 *  master keeps parameters. */
void ht_xcp_turn(ht_xcp *x);

#endif
