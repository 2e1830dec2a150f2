/* F28335: TI's F2833x flash API, which erases and programs with software loops: it is told the
 * clock, and calls back between its pulses. */
#include "Flash2833x_API_Library.h"

#include "ht_drivers.h"
#include "ht_store_flash.h"

#define SECTOR_H_ADDRESS 0x00300000u
#define SECTOR_WORDS 0x00008000u
/* The API's delays in CPU cycles: 1.0 in IQ20 at 200 ns. */
#define SCALE_CLOCK_MHZ 5u
#define SCALE_ONE 0x00100000u

/* The callback has no argument. */
static ht_port *waiting;

uint32_t ht_flash_area(uint16_t area)
{
    return SECTOR_H_ADDRESS + ((uint32_t)area * SECTOR_WORDS);
}

uint32_t ht_flash_area_words(void)
{
    return SECTOR_WORDS;
}

/* TI does not say whether the API keeps EALLOW on between its own writes. So it is left on here,
 * and goes off after the API has returned. */
static void serve(void)
{
    HT_EDIS(waiting->io);
    ht_flash_serve(waiting);
    HT_EALLOW(waiting->io);
}

static void begin(ht_port *port)
{
    uint32_t clock_MHz = (uint32_t)(port->map->system_clock_Hz * 1.0e-6f + 0.5f);
    waiting = port;
    HT_EALLOW(port->io);
    Flash_CPUScaleFactor = (clock_MHz * SCALE_ONE) / SCALE_CLOCK_MHZ;
    Flash_CallbackPtr = serve;
    HT_EDIS(port->io);
}

bool ht_flash_erase(ht_port *port, uint32_t address)
{
    static const Uint16 sector[HT_FLASH_AREAS] = {SECTORH, SECTORG, SECTORF, SECTORE};
    FLASH_ST where;
    Uint16 status;
    begin(port);
    status = Flash_Erase(sector[(address - SECTOR_H_ADDRESS) / SECTOR_WORDS], &where);
    HT_EDIS(port->io);
    return status == (Uint16)STATUS_SUCCESS;
}

bool ht_flash_program(ht_port *port, uint32_t address, const uint16_t *words)
{
    Uint16 buffer[HT_STORE_WORDS];
    Uint16 *place = (Uint16 *)(uintptr_t)address;
    FLASH_ST where;
    uint16_t k;
    bool good;
    for (k = 0u; k < HT_STORE_WORDS; k++) {
        buffer[k] = words[k];
    }
    begin(port);
    good = (Flash_Program(place, buffer, HT_STORE_WORDS, &where) == (Uint16)STATUS_SUCCESS)
           && (Flash_Verify(place, buffer, HT_STORE_WORDS, &where) == (Uint16)STATUS_SUCCESS);
    HT_EDIS(port->io);
    return good;
}
