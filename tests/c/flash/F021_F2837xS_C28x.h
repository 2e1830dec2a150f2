/* The few declarations of TI's F021 flash API that the firmware uses, written from its reference
 * guide (SPNU628) for a fake on the host: fake_flash.c. Not TI's file. */
#ifndef FAKE_F021_H
#define FAKE_F021_H

#include <stdint.h>

typedef uint16_t uint16;
typedef uint32_t uint32;

typedef enum {
    Fapi_Status_Success = 0,
    Fapi_Status_FsmBusy,
    Fapi_Status_FsmReady,
    Fapi_Error_Fail
} Fapi_StatusType;
typedef enum { Fapi_FlashBank0 = 0, Fapi_FlashBank1 = 1 } Fapi_FlashBankType;
typedef enum { Fapi_EraseSector = 6, Fapi_ClearStatus = 16 } Fapi_FlashStateCommandsType;
typedef enum { Fapi_AutoEccGeneration = 0, Fapi_DataOnly = 1 } Fapi_FlashProgrammingCommandsType;
typedef struct {
    uint32 au32StatusWord[4];
} Fapi_FlashStatusWordType;
typedef struct fake_fmc Fapi_FmcRegistersType;
typedef uint32 Fapi_FlashStatusType;

#define F021_CPU0_BASE_ADDRESS ((Fapi_FmcRegistersType *)0x0005F800U)

Fapi_StatusType Fapi_initializeAPI(Fapi_FmcRegistersType *registers, uint32 clock_MHz);
Fapi_StatusType Fapi_setActiveFlashBank(Fapi_FlashBankType bank);
Fapi_StatusType Fapi_issueAsyncCommand(Fapi_FlashStateCommandsType command);
Fapi_StatusType Fapi_issueAsyncCommandWithAddress(Fapi_FlashStateCommandsType command,
                                                  uint32 *address);
Fapi_StatusType Fapi_issueProgrammingCommand(uint32 *address, uint16 *data, uint16 words,
                                             uint16 *ecc, uint16 ecc_words,
                                             Fapi_FlashProgrammingCommandsType mode);
Fapi_StatusType Fapi_checkFsmForReady(void);
Fapi_FlashStatusType Fapi_getFsmStatus(void);
Fapi_StatusType Fapi_doBlankCheck(uint32 *address, uint32 words_32,
                                  Fapi_FlashStatusWordType *where);
Fapi_StatusType Fapi_doVerify(uint32 *address, uint32 words_32, uint32 *data,
                              Fapi_FlashStatusWordType *where);

#endif
