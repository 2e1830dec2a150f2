#include "ht_pil_server.h"

#include "ht_pil.h"

#define OCTET 0x00FFu

static ht_pil pil;
static ht_frame request;
static ht_frame reply;
static uint16_t reply_octets;
static uint16_t reply_sent;

void ht_pil_server_reset(void)
{
    ht_pil_reset(&pil);
    ht_frame_reset(&request);
    reply_octets = 0u;
    reply_sent = 0u;
}

void ht_pil_server_take(uint16_t octet)
{
    unsigned char one = (unsigned char)(octet & OCTET);
    uint16_t used;
    ht_frame_status status = ht_frame_take(&request, &one, 1u, &used);
    if (status == HT_FRAME_WHOLE) {
        reply_octets = ht_pil_answer(&pil, &request, &reply);
        reply_sent = 0u;
    } else if (status == HT_FRAME_BROKEN) {
        reply_octets = ht_pil_complain(&reply);
        reply_sent = 0u;
    } else {
        /* more to come */
    }
}

bool ht_pil_server_give(uint16_t *octet)
{
    bool waiting = reply_sent < reply_octets;
    if (waiting) {
        *octet = ht_frame_octet(&reply, reply_sent);
    }
    return waiting;
}

void ht_pil_server_sent(void)
{
    reply_sent++;
}

void ht_pil_server_forget(void)
{
    ht_frame_reset(&request);
}
