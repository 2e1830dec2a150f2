/** @file ht_pil.h
 *  Processor in the loop: the drive on the target, the plant on the host. The host tells
 *  what the hardware would have latched, the target what its driver did to the
 *  hardware: changed registers (folder registers/) or calls (calls/). Protocol:
 *  docs/pil.md.
 */
#ifndef HT_PIL_H
#define HT_PIL_H

#include "ht_drive.h"
#include "ht_frame.h"
#include "ht_pil_side.h"

#define HT_PIL_VERSION 3u

/** Types of request; the reply to one has HT_PIL_REPLY set as well. */
enum {
    HT_PIL_HELLO = 1, /**< who is there: `ht_pil_identity` words */
    HT_PIL_INIT = 2,  /**< device, all parameters, more for calls: a new drive after reset */
    HT_PIL_STEP = 3,  /**< which interrupts */
    HT_PIL_START = 4,
    HT_PIL_STOP = 5,
    HT_PIL_CLEAR = 6,
    HT_PIL_SET = 7,      /**< parameter id, value */
    HT_PIL_GET = 8,      /**< parameter id; the reply's `value` */
    HT_PIL_SNAPSHOT = 9, /**< no payload; the reply: result, `ht_pil_snapshot_add` */
    HT_PIL_REPLY = 0x80,
    HT_PIL_BROKEN = 0xFF /**< the reply to a frame that did not arrive whole */
};

/** Interrupts of a STEP. */
enum { HT_PIL_FAST = 1, HT_PIL_SLOW = 2 };

/** Results of a request, after those of ht_result. */
enum { HT_PIL_REFUSED = 0x100 /**< malformed, unknown, or no INIT so far */ };

/** Payload of requests, in words, up to what the hardware did: all but HELLO, INIT and
 *  SNAPSHOT. */
enum { HT_PIL_ARGUMENT = 0, HT_PIL_VALUE = 1, HT_PIL_HARDWARE = 3 };

/** Payload of replies, in words; all but those to HELLO and SNAPSHOT. Telemetry channels follow, then
 *  register changes or calls. */
enum {
    HT_PIL_AT_RESULT = 0,
    HT_PIL_AT_STATE = 1,
    HT_PIL_AT_FAULTS = 2,
    HT_PIL_AT_CHANNELS = 3,   /**< their number */
    HT_PIL_AT_VALUE = 4,      /**< float, of GET */
    HT_PIL_AT_ACCESSES = 6,   /**< 32 bits: of the register file since INIT; 0: has none */
    HT_PIL_AT_VIOLATIONS = 8, /**< 32 bits: forbidden ones among them */
    HT_PIL_AT_DIGEST = 10,    /**< 32 bits: `ht_mirror_digest`, turn = the request's number */
    HT_PIL_AT_REST = 12
};

/** What an image has besides the drive; functions may be NULL. */
typedef struct {
    void (*begin)(void *at, ht_drive *drive); /**< INIT has made a new drive */
    void (*fast)(void *at); /**< in place of `ht_drive_fast_isr`, which it calls */
    void *at;
} ht_pil_image;

typedef struct {
    ht_drive drive;
    ht_port port;
    ht_pil_side side;
    bool ready;         /**< INIT succeeded */
    ht_pil_image image; /**< to be set after `ht_pil_reset` */
} ht_pil;

/** Before the first request. */
void ht_pil_reset(ht_pil *p);

/** Carry out a request and write the reply, closed. Returns its octets. */
uint16_t ht_pil_answer(ht_pil *p, const ht_frame *request, ht_frame *reply);

/** The reply to what `ht_frame_take` called broken. Returns its octets. */
uint16_t ht_pil_complain(ht_frame *reply);

/** Telemetry channels of the protocol: HT_PIL_CHANNELS at most. */
enum { HT_PIL_CHANNELS = 64 };

/** Version, parameters, channels, registers (of device 0; 0: calls), and 32 bits of checksum over the
 *  names of all parameters and channels: what both ends have to agree on. */
enum { HT_PIL_IDENTITY = 6 };
void ht_pil_identity(uint16_t *words);

/* What a target does about the hardware: `ht_pil_side` and these, of one of the two
 * folders. */

/** Registers that are told by number; 0: calls are told. */
uint16_t ht_side_registers(void);
/** Prepare `port` for a drive that is about to be initialised; `words`: the rest of INIT. */
bool ht_side_init(ht_pil_side *side, ht_port *port, uint16_t device, const uint16_t *words,
                  uint16_t n);
/** Take over what the host says of the hardware, before a request is carried out. */
bool ht_side_take(ht_pil_side *side, ht_port *port, const uint16_t *words, uint16_t n);
/** Append what the host is to know of the hardware, after the changes or calls: three
 *  32-bit words. */
void ht_side_status(ht_pil_side *side, const ht_port *port, ht_frame *reply);
/** Append the changes or calls. */
void ht_side_tell(ht_pil_side *side, ht_port *port, ht_frame *reply);

#endif
