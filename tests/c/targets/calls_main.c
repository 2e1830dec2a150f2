/* Processor in the loop in a process of this machine: a call target. */
#include <fcntl.h>
#include <unistd.h>

#include "ht_pil_line.h"

int main(void)
{
    static ht_pil_line line;
    int from_host = open("to_target", O_RDONLY);
    int to_host = open("from_target", O_WRONLY);
    unsigned char byte;
    ht_pil_line_reset(&line);
    while (read(from_host, &byte, 1) == 1) {
        if (ht_pil_line_take(&line, byte)) {
            unsigned char bytes[HT_PACKET_LINE];
            uint16_t i;
            for (i = 0u; i < line.out.n; i++) {
                bytes[i] = (unsigned char)line.out.octet[i];
            }
            if (write(to_host, bytes, line.out.n) != (ssize_t)line.out.n) {
                return 1;
            }
        }
    }
    return 0;
}
