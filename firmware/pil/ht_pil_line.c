#include "ht_pil_line.h"

void ht_pil_line_reset(ht_pil_line *l)
{
    ht_pil_reset(&l->pil);
    ht_incoming_reset(&l->in);
    l->out.n = 0u;
    l->out.sent = 0u;
}

bool ht_pil_line_take(ht_pil_line *l, uint16_t octet)
{
    switch (ht_incoming_take(&l->in, octet)) {
    case HT_INCOMING_WHOLE:
        ht_pil_answer(&l->pil, l->in.octet, l->in.n, &l->reply);
        break;
    case HT_INCOMING_DAMAGED:
        ht_pil_complain(&l->reply);
        break;
    case HT_INCOMING_PART:
    default:
        return false;
    }
    ht_outgoing_set(&l->out, &l->reply);
    return true;
}
