/** @file ht_xcp_codes.h
 *  Numbers of ASAM's XCP, protocol layer 1: commands that this slave knows, its answers, its
 *  errors. Others are answered with HT_XCP_UNKNOWN.
 */
#ifndef HT_XCP_CODES_H
#define HT_XCP_CODES_H

/** First octet of a packet to the slave. */
enum {
    HT_XCP_CONNECT = 0xFF,
    HT_XCP_DISCONNECT = 0xFE,
    HT_XCP_GET_STATUS = 0xFD,
    HT_XCP_SYNCH = 0xFC,
    HT_XCP_GET_COMM_MODE_INFO = 0xFB,
    HT_XCP_GET_ID = 0xFA,
    HT_XCP_SET_REQUEST = 0xF9,
    HT_XCP_SET_MTA = 0xF6,
    HT_XCP_UPLOAD = 0xF5,
    HT_XCP_SHORT_UPLOAD = 0xF4,
    HT_XCP_BUILD_CHECKSUM = 0xF3,
    HT_XCP_USER_CMD = 0xF1,
    HT_XCP_DOWNLOAD = 0xF0,
    HT_XCP_SET_CAL_PAGE = 0xEB,
    HT_XCP_GET_CAL_PAGE = 0xEA,
    HT_XCP_GET_PAG_PROCESSOR_INFO = 0xE9,
    HT_XCP_GET_SEGMENT_INFO = 0xE8,
    HT_XCP_GET_PAGE_INFO = 0xE7,
    HT_XCP_CLEAR_DAQ_LIST = 0xE3,
    HT_XCP_SET_DAQ_PTR = 0xE2,
    HT_XCP_WRITE_DAQ = 0xE1,
    HT_XCP_SET_DAQ_LIST_MODE = 0xE0,
    HT_XCP_GET_DAQ_LIST_MODE = 0xDF,
    HT_XCP_START_STOP_DAQ_LIST = 0xDE,
    HT_XCP_START_STOP_SYNCH = 0xDD,
    HT_XCP_GET_DAQ_CLOCK = 0xDC,
    HT_XCP_READ_DAQ = 0xDB,
    HT_XCP_GET_DAQ_PROCESSOR_INFO = 0xDA,
    HT_XCP_GET_DAQ_RESOLUTION_INFO = 0xD9,
    HT_XCP_GET_DAQ_EVENT_INFO = 0xD7,
    HT_XCP_FREE_DAQ = 0xD6,
    HT_XCP_ALLOC_DAQ = 0xD5,
    HT_XCP_ALLOC_ODT = 0xD4,
    HT_XCP_ALLOC_ODT_ENTRY = 0xD3,
    HT_XCP_FIRST = HT_XCP_ALLOC_ODT_ENTRY /**< the smallest of them */
};

/** First octet of a packet from the slave. Below: the number of an ODT. */
enum { HT_XCP_RES = 0xFF, HT_XCP_ERR = 0xFE, HT_XCP_EV = 0xFD, HT_XCP_LAST_ODT = 0xFB };

/** Second octet of an event. */
enum { HT_XCP_EV_STORE_CAL = 0x03, HT_XCP_EV_DAQ_OVERLOAD = 0x06 };

/** Second octet of an error; OK is none. */
enum {
    HT_XCP_OK = 0xFF,
    HT_XCP_CMD_SYNCH = 0x00,
    HT_XCP_DAQ_ACTIVE = 0x11,
    HT_XCP_UNKNOWN = 0x20,
    HT_XCP_SYNTAX = 0x21,
    HT_XCP_OUT_OF_RANGE = 0x22,
    HT_XCP_WRITE_PROTECTED = 0x23,
    HT_XCP_ACCESS_DENIED = 0x24,
    HT_XCP_PAGE_NOT_VALID = 0x26,
    HT_XCP_MODE_NOT_VALID = 0x27,
    HT_XCP_SEGMENT_NOT_VALID = 0x28,
    HT_XCP_SEQUENCE = 0x29,
    HT_XCP_DAQ_CONFIG = 0x2A,
    HT_XCP_MEMORY_OVERFLOW = 0x30,
    HT_XCP_GENERIC = 0x31
};

#endif
