/* An image that keeps neither parameters nor a log: built without TI's flash API (docs/flash.md). */
#include "ht_image.h"

bool ht_image_memory(ht_port *port, ht_store_port *memory)
{
    (void)port;
    (void)memory;
    return false;
}

bool ht_image_log_memory(ht_port *port, ht_store_port *memory)
{
    (void)port;
    (void)memory;
    return false;
}
