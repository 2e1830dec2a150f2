/* Processor in the loop in a process of this machine: a target that tells calls. */
#include <fcntl.h>
#include <unistd.h>

#include "ht_pil.h"

int main(void)
{
    static ht_pil pil;
    static ht_frame request;
    static ht_frame reply;
    int from_host = open("to_target", O_RDONLY);
    int to_host = open("from_target", O_WRONLY);
    unsigned char octet;
    ht_pil_reset(&pil);
    ht_frame_reset(&request);
    while (read(from_host, &octet, 1) == 1) {
        uint16_t used;
        uint16_t size = 0u;
        uint16_t i;
        unsigned char octets[sizeof reply.word];
        ht_frame_status status = ht_frame_take(&request, &octet, 1u, &used);
        if (status == HT_FRAME_WHOLE) {
            size = ht_pil_answer(&pil, &request, &reply);
        } else if (status == HT_FRAME_BROKEN) {
            size = ht_pil_complain(&reply);
        }
        for (i = 0u; i < size; i++) {
            octets[i] = ht_frame_octet(&reply, i);
        }
        if ((size != 0u) && (write(to_host, octets, size) != (ssize_t)size)) {
            return 1;
        }
    }
    return 0;
}
