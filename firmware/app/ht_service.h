/** @file ht_service.h
 *  One drive on a serial line: requests, sample streams, captures, and the watchdog that stops
 *  the drive when its host is gone. The protocol is docs/protocol.md.
 *
 *  Order of what is sent. Streams are promised nine tenths of the line. Therefore samples go
 *  before replies: otherwise a flood of requests would fill the line with replies, and the
 *  samples' ring would overflow. A reply is sent as soon as no sample waits. At the latest it is
 *  sent when the samples that overtook it have nine times its length: then it gets through even
 *  on a line that is slower than it claims to be, and replies never take more than their tenth.
 *  Data of a capture is sent when neither a sample nor a reply waits.
 *
 *  The ring has room for what can pile up meanwhile: the largest reply is being sent when the
 *  first sample comes, and one sample of each other stream follows. A stream begins once the
 *  reply to its STREAM is being sent, so no sample comes before that reply.
 *
 *  A STOP acts when it arrives. Nothing of the above delays it.
 *
 *  Concurrency: `ht_service_fast` runs in the fast interrupt, after the drive. Everything else
 *  runs in the background, and the interrupt may come at any point of it.
 */
#ifndef HT_SERVICE_H
#define HT_SERVICE_H

#include "ht_burst.h"
#include "ht_drive.h"
#include "ht_line.h"
#include "ht_log.h"
#include "ht_opcodes.h"
#include "ht_packet.h"
#include "ht_store.h"
#include "ht_streams.h"

#define HT_SERVICE_VERSION 2u
#define HT_SERVICE_GET 100u        /**< parameters of one GET */
#define HT_SERVICE_WRITE 80u       /**< parameters of one WRITE */
#define HT_SERVICE_REQUEST_HEAD 6u /**< bytes of a request before its payload */
#define HT_SERVICE_REPLY_HEAD 10u  /**< bytes of a reply before its payload */

/** First octet of a body that is no request: sample of stream 0, those of others follow; data of a
 *  capture. */
enum { HT_SERVICE_SAMPLE = 0x40, HT_SERVICE_DATA = 0x50 };

/** The watchdog's time on a board. */
enum { HT_SERVICE_WATCHDOG_MS = 250 };

/** Status of a reply (ht_results.def); smaller ones are ht_result. */
enum {
#define HT_RESULT(name, number, mistake, text)
#define HT_REFUSAL(name, number, mistake, text) HT_SERVICE_##name = (number),
#include "ht_results.def"
#undef HT_RESULT
#undef HT_REFUSAL
};

typedef struct {
    const char *device;
    const char *build;    /**< of the firmware */
    uint16_t watchdog_ms; /**< time without a request after which the drive trips, ms, at least 1;
                           *   after four times as long the session ends */
    ht_line line;
    uint32_t *memory;      /**< for captures */
    uint32_t memory_size;  /**< values */
    const ht_store *store; /**< of the parameters; NULL: none */
    ht_drive_log *log;     /**< of events; NULL: none */
    const ht_reset *reset; /**< the latest one; NULL: the board does not know it */
} ht_service_setup;

typedef struct {
    ht_drive *drive;
    ht_service_setup setup;
    uint32_t dictionary;                 /**< its CRC */
    uint16_t write_id[HT_SERVICE_WRITE]; /**< of the present WRITE: too large for a stack */
    float write_value[HT_SERVICE_WRITE];
    ht_incoming in;
    ht_packet reply; /**< to the latest request */
    ht_packet data;  /**< sample or values of a capture on its way out */
    ht_outgoing out;
    bool answered; /**< `reply` is that of `last_crc` */
    bool reply_due;
    bool reply_waits;   /**< until the fast interrupt has taken the parameters over */
    uint32_t overtaken; /**< bytes of samples that went before the reply that is due */
    uint32_t last_crc;
    bool started; /**< `start_crc` is the session's latest request, a START */
    uint32_t start_crc;
    uint32_t detail;         /**< of a refusal */
    uint32_t mark;           /**< sent by the first OPEN since the reset; 0: none yet */
    uint16_t session;        /**< 0: none */
    uint16_t asks;           /**< session that the present request names */
    uint32_t session_tick;   /**< of its latest request */
    volatile uint16_t armed; /**< 1: the watchdog runs */
    volatile uint16_t fed;   /**< 1: a request of the session has come since the last check */
    volatile uint32_t watchdog_left; /**< fast interrupts */
    volatile uint32_t watchdog_ticks;
    ht_streams streams;
    uint16_t begins;         /**< stream that begins when the reply is sent; HT_STREAMS: none */
    ht_stream_sample sample; /**< being sent */
    ht_burst burst;
    uint32_t read_at;   /**< of the capture: next value to send ... */
    uint32_t read_left; /**< ... and how many */
    uint32_t damaged;   /**< frames */
    uint32_t overruns;  /**< of the receiver */
} ht_service;

/** Prepare the link of a drive that is set up. */
void ht_service_init(ht_service *l, ht_drive *d, const ht_service_setup *setup);

/** The fast interrupt, after `ht_drive_fast_isr`. */
void ht_service_fast(ht_service *l);

/** One turn of the background: takes up to 16 bytes from the line, carries out the requests in
 *  them, and hands the line up to 16 bytes. Never waits. */
void ht_service_turn(ht_service *l);

/** Save the parameters in force, or erase the saved ones (ht_store.h). Refused while samples are
 *  streamed or captured: the ticks that date them would stand still meanwhile. Blocks. */
ht_result ht_service_keep(const ht_service *l);
ht_result ht_service_forget(const ht_service *l);

#endif
