/* Processor in the loop on the emulated board. */
#include "pil_server.h"

int main(void)
{
    static ht_pil_line line;
    ht_pil_line_reset(&line);
    return pil_server_run(&line);
}
