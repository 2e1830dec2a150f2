/** @file ht_dictionary.h
 *  The tables of parameters, channels, faults and states as payloads of the request LIST
 *  (docs/protocol.md).
 */
#ifndef HT_DICTIONARY_H
#define HT_DICTIONARY_H

#include "ht_packet.h"
#include "port.h"

enum {
    HT_LIST_PARAMETER = 0,
    HT_LIST_CHANNEL = 1,
    HT_LIST_FAULT = 2,
    HT_LIST_STATE = 3,
    HT_LISTS = 4, /**< kinds that HELLO counts and the CRC covers */
    /** One row with what has been added since version 2.0 of the protocol. A client of an earlier
     *  version does not ask for it. */
    HT_LIST_ADDITIONS = 4,
    /** Why the board started: one row of a board that knows it (ht_service.h), which is no table. */
    HT_LIST_RESET = 5,
    /** One row with all bits of the latched faults, and of the snapshot's: no table either. */
    HT_LIST_FAULTS = 6,
    /** Rows of the log (ht_log.h): one row of counters; a row for each event, the latest first. */
    HT_LIST_COUNTERS = 7,
    HT_LIST_EVENTS = 8,
    /** A row for each limit, and when it acted: not in the CRC either. */
    HT_LIST_LIMITS = 9
};

/** Minor version of the protocol, told by the row of additions; HT_SERVICE_VERSION is the major. */
#define HT_DICTIONARY_MINOR 5u

/** Rows of a kind; 0 for an unknown one. */
uint16_t ht_dictionary_rows(uint16_t kind);
/** Append row `row` of a kind, with the ranges of the hardware behind `port`. Returns false, and
 *  adds nothing, if there is no such row. */
bool ht_dictionary_add(ht_packet *p, const ht_port *port, uint16_t kind, uint16_t row);
/** CRC-32 over all rows of all kinds. Uses `scratch` to make them. */
uint32_t ht_dictionary_crc(ht_packet *scratch, const ht_port *port);

#endif
