/* The two functions of a memory in the chip's flash, for the parameter store and for the log. */
#include "ht_store_flash.h"

#include <stddef.h>

#include "ht_drivers.h"
#include "ht_image.h"

void ht_flash_serve(ht_port *port)
{
    ht_watchdog_first(port);
    ht_watchdog_second(port);
}

static uint32_t address_of(uint16_t area, uint16_t block)
{
    return ht_flash_area(area) + ((uint32_t)block * HT_STORE_WORDS);
}

static bool inside(uint16_t area, uint16_t block)
{
    return (area < HT_FLASH_AREAS)
           && ((((uint32_t)block + 1u) * HT_STORE_WORDS) <= ht_flash_area_words());
}

static bool read_area(ht_port *port, uint16_t area, uint16_t block, uint16_t *words)
{
    uint32_t address = address_of(area, block);
    uint16_t k;
    if (!inside(area, block)) {
        return false;
    }
    ht_flash_unchecked(port); /* it may be half programmed: the copy's own CRC tells */
    for (k = 0u; k < HT_STORE_WORDS; k++) {
        words[k] = ht_flash_word(address + k);
    }
    ht_flash_start(port);
    return true;
}

static bool write_area(ht_port *port, uint16_t area, uint16_t block, const uint16_t *words)
{
    bool good;
    if (!inside(area, block)) {
        return false;
    }
    ht_port_gates_off(port);
    HT_DINT(port->io);
    ht_flash_serve(port);
    ht_flash_unchecked(port);
    good = (words == NULL) ? ht_flash_erase(port, ht_flash_area(area))
                           : ht_flash_program(port, address_of(area, block), words);
    ht_flash_start(port); /* the flash can be read again, before anything is called in it */
    ht_flash_serve(port);
    /* A slow interrupt that was held off comes now; the next one a whole period after it, and not
     * with no fast one in between. */
    HT_WR16(port->io, HT_TIMER0 + HT_TCR, HT_TCR_WIND);
    HT_EINT(port->io);
    return good;
}

static bool read_block(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    return (area < HT_STORE_AREAS) && read_area((ht_port *)at, area, block, words);
}

static bool write_block(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    return (area < HT_STORE_AREAS) && write_area((ht_port *)at, area, block, words);
}

static bool read_log(void *at, uint16_t area, uint16_t block, uint16_t *words)
{
    return (area < HT_STORE_AREAS)
           && read_area((ht_port *)at, (uint16_t)(HT_STORE_AREAS + area), block, words);
}

static bool write_log(void *at, uint16_t area, uint16_t block, const uint16_t *words)
{
    return (area < HT_STORE_AREAS)
           && write_area((ht_port *)at, (uint16_t)(HT_STORE_AREAS + area), block, words);
}

bool ht_image_memory(ht_port *port, ht_store_port *memory)
{
    memory->read = read_block;
    memory->write = write_block;
    memory->at = port;
    memory->blocks = (uint16_t)(ht_flash_area_words() / HT_STORE_WORDS);
    return true;
}

bool ht_image_log_memory(ht_port *port, ht_store_port *memory)
{
    memory->read = read_log;
    memory->write = write_log;
    memory->at = port;
    memory->blocks = (uint16_t)(ht_flash_area_words() / HT_STORE_WORDS);
    return true;
}
