/* Processor in the loop on the emulated board. */
#include "pil_server.h"

int main(void)
{
    static ht_pil pil;
    ht_pil_reset(&pil);
    return pil_server_run(&pil);
}
