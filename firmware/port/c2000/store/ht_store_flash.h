/** @file ht_store_flash.h
 *  Parameter store and log of the C2000 images: two sectors each of the chip's own flash, which the
 *  linker command files leave free. Erased and programmed through TI's flash API, which is the user's
 *  (C2000Ware; CMake option HT_FLASH_API) and is called in one file per device.
 *
 *  | device | parameters | log | sector | TI's API |
 *  |---|---|---|---|---|
 *  | F28335 | H, 0x300000; G, 0x308000 | F, 0x310000; E, 0x318000 | 32 k words | Flash2833x |
 *  | F28377S | M, 0xBC000; N, 0xBE000 | K, 0xB8000; L, 0xBA000 | 8 k words | F021, bank 0 |
 *
 *  What happens while the flash is erased or programmed: some 100 ms for a save on the F28377S,
 *  seconds on the F28335, below 1 ms for a block of the log:
 *  - *Gates.* Off: the drive is idle or in fault, and all PWM modules are tripped once more before
 *    anything else. The trip holds the pins low without the CPU.
 *  - *Interrupts* are held off, because they call functions of the compiler's runtime in the flash,
 *    which cannot be read meanwhile. This code, TI's, and all that they call run from RAM.
 *  - *Watchdog.* Serviced here while the API works, for a time that is bounded (F28335: by the API
 *    itself, F28377S: HT_FLASH_PATIENCE_US for an erase). After that the chip resets.
 *  - *Fast interrupt.* It misses its conversions. `tick` counts fast interrupts and so stands
 *    still: the board's time does. The service therefore refuses a save while samples are streamed
 *    or captured; a block of the log makes a gap of some ticks. The pending interrupt comes once, at the end, with the sample of the latest
 *    conversion. This is not taken for an overrun or a lost interrupt. Overruns are checked in
 *    calibrate, build and run only. The slow interrupt is held off as well and comes after the fast
 *    one, and its timer then begins a new period. So there is always a fast interrupt between two
 *    slow ones.
 *  - *Speed.* The first slow interrupt afterwards divides the counts of all this time by one
 *    period. If the shaft turns, `speed_rpm` reads too much until the second one.
 *  - *Line.* Bytes that come meanwhile overflow the receiver and are counted; the host repeats
 *    its request and gets the reply. The link's watchdog is not armed when no drive runs.
 */
#ifndef HT_STORE_FLASH_H
#define HT_STORE_FLASH_H

#include "ht_port_c2000.h"
#include "ht_store_port.h"

/** Longest time that an erase may take on the F28377S (worn sectors: 4 s). */
#define HT_FLASH_PATIENCE_US 10000000u

/* One file per device. These run from RAM, with interrupts held off. */

/** Areas of both memories: those of the parameters, then those of the log. */
#define HT_FLASH_AREAS 4u

/** First word of an area. */
uint32_t ht_flash_area(uint16_t area);
/** Words of an area. */
uint32_t ht_flash_area_words(void);
/** Erase the sector that begins at `address`, and check that it is erased. */
bool ht_flash_erase(ht_port *port, uint32_t address);
/** Program the HT_STORE_WORDS words at `address`, a multiple of as many, once after an erase, and
 *  verify them. */
bool ht_flash_program(ht_port *port, uint32_t address, const uint16_t *words);

/** Both halves of the watchdog's service. */
void ht_flash_serve(ht_port *port);

/** A word of the flash. */
#ifdef __TMS320C2000__
static inline uint16_t ht_flash_word(uint32_t address)
{
    return *(const volatile uint16_t *)(uintptr_t)address;
}
#else
uint16_t ht_flash_word(uint32_t address); /* of the test around it */
#endif

#endif
