/** @file ht_xcp_daq.h
 *  XCP's data acquisition: lists that the master puts together. A list is bound to an event. Each
 *  time that it is due, the fast interrupt puts all its values into a ring, or none, and the
 *  background takes them out as packets. There is one writer and one reader, so no lock is needed.
 */
#ifndef HT_XCP_DAQ_H
#define HT_XCP_DAQ_H

#include "ht_streams.h"
#include "ht_xcp_frames.h"

#define HT_XCP_LISTS 8u
#define HT_XCP_ODTS 32u /**< packets of all lists; their number is the packet's first octet */
#define HT_XCP_ENTRIES 128u
#define HT_XCP_ODT_ENTRIES 32u /**< values of a packet, so that a time fits beside them */
#define HT_XCP_RING 1024u      /**< values; a power of two */

/** Events: the fast interrupt, and the first fast one after a slow interrupt. */
enum { HT_XCP_EVENT_FAST = 0, HT_XCP_EVENT_SLOW = 1, HT_XCP_EVENTS = 2 };

/** The latest allocation: the order is lists, their packets, these packets' values. */
enum { HT_XCP_NO_LISTS = 0, HT_XCP_HAS_LISTS = 1, HT_XCP_HAS_ODTS = 2, HT_XCP_HAS_ENTRIES = 3 };

/** No value yet: an entry that was not written. */
#define HT_XCP_NOTHING 0xFFFFu

typedef struct {
    volatile uint16_t running; /**< the interrupt uses the other members only if set */
    volatile uint16_t event;
    volatile uint16_t prescaler;
    volatile uint16_t left;  /**< events until the next sample */
    volatile uint16_t first; /**< packet */
    volatile uint16_t n;     /**< packets */
    volatile uint16_t size;  /**< of a sample in the ring */
    uint16_t selected;
    uint16_t begins; /**< once the answer is sent */
} ht_xcp_list;

typedef struct {
    volatile uint16_t first; /**< entry */
    volatile uint16_t n;
} ht_xcp_odt;

typedef struct {
    uint16_t stage; /**< HT_XCP_NO_LISTS ... */
    uint16_t lists;
    uint16_t odts;
    uint16_t entries;
    ht_xcp_list list[HT_XCP_LISTS];
    ht_xcp_odt odt[HT_XCP_ODTS];
    volatile uint16_t entry[HT_XCP_ENTRIES]; /**< an id of the source, or HT_XCP_NOTHING */
    volatile uint16_t head;                  /**< next value to write */
    volatile uint16_t tail;                  /**< next value to read */
    volatile uint16_t overload;              /**< 1: a sample found no room since the last look */
    volatile uint32_t ring[HT_XCP_RING];
} ht_xcp_daq;

/** Stop all lists and forget them, with what they have measured. */
void ht_xcp_daq_free(ht_xcp_daq *a);

/* Allocate; HT_XCP_OK or an error (ht_xcp_codes.h). */
uint16_t ht_xcp_daq_alloc_lists(ht_xcp_daq *a, uint16_t n);
uint16_t ht_xcp_daq_alloc_odts(ht_xcp_daq *a, uint16_t list, uint16_t n);
uint16_t ht_xcp_daq_alloc_entries(ht_xcp_daq *a, uint16_t list, uint16_t odt, uint16_t n);

/** Place of an entry in `entry`; HT_XCP_NOTHING if there is none. */
uint16_t ht_xcp_daq_place(const ht_xcp_daq *a, uint16_t list, uint16_t odt, uint16_t entry);
/** True if the list has packets, each of them has entries, and all of these were written. */
bool ht_xcp_daq_complete(const ht_xcp_daq *a, uint16_t list);
/** Octets on the line of one sample of a list. */
uint32_t ht_xcp_daq_octets(const ht_xcp_daq *a, uint16_t list, bool sum);

/** Background: begin a complete list. The next event takes the first sample. */
void ht_xcp_daq_begin(ht_xcp_daq *a, uint16_t list);
/** Background: end a list. No sample of it comes out any more. */
void ht_xcp_daq_end(ht_xcp_daq *a, uint16_t list);
bool ht_xcp_daq_any(const ht_xcp_daq *a);

/** Fast interrupt: take the samples that are due. `slow`: so is the slow event. */
void ht_xcp_daq_sample(ht_xcp_daq *a, const ht_source *source, uint32_t time, bool slow);

/** Background: the oldest packet. False if there is none. */
bool ht_xcp_daq_next(ht_xcp_daq *a, ht_xcp_packet *p);

#endif
