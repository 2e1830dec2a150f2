#include "pil_server.h"
#include "semihost.h"

int pil_server_run(ht_pil *pil)
{
    static ht_frame request;
    static ht_frame reply;
    static unsigned char octets[1024];
    int32_t from_host = semihost_open("to_target", SEMIHOST_READ);
    int32_t to_host = semihost_open("from_target", SEMIHOST_WRITE);
    uint32_t n;
    if ((from_host < 0) || (to_host < 0)) {
        return EXIT_FILE;
    }
    ht_frame_reset(&request);
    while ((n = semihost_read(from_host, octets, (uint32_t)sizeof octets)) != 0u) {
        uint16_t done = 0u;
        while (done < (uint16_t)n) {
            uint16_t used;
            uint16_t size = 0u;
            ht_frame_status status =
                ht_frame_take(&request, &octets[done], (uint16_t)(n - done), &used);
            done = (uint16_t)(done + used);
            if (status == HT_FRAME_WHOLE) {
                size = ht_pil_answer(pil, &request, &reply);
            } else if (status == HT_FRAME_BROKEN) {
                size = ht_pil_complain(&reply);
            } else {
                /* more to come */
            }
            /* Words lie in memory as on the wire: low octet first. */
            if ((size != 0u) && !semihost_write(to_host, reply.word, size)) {
                return EXIT_FILE;
            }
        }
    }
    return EXIT_OK;
}
