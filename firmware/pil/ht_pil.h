/** @file ht_pil.h
 *  Processor in the loop: the drive runs on the target, the plant on the host. The host sends
 *  the readings that hardware would have latched; the target answers with its driver's changes.
 *  A register target (folder registers/) names the registers that changed, a call target
 *  (folder calls/) the calls of port.h that the drive made. Protocol: docs/pil.md.
 */
#ifndef HT_PIL_H
#define HT_PIL_H

#include "ht_drive.h"
#include "ht_opcodes.h"
#include "ht_packet.h"
#include "ht_pil_side.h"
#include "ht_reader.h"

#define HT_PIL_VERSION 12u

/** Telemetry channels at most. */
enum { HT_PIL_CHANNELS = 64 };

/** Bytes before the payload. Request: opcode, number. Reply: opcode + HT_OP_REPLY, number of
 *  the request, result, state, faults (32 bits). */
enum { HT_PIL_REQUEST_HEAD = 2, HT_PIL_REPLY_HEAD = 8 };

/** Interrupts of a STEP. */
enum { HT_PIL_FAST = 1, HT_PIL_SLOW = 2 };

/** Results of a request, after those of ht_result. */
enum {
    HT_PIL_REFUSED = 16 /**< unknown request, wrong length, no INIT so far, reply too long */
};

/** The parts of an image besides the drive. Functions may be NULL. */
typedef struct {
    void (*begin)(void *at, ht_drive *drive); /**< INIT has made a new drive */
    void (*fast)(void *at);                   /**< replaces `ht_drive_fast_isr`, which it calls */
    void *at;
} ht_pil_image;

typedef struct {
    ht_drive drive;
    ht_port port;
    ht_pil_side side;
    bool ready;                     /**< INIT succeeded */
    uint32_t told[HT_PIL_CHANNELS]; /**< bits of the channels as the host knows them */
    ht_pil_image image;             /**< to be set after `ht_pil_reset` */
} ht_pil;

/** Before the first request. */
void ht_pil_reset(ht_pil *p);

/** Carry out the request `octets[0 .. n - 1]`, a body without its CRC, and make the reply. */
void ht_pil_answer(ht_pil *p, const uint16_t *octets, uint16_t n, ht_packet *reply);

/** The reply to a damaged frame. */
void ht_pil_complain(ht_packet *reply);

/** The agreement of both ends: the answer to HELLO. */
typedef struct {
    uint16_t version;   /**< HT_PIL_VERSION */
    uint16_t params;    /**< number of parameters */
    uint16_t channels;  /**< number of telemetry channels */
    uint16_t registers; /**< number of registers of device 0; 0: call target */
    uint32_t names;     /**< CRC-32 over the names of all parameters, then of all channels */
} ht_pil_identity;

void ht_pil_identify(ht_pil_identity *id);

/* The hardware's side of a target: `ht_pil_side` and these functions, of one of the two
 * folders. */

/** Number of registers of a register target; 0 for a call target. */
uint16_t ht_side_registers(void);
/** Prepare `port` for a drive that is about to be initialised. Reads the rest of INIT. */
bool ht_side_init(ht_pil_side *side, ht_port *port, uint16_t device, ht_reader *request);
/** Take over what the host says of the hardware, before a request is carried out. */
bool ht_side_take(ht_pil_side *side, ht_port *port, ht_reader *request);
/** Append what the driver did to the hardware; `number` is the request's. */
void ht_side_tell(ht_pil_side *side, ht_port *port, uint16_t number, ht_packet *reply);

#endif
