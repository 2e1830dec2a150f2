/* F28377S: TI's F021 flash API. A block is 128 bits, two words of the flash with an ECC each, which
 * the API makes; a word of the flash can be programmed once. */
#include <stddef.h>

#include HT_FLASH_API_HEADER /* F021_F2837xS_C28x.h or F021_F2837xD_C28x.h: TI has had both */

#include "ht_drivers.h"
#include "ht_store_flash.h"

#define SECTOR_K 0x000B8000u
#define SECTOR_M 0x000BC000u
#define SECTOR_WORDS 0x00002000u
#define WORDS_32 2u /* 16-bit words of what the API's checks count in */
#define POLL_US 50u

uint32_t ht_flash_area(uint16_t area)
{
    return (area < HT_STORE_AREAS)
               ? (SECTOR_M + ((uint32_t)area * SECTOR_WORDS))
               : (SECTOR_K + ((uint32_t)(area - HT_STORE_AREAS) * SECTOR_WORDS));
}

uint32_t ht_flash_area_words(void)
{
    return SECTOR_WORDS;
}

/* The flash's own machine works; the watchdog is serviced meanwhile. */
static bool wait_until_ready(ht_port *port)
{
    uint32_t left_us = HT_FLASH_PATIENCE_US;
    while ((Fapi_checkFsmForReady() != Fapi_Status_FsmReady) && (left_us >= POLL_US)) {
        left_us -= POLL_US;
        HT_WAIT_US(port->io, POLL_US);
        ht_flash_serve(port);
    }
    return (Fapi_checkFsmForReady() == Fapi_Status_FsmReady) && (Fapi_getFsmStatus() == 0u);
}

static bool begin(const ht_port *port)
{
    uint32_t clock_MHz = (uint32_t)(port->map->system_clock_Hz * 1.0e-6f + 0.5f);
    if (Fapi_getFsmStatus() != 0u) { /* of an operation that failed */
        (void)Fapi_issueAsyncCommand(Fapi_ClearStatus);
    }
    return (Fapi_initializeAPI(F021_CPU0_BASE_ADDRESS, clock_MHz) == Fapi_Status_Success)
           && (Fapi_setActiveFlashBank(Fapi_FlashBank0) == Fapi_Status_Success);
}

bool ht_flash_erase(ht_port *port, uint32_t address)
{
    uint32 *sector = (uint32 *)(uintptr_t)address;
    Fapi_FlashStatusWordType where;
    bool good;
    HT_EALLOW(port->io);
    good = begin(port)
           && (Fapi_issueAsyncCommandWithAddress(Fapi_EraseSector, sector) == Fapi_Status_Success);
    HT_EDIS(port->io);
    good = good && wait_until_ready(port);
    HT_EALLOW(port->io);
    good = good
           && (Fapi_doBlankCheck(sector, SECTOR_WORDS / WORDS_32, &where) == Fapi_Status_Success);
    HT_EDIS(port->io);
    return good;
}

bool ht_flash_program(ht_port *port, uint32_t address, const uint16_t *words)
{
    union { /* what the API verifies with is made of 32-bit words */
        uint16 word[HT_STORE_WORDS];
        uint32 pair[HT_STORE_WORDS / WORDS_32];
    } buffer;
    uint32 *place = (uint32 *)(uintptr_t)address;
    Fapi_FlashStatusWordType where;
    uint16_t k;
    bool good;
    for (k = 0u; k < HT_STORE_WORDS; k++) {
        buffer.word[k] = words[k];
    }
    HT_EALLOW(port->io);
    good = begin(port)
           && (Fapi_issueProgrammingCommand(place, buffer.word, HT_STORE_WORDS, NULL, 0u,
                                            Fapi_AutoEccGeneration)
               == Fapi_Status_Success);
    HT_EDIS(port->io);
    good = good && wait_until_ready(port);
    HT_EALLOW(port->io);
    good = good
           && (Fapi_doVerify(place, HT_STORE_WORDS / WORDS_32, buffer.pair, &where)
               == Fapi_Status_Success);
    HT_EDIS(port->io);
    return good;
}
