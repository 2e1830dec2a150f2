/** @file ht_frame.h
 *  Frames of 16-bit words on a byte stream: sync, length, type and number, payload,
 *  checksum (docs/pil.md). Both ends use this code. An octet travels in an
 *  `unsigned char`, whatever its width.
 */
#ifndef HT_FRAME_H
#define HT_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#define HT_FRAME_SYNC 0x5AA5u
#define HT_FRAME_PAYLOAD 512u /* words at most */
#define HT_FRAME_HEAD 3u      /* words: sync, length, type and number */
#define HT_FRAME_SUM 2u       /* words: Fletcher-32 of all between sync and itself */

typedef struct {
    uint16_t have; /**< octets received so far */
    uint16_t word[HT_FRAME_HEAD + HT_FRAME_PAYLOAD + HT_FRAME_SUM];
} ht_frame;

/** What became of the octets received. */
typedef enum {
    HT_FRAME_PART = 0,  /**< more to come */
    HT_FRAME_WHOLE = 1, /**< a frame, checksum right */
    HT_FRAME_BROKEN = 2 /**< wrong checksum or length; waits for the next sync */
} ht_frame_status;

/** Begin a frame to send: type and number, no payload yet. */
void ht_frame_begin(ht_frame *f, uint16_t type, uint16_t number);
/** Append to the payload; nothing happens where it is full. */
void ht_frame_add(ht_frame *f, uint16_t word);
void ht_frame_add32(ht_frame *f, uint32_t value);
void ht_frame_add_float(ht_frame *f, float value);
/** Close it with the checksum. Returns the number of octets to send. */
uint16_t ht_frame_end(ht_frame *f);
/** Octet `index` of a closed frame. */
unsigned char ht_frame_octet(const ht_frame *f, uint16_t index);

/** Nothing received yet. */
void ht_frame_reset(ht_frame *f);
/** Receive octets, up to the end of a frame; `used` says how many that were. After
 *  WHOLE the frame stands until the next call. */
ht_frame_status ht_frame_take(ht_frame *f, const unsigned char *octets, uint16_t n, uint16_t *used);

uint16_t ht_frame_type(const ht_frame *f);
uint16_t ht_frame_number(const ht_frame *f);
/** Words of payload, and the payload. */
uint16_t ht_frame_length(const ht_frame *f);
const uint16_t *ht_frame_payload(const ht_frame *f);

/** Two words of a payload as one number. */
uint32_t ht_frame_32(const uint16_t *words);
float ht_frame_float(const uint16_t *words);

/** Fletcher-32 (modulo 65535) of `n` words, continued from `sum`; 0 to begin with. */
uint32_t ht_fletcher(uint32_t sum, const uint16_t *words, uint16_t n);

#endif
