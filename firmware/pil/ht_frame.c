#include "ht_frame.h"

#define TYPE_MASK 0x00FFu
#define OCTET_MASK 0x00FFu
#define LAST 0x8000u /* `have` of a frame that was handed out */

/* A sum modulo 65535, up to the choice between 0 and 65535. */
static uint32_t fold(uint32_t sum)
{
    return (sum & 0xFFFFu) + (sum >> 16);
}

/* Words after which the larger sum, from 0xFFFF on, might not fit any more. */
#define FLETCHER_BLOCK 350u

uint32_t ht_fletcher(uint32_t sum, const uint16_t *words, uint16_t n)
{
    const uint16_t *next = words;
    const uint16_t *end = words + n;
    uint32_t a = sum & 0xFFFFu;
    uint32_t b = sum >> 16;
    while (next != end) {
        const uint16_t *stop = ((end - next) > (int)FLETCHER_BLOCK) ? (next + FLETCHER_BLOCK) : end;
        while (next != stop) {
            a += *next;
            b += a;
            next++;
        }
        a = fold(fold(a));
        b = fold(fold(b));
    }
    a = (a == 0xFFFFu) ? 0u : a;
    b = (b == 0xFFFFu) ? 0u : b;
    return (b << 16) | a;
}

void ht_frame_begin(ht_frame *f, uint16_t type, uint16_t number)
{
    f->word[0] = HT_FRAME_SYNC;
    f->word[1] = 0u;
    f->word[2] = (uint16_t)((type & TYPE_MASK) | (uint16_t)(number << 8));
}

void ht_frame_add(ht_frame *f, uint16_t word)
{
    if (f->word[1] < HT_FRAME_PAYLOAD) {
        f->word[HT_FRAME_HEAD + f->word[1]] = word;
        f->word[1]++;
    }
}

void ht_frame_add32(ht_frame *f, uint32_t value)
{
    ht_frame_add(f, (uint16_t)(value & 0xFFFFu));
    ht_frame_add(f, (uint16_t)(value >> 16));
}

/* The bits of a float: the same IEEE single on every target. */
typedef union {
    float value;
    uint32_t bits;
} float_bits;

void ht_frame_add_float(ht_frame *f, float value)
{
    float_bits u;
    u.value = value;
    ht_frame_add32(f, u.bits);
}

/* Words before the checksum, sync included. */
static uint16_t body(const ht_frame *f)
{
    return (uint16_t)(HT_FRAME_HEAD + f->word[1]);
}

static uint32_t checksum(const ht_frame *f)
{
    return ht_fletcher(0u, &f->word[1], (uint16_t)(body(f) - 1u));
}

uint16_t ht_frame_end(ht_frame *f)
{
    uint16_t end = body(f);
    uint32_t sum = checksum(f);
    f->word[end] = (uint16_t)(sum & 0xFFFFu);
    f->word[end + 1u] = (uint16_t)(sum >> 16);
    return (uint16_t)(2u * (end + HT_FRAME_SUM));
}

unsigned char ht_frame_octet(const ht_frame *f, uint16_t index)
{
    uint16_t word = f->word[index >> 1];
    return (unsigned char)(((index & 1u) != 0u) ? (word >> 8) : (word & OCTET_MASK));
}

void ht_frame_reset(ht_frame *f)
{
    f->have = 0u;
}

/* Look at what came in so far, after an even number of octets. */
static ht_frame_status judge(ht_frame *f)
{
    uint16_t words = (uint16_t)(f->have >> 1);
    if (words < HT_FRAME_HEAD) {
        if ((words == 2u) && (f->word[1] > HT_FRAME_PAYLOAD)) {
            f->have = 0u;
            return HT_FRAME_BROKEN;
        }
        return HT_FRAME_PART;
    }
    if (words < (uint16_t)(body(f) + HT_FRAME_SUM)) {
        return HT_FRAME_PART;
    }
    if (checksum(f) != ht_frame_32(&f->word[body(f)])) {
        f->have = 0u;
        return HT_FRAME_BROKEN;
    }
    f->have = LAST;
    return HT_FRAME_WHOLE;
}

ht_frame_status ht_frame_take(ht_frame *f, const unsigned char *octets, uint16_t n, uint16_t *used)
{
    ht_frame_status status = HT_FRAME_PART;
    uint16_t i = 0u;
    if (f->have == LAST) {
        f->have = 0u;
    }
    while ((i < n) && (status == HT_FRAME_PART)) {
        uint16_t octet = (uint16_t)(octets[i] & OCTET_MASK);
        i++;
        if ((f->have & 1u) != 0u) {
            uint16_t word = (uint16_t)(f->word[f->have >> 1] | (uint16_t)(octet << 8));
            f->word[f->have >> 1] = word;
            f->have++;
            if ((f->have == 2u) && (word != HT_FRAME_SYNC)) { /* hunting; this one may begin it */
                f->have = (octet == (HT_FRAME_SYNC & OCTET_MASK)) ? 1u : 0u;
                f->word[0] = octet;
            } else {
                status = judge(f);
            }
        } else if ((f->have != 0u) || (octet == (HT_FRAME_SYNC & OCTET_MASK))) {
            f->word[f->have >> 1] = octet;
            f->have++;
        } else {
            /* between frames: not a beginning */
        }
    }
    *used = i;
    return status;
}

uint16_t ht_frame_type(const ht_frame *f)
{
    return (uint16_t)(f->word[2] & TYPE_MASK);
}

uint16_t ht_frame_number(const ht_frame *f)
{
    return (uint16_t)(f->word[2] >> 8);
}

uint16_t ht_frame_length(const ht_frame *f)
{
    return f->word[1];
}

const uint16_t *ht_frame_payload(const ht_frame *f)
{
    return &f->word[HT_FRAME_HEAD];
}

uint32_t ht_frame_32(const uint16_t *words)
{
    return words[0] | ((uint32_t)words[1] << 16);
}

float ht_frame_float(const uint16_t *words)
{
    float_bits u;
    u.bits = ht_frame_32(words);
    return u.value;
}
