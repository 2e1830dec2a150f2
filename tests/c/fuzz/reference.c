#include "reference.h"

uint32_t reference_crc(const uint8_t *octets, size_t n)
{
    uint32_t sum = 0xFFFFFFFFu;
    size_t i;
    int bit;
    for (i = 0; i < n; i++) {
        sum ^= octets[i];
        for (bit = 0; bit < 8; bit++) {
            sum = ((sum & 1u) != 0u) ? ((sum >> 1) ^ 0xEDB88320u) : (sum >> 1);
        }
    }
    return ~sum;
}

/* A block: its code, and up to 254 octets that are not zero. Each block except the longest stands
 * for a zero after it, but not the last block. */
size_t reference_frame(const uint8_t *body, size_t n, uint8_t *frame)
{
    uint8_t checked[REFERENCE_BODY + 4];
    uint32_t crc = reference_crc(body, n);
    size_t total = n + 4;
    size_t at = 0;
    size_t out = 0;
    size_t i;
    for (i = 0; i < total; i++) {
        checked[i] = (i < n) ? body[i] : (uint8_t)(crc >> (8 * (i - n)));
    }
    for (;;) {
        size_t length = 0;
        while ((at + length < total) && (length < 254) && (checked[at + length] != 0)) {
            length++;
        }
        frame[out++] = (uint8_t)(length + 1);
        for (i = 0; i < length; i++) {
            frame[out++] = checked[at + i];
        }
        at += length;
        if (at == total) {
            break;
        }
        if (length < 254) {
            at++; /* the zero */
        }
    }
    frame[out++] = 0;
    return out;
}

size_t reference_body(const uint8_t *octets, size_t n, uint8_t body[REFERENCE_BODY + 4])
{
    size_t at = 0;
    size_t out = 0;
    uint32_t crc;
    while (at < n) {
        size_t code = octets[at];
        size_t i;
        if ((code == 0) || (at + code > n)) {
            return 0;
        }
        for (i = 1; i < code; i++) {
            if (out == REFERENCE_BODY + 4) {
                return 0;
            }
            body[out++] = octets[at + i];
        }
        at += code;
        if ((code != 255) && (at < n)) {
            if (out == REFERENCE_BODY + 4) {
                return 0;
            }
            body[out++] = 0;
        }
    }
    if (out < 6) {
        return 0;
    }
    out -= 4;
    crc = body[out] | ((uint32_t)body[out + 1] << 8) | ((uint32_t)body[out + 2] << 16)
          | ((uint32_t)body[out + 3] << 24);
    return (crc == reference_crc(body, out)) ? out : 0;
}
