/** @file ht_pil_host.h
 *  The host's end of processor in the loop, and a log of the registers. The simulation calls these
 *  functions, which take one handle, in place of the drive's own.
 */
#ifndef HT_PIL_HOST_H
#define HT_PIL_HOST_H

#include "ht_pil_calls.h"
#include "ht_pil_line.h"

/** Words of an image: all registers of the mirror, then accesses (32 bits) and
 *  violations (32 bits) of the register file. */
#define HT_IMAGE_EXTRA 4

/** Keeps what the registers hold after every period. */
typedef struct {
    uint16_t *image;   /**< rows of `width` words, in the caller's memory; NULL: none */
    uint32_t capacity; /**< rows */
    uint32_t rows;     /**< filled so far */
    uint32_t width;
} ht_log;

/** A drive on the host, watched. */
typedef struct {
    ht_drive *drive;
    ht_regfile *registers;
    ht_mirror mirror;
    ht_log log;
} ht_watch;

/** Begin with a drive that has just been initialised. */
void ht_watch_init(ht_watch *w, ht_drive *d, ht_regfile *registers);
/** Entry points: fast and slow interrupt, telemetry channels. The last one ends the
 *  period and logs it. */
void ht_watch_fast(ht_watch *w);
void ht_watch_slow(ht_watch *w);
void ht_watch_channels(ht_watch *w, float *out);

/** Why a link is down. It stays down: requests then return at once. */
typedef enum {
    HT_LINK_UP = 0,
    HT_LINK_SILENT = 1,  /**< no reply in time */
    HT_LINK_CLOSED = 2,  /**< the target ended or closed its side */
    HT_LINK_BROKEN = 3,  /**< a frame did not arrive whole, here or there */
    HT_LINK_ANSWER = 4,  /**< a reply to something else, or malformed */
    HT_LINK_REFUSED = 5, /**< the target does not take such a request */
    HT_LINK_PARTED = 6   /**< host and target see different hardware */
} ht_link_error;

/** A drive on a target. */
typedef struct {
    ht_regfile registers; /**< the plant's side of the target's registers */
    ht_mirror mirror;
    ht_log log;
    ht_port port;       /**< driver that makes a call target's calls */
    uint16_t calls;     /**< 1: call target, 0: register target */
    ht_pil_line *local; /**< a target in this process, or NULL */
    int to_target;      /**< file descriptors, if not local */
    int from_target;
    int timeout_ms;
    uint32_t heard;  /**< bytes that came since the latest request */
    uint16_t error;  /**< ht_link_error */
    uint16_t number; /**< of the latest request */
    uint16_t result; /**< what follows: of the latest reply */
    uint16_t state;
    uint32_t faults;
    float value;
    float told[HT_PIL_CHANNELS];     /**< channels as the latest reply left them */
    float channels[HT_PIL_CHANNELS]; /**< channels as they are recorded */
    uint32_t flip_request; /**< byte, from 1, of the next request's frame to damage; 0: none */
    ht_packet request;
    ht_outgoing out;
    ht_incoming reply;
    unsigned char bytes[HT_PACKET_LINE];
} ht_link;

/** Rate of a board's serial line unless it is built for another one, baud. */
uint32_t ht_link_baud(void);

/** Forget everything but the connection. */
void ht_link_reset(ht_link *l);
/** HELLO, the first request. The reply says what kind of target it is. */
void ht_link_hello(ht_link *l, ht_pil_identity *identity);
/** A new drive; registers start from reset on both sides. */
void ht_link_init(ht_link *l, uint16_t device, const ht_params *p);
/** STEP, START, STOP, CLEAR, SET or GET. `argument`: interrupts of STEP, parameter's id of SET
 *  and GET. `result`, `value` and the rest of the link hold the reply. */
void ht_link_request(ht_link *l, uint16_t opcode, uint16_t argument, float value);
/** Read the target's snapshot of its latest fault. This does not affect drive and hardware. */
void ht_link_snapshot(ht_link *l, ht_snapshot *s);
/** Entry points, as those of `ht_watch`. */
void ht_link_fast(ht_link *l);
void ht_link_slow(ht_link *l);
void ht_link_channels(ht_link *l, float *out);
/** Slow interrupt of a target that has streams and captures of its own. The channels stay as they
 *  were at the end of the fast interrupt, because streams and captures are made of these. */
void ht_link_slow_unseen(ht_link *l);

#endif
