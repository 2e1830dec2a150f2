/** @file ht_virtual_board.h
 *  A virtual board: drive and link on the register model, and on its SCI a line of a given speed,
 *  which the link shares with XCP. A second line, which a chip would have by a network's controller, is
 *  XCP's alone.
 *  Its time is the drive's: one call of `ht_virtual_fast` is one fast interrupt and the
 *  background that ran before it.
 */
#ifndef HT_VIRTUAL_BOARD_H
#define HT_VIRTUAL_BOARD_H

#include "ht_service.h"
#include "ht_port_c2000.h"
#include "ht_xcp.h"

#define HT_VIRTUAL_IN 8192u   /**< bytes on their way to the board, a power of two */
#define HT_VIRTUAL_OUT 65536u /**< bytes that the other end has not taken yet */
#define HT_VIRTUAL_CHANNELS 64u

/** Macros as enumerators: the host's interface has no macros. */
enum {
    HT_NUMBER_XCP_CHANNELS_AT = HT_XCP_CHANNELS_AT,
    HT_NUMBER_XCP_PARAMETERS_AT = HT_XCP_PARAMETERS_AT,
    HT_NUMBER_XCP_VALUE = HT_XCP_VALUE,
    HT_NUMBER_XCP_CTO = HT_XCP_CTO,
    HT_NUMBER_XCP_DTO = HT_XCP_DTO,
    HT_NUMBER_XCP_LISTS = HT_XCP_LISTS
};

#define HT_VIRTUAL_NET_OCTETS_PER_S 1250000u /**< of the second line, each way: 10 Mbit/s */

/** The traffic between a line and its other end. Counts are of octets, modulo 2^32. */
typedef struct {
    uint32_t in_head;
    uint32_t in_tail;
    uint32_t out_head;
    uint32_t out_tail;
    uint32_t lost; /**< that the other end took too late */
    uint16_t in[HT_VIRTUAL_IN];
    uint16_t out[HT_VIRTUAL_OUT];
} ht_virtual_line;

typedef struct {
    ht_drive *drive;
    ht_port *port;
    ht_service service;
    ht_reset reset;
    float channel[HT_VIRTUAL_CHANNELS]; /**< all, at the end of the latest fast interrupt */
    float credit_in;                    /**< bytes that may arrive now */
    float credit_out;
    float credit_net; /**< of the second line, to the other end */
    ht_virtual_line serial;
    ht_virtual_line net;
    ht_xcp xcp_serial;
    ht_xcp xcp_net;
} ht_virtual_board;

/** `d` is set up on `port`. `setup->line` is made here: the SCI at `baud`. False if it
 *  cannot do that. */
bool ht_virtual_init(ht_virtual_board *b, ht_drive *d, ht_port *port, const ht_service_setup *setup,
                     uint32_t baud);

void ht_virtual_fast(ht_virtual_board *b);
void ht_virtual_slow(ht_virtual_board *b);
/** Channels as they were at the end of the fast interrupt: what streams and captures see. */
void ht_virtual_channels(const ht_virtual_board *b, float *out);

/** A line's other end: put up to `n` bytes on it, returns how many found room; take up to `n`. */
uint32_t ht_virtual_put(ht_virtual_line *line, const uint16_t *octets, uint32_t n);
uint32_t ht_virtual_take(ht_virtual_line *line, uint16_t *octets, uint32_t n);

#endif
