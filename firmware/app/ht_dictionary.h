/** @file ht_dictionary.h
 *  What the tables of parameters, channels, faults and states say, as payloads of LIST
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
    HT_LISTS = 4
};

/** Rows of a kind; 0 for an unknown one. */
uint16_t ht_dictionary_rows(uint16_t kind);
/** Append row `row`; ranges are those of the hardware behind `port`. False, and nothing
 *  added, if there is none. */
bool ht_dictionary_add(ht_packet *p, const ht_port *port, uint16_t kind, uint16_t row);
/** CRC-32 over all rows, which are made in `scratch`. */
uint32_t ht_dictionary_crc(ht_packet *scratch, const ht_port *port);

#endif
