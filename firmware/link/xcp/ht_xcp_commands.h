/** @file ht_xcp_commands.h
 *  One function for each command of XCP: the packet `in[0 .. n - 1]` goes in, HT_XCP_OK or an error
 *  comes out, the answer behind its first octet is appended to `x->reply`. For ht_xcp.c, which
 *  receives packets and sends answers.
 */
#ifndef HT_XCP_COMMANDS_H
#define HT_XCP_COMMANDS_H

#include "ht_xcp.h"
#include "ht_xcp_codes.h"

/** Carry out the packet `in[0 .. n - 1]`, n at least 1. True if there is an answer. */
bool ht_xcp_execute(ht_xcp *x, const uint16_t *in, uint16_t n);

/** True if the master is the link's host, or has become it now. */
bool ht_xcp_owns(ht_xcp *x);

/** Bit of a value's number that says: a parameter, not a channel. */
#define HT_XCP_PARAMETER 0x4000u

/** Number of the value that has the octet at `address`, HT_XCP_NOTHING if there is none. */
uint16_t ht_xcp_value_at(uint32_t address);
/** The value of this number, now; `object` is the drive. */
float ht_xcp_value(const void *object, uint16_t id);
/** The address of such a number. */
uint32_t ht_xcp_address_of(uint16_t id);

/* Calibration and pages: ht_xcp_memory.c */
uint16_t ht_xcp_set_mta(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_upload(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_short_upload(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_build_checksum(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_download(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_set_request(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_set_cal_page(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_get_cal_page(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_page_processor(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_segment(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_page(ht_xcp *x, const uint16_t *in);

/* Measuring: ht_xcp_measure.c */
uint16_t ht_xcp_free_daq(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_alloc_daq(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_alloc_odt(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_alloc_entry(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_clear_list(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_set_daq_ptr(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_write_daq(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_read_daq(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_set_list_mode(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_get_list_mode(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_start_stop_list(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_start_stop_all(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_clock(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_daq_processor(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_daq_resolution(ht_xcp *x, const uint16_t *in);
uint16_t ht_xcp_event(ht_xcp *x, const uint16_t *in);
/** Lists that were to begin with the answer begin. */
void ht_xcp_begin(ht_xcp *x);

#endif
