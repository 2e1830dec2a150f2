#include "pil_server.h"
#include "semihost.h"

static int send(int32_t to_host, const ht_outgoing *out)
{
    unsigned char bytes[HT_PACKET_LINE];
    uint16_t i;
    for (i = 0u; i < out->n; i++) {
        bytes[i] = (unsigned char)out->octet[i];
    }
    return semihost_write(to_host, bytes, out->n);
}

int pil_server_run(ht_pil_line *line)
{
    static unsigned char bytes[HT_PACKET_LINE];
    int32_t from_host = semihost_open("to_target", SEMIHOST_READ);
    int32_t to_host = semihost_open("from_target", SEMIHOST_WRITE);
    uint32_t n;
    uint32_t i;
    if ((from_host < 0) || (to_host < 0)) {
        return EXIT_FILE;
    }
    while ((n = semihost_read(from_host, bytes, (uint32_t)sizeof bytes)) != 0u) {
        for (i = 0u; i < n; i++) {
            if (ht_pil_line_take(line, bytes[i]) && !send(to_host, &line->out)) {
                return EXIT_FILE;
            }
        }
    }
    return EXIT_OK;
}
