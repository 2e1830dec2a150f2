/* Frames by their definition (docs/protocol.md), in the simplest way, for comparison. */
#ifndef REFERENCE_H
#define REFERENCE_H

#include <stddef.h>
#include <stdint.h>

#define REFERENCE_BODY 508u
#define REFERENCE_FRAME 516u /* with its closing zero */

uint32_t reference_crc(const uint8_t *octets, size_t n);

/* Body to frame, with its closing zero. Returns its length. */
size_t reference_frame(const uint8_t *body, size_t n, uint8_t *frame);

/* Decode the octets between two zeros, of any length, to a body. Returns the body's length, or 0 if
 * it is damaged. */
size_t reference_body(const uint8_t *octets, size_t n, uint8_t body[REFERENCE_BODY + 4]);

#endif
