/* Fuzz target: frames in and out (firmware/link/ht_packet.c, ht_octets.c) against the reference.
 * The first octet of an input gives the meaning of the others. */
#include <stdbool.h>
#include <string.h>

#include "check.h"
#include "ht_octets.h"
#include "ht_packet.h"
#include "reference.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Any octets. The receiver loses some before octet `lost`. */
static void take(const uint8_t *data, size_t n, size_t lost)
{
    ht_incoming in;
    uint8_t body[REFERENCE_BODY + 4];
    size_t begin = 0; /* of the frame under way */
    bool bad = false;
    size_t i;
    size_t k;
    ht_incoming_reset(&in);
    for (i = 0; i < n; i++) {
        ht_incoming_status status;
        size_t length;
        if (i == lost) {
            ht_incoming_discard(&in);
            bad = true;
        }
        status = ht_incoming_take(&in, data[i]);
        CHECK(in.n <= HT_PACKET_BODY + HT_PACKET_CRC);
        if (data[i] != 0) {
            CHECK(status == HT_INCOMING_PART);
            continue;
        }
        length = bad ? 0 : reference_body(&data[begin], i - begin, body);
        if (length != 0) {
            CHECK(status == HT_INCOMING_WHOLE);
            CHECK(in.n == length);
            for (k = 0; k < length; k++) {
                CHECK(in.octet[k] == body[k]);
            }
            CHECK(ht_get32(&in.octet[length]) == reference_crc(body, length));
        } else {
            CHECK(status == ((bad || (i != begin)) ? HT_INCOMING_DAMAGED : HT_INCOMING_PART));
        }
        begin = i + 1;
        bad = false;
    }
}

/* A body through both encoders. Returns the frame's length. */
static size_t send(const uint8_t *body, size_t n, uint8_t frame[REFERENCE_FRAME])
{
    ht_packet p;
    ht_outgoing out;
    size_t length;
    size_t k;
    ht_packet_begin(&p);
    for (k = 0; k < n; k++) {
        ht_packet_add8(&p, (uint16_t)(body[k] | 0x5A00u)); /* a cell has room for more */
    }
    CHECK(!p.full && (p.n == n));
    ht_outgoing_set(&out, &p);
    length = reference_frame(body, n, frame);
    CHECK((length <= REFERENCE_FRAME) && (out.n == length) && (out.sent == 0) && (p.n == n));
    for (k = 0; k < length; k++) {
        CHECK(out.octet[k] == frame[k]);
    }
    return length;
}

static void there_and_back(const uint8_t *body, size_t n)
{
    uint8_t line[3 + REFERENCE_FRAME + REFERENCE_FRAME];
    size_t length = send(body, n, &line[3]);
    memcpy(line, "\1x", 3); /* the rest of another frame */
    memcpy(&line[3 + length], &line[3], length);
    take(line, 3 + length, (size_t)-1);
    take(&line[3], 2 * length, (size_t)-1);
}

/* A damaged frame: pairs of place and change, then the body. */
static void hit(const uint8_t *data, size_t n)
{
    uint8_t frame[REFERENCE_FRAME];
    size_t hits;
    size_t length;
    size_t k;
    if (n == 0) {
        return;
    }
    hits = 1 + data[0] % 8u;
    if ((n < 1 + 3 * hits + 2) || (n > 1 + 3 * hits + REFERENCE_BODY)) {
        return;
    }
    length = send(&data[1 + 3 * hits], n - 1 - 3 * hits, frame);
    for (k = 0; k < hits; k++) {
        const uint8_t *h = &data[1 + 3 * k];
        frame[(h[0] + 256u * h[1]) % length] ^= h[2];
    }
    take(frame, length, (size_t)-1);
}

/* A body that is filled beyond its end: pairs of kind and value. */
static void build(const uint8_t *data, size_t n)
{
    static ht_packet p;
    uint8_t expected[REFERENCE_BODY];
    char text[33];
    size_t length = 0;
    bool full = false;
    size_t i;
    size_t k;
    ht_packet_begin(&p);
    for (i = 0; i + 1 < n; i += 2) {
        uint32_t value = data[i + 1] * 0x01020305u;
        size_t width = 1u << (data[i] % 3u);
        if (data[i] % 4u == 3u) {
            width = 1;
            memset(text, data[i + 1] | 1, data[i] % 32u);
            text[data[i] % 32u] = '\0';
            for (k = 0; text[k] != '\0'; k++) {
                if (length < REFERENCE_BODY) {
                    expected[length++] = (uint8_t)text[k];
                } else {
                    full = true;
                }
            }
            value = 0;
            ht_packet_add_text(&p, text);
        } else if (width == 1) {
            ht_packet_add8(&p, (uint16_t)value);
        } else if (width == 2) {
            ht_packet_add16(&p, (uint16_t)value);
        } else {
            ht_packet_add32(&p, value);
        }
        if (length + width <= REFERENCE_BODY) {
            for (k = 0; k < width; k++) {
                expected[length++] = (uint8_t)(value >> (8 * k));
            }
        } else {
            full = true;
        }
        CHECK((p.n == length) && (p.full == full));
    }
    for (k = 0; k < length; k++) {
        CHECK(p.octet[k] == expected[k]);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 3) {
        return 0;
    }
    switch (data[0] % 5u) {
    case 0:
        take(&data[1], size - 1, (size_t)-1);
        break;
    case 1:
        take(&data[2], size - 2, data[1]);
        break;
    case 2:
        there_and_back(&data[1], (size - 1 < REFERENCE_BODY) ? (size - 1) : REFERENCE_BODY);
        break;
    case 3:
        hit(&data[1], size - 1);
        break;
    default:
        build(&data[1], size - 1);
        break;
    }
    return 0;
}
