/* The few declarations of TI's F2833x flash API that the firmware uses, written from its
 * documentation for a fake on the host: fake_flash.c. Not TI's file. */
#ifndef FAKE_FLASH2833X_H
#define FAKE_FLASH2833X_H

#include <stdint.h>

typedef uint16_t Uint16;
typedef uint32_t Uint32;
typedef struct {
    Uint32 FirstFailAddr;
    Uint16 ExpectedData;
    Uint16 ActualData;
} FLASH_ST;

#define STATUS_SUCCESS 0
#define SECTORE (Uint16)0x0010
#define SECTORF (Uint16)0x0020
#define SECTORG (Uint16)0x0040
#define SECTORH (Uint16)0x0080

extern Uint32 Flash_CPUScaleFactor;
extern void (*Flash_CallbackPtr)(void);

Uint16 Flash_Erase(Uint16 sectors, FLASH_ST *where);
Uint16 Flash_Program(Uint16 *address, Uint16 *data, Uint32 words, FLASH_ST *where);
Uint16 Flash_Verify(Uint16 *address, Uint16 *data, Uint32 words, FLASH_ST *where);

#endif
