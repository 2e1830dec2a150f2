#include "ht_pil_server.h"

#include "ht_pil_line.h"

static ht_pil_line line;

void ht_pil_server_reset(void)
{
    ht_pil_line_reset(&line);
}

void ht_pil_server_take(uint16_t octet)
{
    (void)ht_pil_line_take(&line, octet);
}

bool ht_pil_server_give(uint16_t *octet)
{
    bool waiting = line.out.sent < line.out.n;
    if (waiting) {
        *octet = line.out.octet[line.out.sent];
    }
    return waiting;
}

void ht_pil_server_sent(void)
{
    line.out.sent++;
}
