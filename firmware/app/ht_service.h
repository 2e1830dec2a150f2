/** @file ht_service.h
 *  One drive on a serial line (docs/protocol.md): requests, streams, captures, and the
 *  watchdog that stops a drive whose host has gone.
 *
 *  Who may send: streams are promised nine tenths of the line, so samples go first, or a flood
 *  of requests would fill the line with replies and the samples' ring would run over. A reply
 *  goes out as soon as no sample waits, and at the latest when samples that overtook it have
 *  taken nine times its length: so it comes through on a line that is slower than it says, and
 *  replies never take more than their tenth from streams. The ring holds more than what comes
 *  together meanwhile: the largest reply, on its way when the first sample comes, and one sample
 *  of each stream. A stream begins when the reply to its STREAM is under way: its samples never
 *  overtake that. Data of a capture goes when neither waits. None of this delays a STOP, which
 *  acts when it arrives.
 *
 *  Concurrency: `ht_service_fast` runs in the fast interrupt, after the drive; everything
 *  else in the background, which the interrupt may interrupt anywhere.
 */
#ifndef HT_SERVICE_H
#define HT_SERVICE_H

#include "ht_burst.h"
#include "ht_drive.h"
#include "ht_line.h"
#include "ht_opcodes.h"
#include "ht_packet.h"
#include "ht_store.h"
#include "ht_streams.h"

#define HT_SERVICE_VERSION 2u
#define HT_SERVICE_WRITE 80u /**< parameters of one WRITE */
#define HT_SERVICE_REQUEST_HEAD 6u /**< octets of a request before its payload */
#define HT_SERVICE_REPLY_HEAD 10u /**< octets of a reply before its payload */

/** The watchdog's time on a board. */
enum { HT_SERVICE_WATCHDOG_MS = 250 };

/** Status of a reply; smaller ones are ht_result. */
enum {
    HT_SERVICE_OPCODE = 16,
    HT_SERVICE_LENGTH = 17,
    HT_SERVICE_SESSION = 18,
    HT_SERVICE_DICTIONARY = 19,
    HT_SERVICE_BUSY = 20,
    HT_SERVICE_BUDGET = 21,
    HT_SERVICE_CAPTURE = 22,
    HT_SERVICE_NO_STREAM = 23, /**< all streams are in use */
    HT_SERVICE_FIELD = 24,     /**< a field of the payload is out of range */
    HT_SERVICE_MEMORY = 25,    /**< the capture is larger than the memory */
    HT_SERVICE_SAMPLING = 26   /**< f_isr_Hz stays while it is counted in */
};

typedef struct {
    const char *device;
    const char *build;  /**< of the firmware */
    uint16_t watchdog_ms; /**< of the drive's time, 1 at least; a session lives for four of these */
    ht_line line;
    uint32_t *memory;   /**< for captures */
    uint32_t memory_size; /**< values */
    const ht_store *store; /**< of the parameters; NULL: none */
} ht_service_setup;

typedef struct {
    ht_drive *drive;
    ht_service_setup setup;
    uint32_t dictionary;        /**< its CRC */
    uint16_t write_id[HT_SERVICE_WRITE]; /**< of the WRITE in hand: too large for a stack */
    float write_value[HT_SERVICE_WRITE];
    ht_incoming in;
    ht_packet reply;            /**< to the latest request */
    ht_packet data;             /**< sample or values of a capture on its way out */
    ht_outgoing out;
    bool answered;              /**< `reply` is that of `last_crc` */
    bool reply_due;
    bool reply_waits;           /**< for the interrupt that takes the parameters over */
    uint32_t overtaken;         /**< octets of samples that went before the reply that is due */
    uint32_t last_crc;
    bool started;               /**< `start_crc` is the session's latest request, a START */
    uint32_t start_crc;
    uint32_t detail;            /**< of a refusal */
    uint32_t mark;              /**< the first that an OPEN has brought since the reset; 0: none */
    uint16_t session;           /**< 0: none */
    uint16_t asks;              /**< session of the request in hand */
    uint32_t session_tick;      /**< of its latest request */
    volatile uint16_t armed;    /**< the watchdog */
    volatile uint16_t fed;
    volatile uint32_t watchdog_left; /**< fast interrupts */
    volatile uint32_t watchdog_ticks;
    ht_streams streams;
    uint16_t begins;            /**< the stream that begins with the reply; HT_STREAMS: none */
    ht_stream_sample sample;    /**< on its way out */
    ht_burst burst;
    uint32_t read_at;           /**< of the capture: next value to send ... */
    uint32_t read_left;         /**< ... and how many */
    uint32_t damaged;           /**< frames */
    uint32_t overruns;          /**< of the receiver */
} ht_service;

/** `d` is set up. */
void ht_service_init(ht_service *l, ht_drive *d, const ht_service_setup *setup);

/** The fast interrupt, after `ht_drive_fast_isr`. */
void ht_service_fast(ht_service *l);

/** One turn of the background: takes what the line has, up to a FIFO's 16 octets,
 *  carries out at most one request, hands over what the line takes. */
void ht_service_turn(ht_service *l);

/** Fast interrupts that the watchdog waits. */
uint32_t ht_service_watchdog_ticks(const ht_service *l);
/** Fast interrupts per second: the PWM clock divided by whole counts, next to f_isr_Hz. */
float ht_service_rate_Hz(const ht_service *l);
/** Octets that streams may take in a second. */
uint32_t ht_service_budget(const ht_service *l);

/** Keep the parameters in force over a power-off, or forget those that are kept (ht_store.h):
 *  not while samples are streamed or captured, whose ticks stand still meanwhile. Blocks. */
ht_result ht_service_keep(const ht_service *l);
ht_result ht_service_forget(const ht_service *l);

/** Carry out the request `octets[0 .. n - 1]`, a body without its CRC, into `l->reply`. For
 *  the link itself. */
void ht_service_execute(ht_service *l, const uint16_t *octets, uint16_t n);

#endif
