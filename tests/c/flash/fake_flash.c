/* TI's flash APIs, as far as the firmware calls them, on a model of the flash. The model checks
 * each access, knows the contents after a power failure, and reports a caller that breaks its
 * rules.
 *
 * Modelled: an erased word is 0xFFFF; programming clears bits only; F28377S: eight words at an
 * address that is a multiple of eight, each 64 bits with their ECC once; an erase takes a whole sector; the
 * flash's machine is busy for a while, and the flash cannot be read meanwhile; a read of what was
 * torn, with the ECC check on, is a non-maskable interrupt. Rules: EALLOW, interrupts masked, gates
 * tripped, the pump bank 0's, the API told the right clock, no sector but the store's.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fake_flash.h"
#include "ht_drivers.h"
#include "ht_image.h"
#include "ht_store_flash.h"

#ifdef HT_FAKE_F28335
#include "Flash2833x_API_Library.h"
#define FIRST 0x300000u /* sectors H to D */
#define WORDS 0x28000u
#define STORE 0x300000u
#define LOG 0x310000u
#define SECTOR 0x8000u
const ht_board *const bench_board = &ht_board_f28335;
#else
#include "F021_F2837xS_C28x.h"
#define FIRST 0xB6000u /* the end of sector J, sectors K to N */
#define WORDS 0xA000u
#define STORE 0xBC000u
#define LOG 0xB8000u
#define SECTOR 0x2000u
#define ECC_ENABLE 0x5FB00u
#define FRD_INTF_CTRL 0x5F980u
#define PUMPREQUEST 0x50024u
const ht_board *const bench_board = &ht_board_launchxl_f28377s;
#endif

bench_state bench;
ht_port bench_chip;
unsigned fake_flash_broken; /* rules */
const char *fake_flash_rule = "";
bool fake_flash_stuck;
bool fake_flash_slow;
static ht_regfile registers;
ht_regfile *fake_flash_chip = &registers;
ht_port *fake_flash_port = &bench_chip;
static uint16_t memory[WORDS];
static uint16_t used[WORDS / 4u]; /* 64 bits: 1 programmed since the erase, 2 torn */
static bool blank_made;

static void broken(const char *rule)
{
    fake_flash_broken++;
    fake_flash_rule = rule;
}

static uint16_t *at_address(uint32_t address, unsigned words)
{
    if ((address < FIRST) || (address + words > FIRST + WORDS)) {
        broken("an address outside of the flash's end");
        abort();
    }
    return &memory[address - FIRST];
}

/* Of the parameters or of the log. */
static bool ours(uint32_t address)
{
    return ((address >= STORE) && (address < STORE + 2u * SECTOR))
           || ((address >= LOG) && (address < LOG + 2u * SECTOR));
}

static void rules(uint32_t address)
{
    unsigned leg;
    if (fake_flash_chip->intm != 1u) {
        broken("interrupts are let through");
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        if ((*ht_regfile_word(fake_flash_chip,
                              fake_flash_port->leg[leg] + fake_flash_port->map->tzflg)
             & 4u)
            == 0u) {
            broken("a leg is not tripped");
        }
    }
    if (!ours(address)) {
        broken("a sector of the image");
    }
}

#define TORN_MOST 512u /* words of a torn sector that are modelled: more than a copy has */

/* Contents that a power failure leaves of `n` words that should have become `wanted` (NULL:
 * erased). */
static void power_fails(uint16_t *at, const uint16_t *wanted, unsigned n)
{
    unsigned most = (n < TORN_MOST) ? n : TORN_MOST;
    unsigned k;
    for (k = 0; k < most; k++) {
        uint16_t to = (wanted == NULL) ? HT_STORE_ERASED : wanted[k];
        at[k] = bench_torn(at[k], to, k < most / 2);
        used[(unsigned)(at - memory + k) / 4u] =
            ((bench.style == CUT_COMPLETE) || (bench.style == CUT_NOTHING)) ? 1u : 2u;
    }
    longjmp(bench.off, 1);
}

static bool fails(uint16_t *at, const uint16_t *wanted, unsigned n)
{
    bench.operations++;
    if (bench.operations == bench.cut_at) {
        power_fails(at, wanted, n);
    }
    return bench.operations == bench.fail_at;
}

static void erase(uint32_t address)
{
    memset(&memory[address - FIRST], 0xFF, SECTOR * sizeof *memory);
    memset(&used[(address - FIRST) / 4u], 0, SECTOR / 4u * sizeof *used);
}

static bool program(uint32_t address, const uint16_t *data, unsigned n)
{
    uint16_t *at = at_address(address, n);
    unsigned k;
    bool good = true;
    for (k = 0; k < n; k++) {
#ifndef HT_FAKE_F28335
        if ((k % 4u == 0u) && (used[(address - FIRST + k) / 4u] != 0u)) {
            broken("64 bits are programmed twice");
        }
#endif
        at[k] = (uint16_t)(at[k] & data[k]);
        good = good && (at[k] == data[k]);
        used[(address - FIRST + k) / 4u] = 1u;
    }
    return good;
}

static bool verify(uint32_t address, const uint16_t *data, unsigned n)
{
    return memcmp(at_address(address, n), data, n * sizeof *data) == 0;
}

#ifdef HT_FAKE_F28335

/* Callbacks of an erase, 20 ms each. */
#define ERASE_CALLBACKS (fake_flash_slow ? 100u : 3u)

Uint32 Flash_CPUScaleFactor;
void (*Flash_CallbackPtr)(void);

static void work(uint16_t us)
{
    ht_regfile_wait(fake_flash_chip, us);
    Flash_CallbackPtr();
    if (fake_flash_chip->eallow != 1u) { /* the API may rely on it */
        broken("EALLOW is off after a callback");
    }
}

static void clocked(void)
{
    if (Flash_CPUScaleFactor != 31457280u) { /* 200 / 6.667 in IQ20 */
        broken("the API is told a wrong clock");
    }
}

Uint16 Flash_Erase(Uint16 sectors, FLASH_ST *where)
{
    uint32_t address = (sectors == SECTORH)   ? 0x300000u
                       : (sectors == SECTORG) ? 0x308000u
                       : (sectors == SECTORF) ? 0x310000u
                                              : 0x318000u;
    unsigned k;
    (void)where;
    if ((sectors != SECTORH) && (sectors != SECTORG) && (sectors != SECTORF)
        && (sectors != SECTORE)) {
        broken("another sector");
    }
    rules(address);
    clocked();
    if (fails(at_address(address, SECTOR), NULL, SECTOR)) {
        return 22u;
    }
    for (k = 0; k < ERASE_CALLBACKS; k++) {
        work(20000u);
    }
    erase(address);
    return STATUS_SUCCESS;
}

Uint16 Flash_Program(Uint16 *address, Uint16 *data, Uint32 words, FLASH_ST *where)
{
    uint32_t at = (uint32_t)(uintptr_t)address;
    (void)where;
    rules(at);
    clocked();
    if (fails(at_address(at, words), data, words)) {
        return 30u;
    }
    work(400u);
    return program(at, data, words) ? STATUS_SUCCESS : 31u;
}

Uint16 Flash_Verify(Uint16 *address, Uint16 *data, Uint32 words, FLASH_ST *where)
{
    (void)where;
    return verify((uint32_t)(uintptr_t)address, data, words) ? STATUS_SUCCESS : 40u;
}

uint16_t ht_flash_word(uint32_t address)
{
    if (fake_flash_chip->eallow != 0u) {
        broken("EALLOW is still on after the API has returned");
    }
    return *at_address(address, 1u);
}

#else

/* Polls of 50 us during an erase. A slow erase takes longer than the watchdog waits. */
#define ERASE_POLLS (fake_flash_slow ? 2000u : 10u)

static bool initialised;
static bool active;
static unsigned busy; /* polls */
static uint32_t status;

static uint16_t *in_words(uint32_t *address, unsigned n)
{
    return at_address((uint32_t)(uintptr_t)address, n);
}

static void allowed(void)
{
    if (fake_flash_chip->eallow != 1u) {
        broken("no EALLOW");
    }
    if (*ht_regfile_word(fake_flash_chip, PUMPREQUEST) != 2u) {
        broken("the pump is not bank 0's");
    }
}

Fapi_StatusType Fapi_initializeAPI(Fapi_FmcRegistersType *control, uint32 clock_MHz)
{
    allowed();
    if ((control != F021_CPU0_BASE_ADDRESS) || (clock_MHz != 200u)) {
        broken("the API is told a wrong clock");
    }
    initialised = true;
    active = false;
    return Fapi_Status_Success;
}

Fapi_StatusType Fapi_setActiveFlashBank(Fapi_FlashBankType bank)
{
    allowed();
    active = initialised && (bank == Fapi_FlashBank0);
    return active ? Fapi_Status_Success : Fapi_Error_Fail;
}

Fapi_StatusType Fapi_issueAsyncCommand(Fapi_FlashStateCommandsType command)
{
    allowed();
    if (command == Fapi_ClearStatus) {
        status = 0u;
    }
    return Fapi_Status_Success;
}

Fapi_StatusType Fapi_issueAsyncCommandWithAddress(Fapi_FlashStateCommandsType command,
                                                  uint32 *address)
{
    uint32_t at = (uint32_t)(uintptr_t)address;
    allowed();
    rules(at);
    if ((command != Fapi_EraseSector) || !active || (at % SECTOR != 0u) || (busy != 0u)) {
        broken("an erase out of turn");
    }
    if (fails(in_words(address, SECTOR), NULL, SECTOR)) {
        status = 0x10u;
        busy = 10u;
        return Fapi_Status_Success; /* the flash's machine reports it later */
    }
    erase(at);
    busy = fake_flash_stuck ? 0xFFFFFFFFu : ERASE_POLLS;
    return Fapi_Status_Success;
}

Fapi_StatusType Fapi_issueProgrammingCommand(uint32 *address, uint16 *data, uint16 words,
                                             uint16 *ecc, uint16 ecc_words,
                                             Fapi_FlashProgrammingCommandsType mode)
{
    uint32_t at = (uint32_t)(uintptr_t)address;
    allowed();
    rules(at);
    if ((words != 8u) || (at % 8u != 0u) || (ecc != NULL) || (ecc_words != 0u)
        || (mode != Fapi_AutoEccGeneration)) {
        broken("not eight words with the API's ECC");
    }
    if (!active || (busy != 0u)) {
        broken("programming out of turn");
    }
    if (fails(in_words(address, words), data, words)) {
        status = 0x10u;
    } else if (!program(at, data, words)) {
        status = 0x10u;
    } else {
        /* done */
    }
    busy = 4u;
    return Fapi_Status_Success;
}

Fapi_StatusType Fapi_checkFsmForReady(void)
{
    if (busy != 0u) {
        busy--;
        return Fapi_Status_FsmBusy;
    }
    return Fapi_Status_FsmReady;
}

Fapi_FlashStatusType Fapi_getFsmStatus(void)
{
    return status;
}

Fapi_StatusType Fapi_doBlankCheck(uint32 *address, uint32 words_32, Fapi_FlashStatusWordType *where)
{
    const uint16_t *at = in_words(address, 2u * words_32);
    uint32_t k;
    (void)where;
    allowed();
    for (k = 0; k < 2u * words_32; k++) {
        if (at[k] != HT_STORE_ERASED) {
            return Fapi_Error_Fail;
        }
    }
    return (2u * words_32 == SECTOR) ? Fapi_Status_Success : Fapi_Error_Fail;
}

Fapi_StatusType Fapi_doVerify(uint32 *address, uint32 words_32, uint32 *data,
                              Fapi_FlashStatusWordType *where)
{
    (void)where;
    allowed();
    return verify((uint32_t)(uintptr_t)address, (const uint16_t *)data, 2u * words_32)
               ? Fapi_Status_Success
               : Fapi_Error_Fail;
}

uint16_t ht_flash_word(uint32_t address)
{
    if (busy != 0u) {
        broken("read while the flash works");
    }
    if ((*ht_regfile_word(fake_flash_chip, ECC_ENABLE) == 0xAu)
        && (used[(address - FIRST) / 4u] == 2u)) {
        broken("read of torn words with the ECC check on: a non-maskable interrupt");
    }
    if (*ht_regfile_word(fake_flash_chip, FRD_INTF_CTRL) != 0u) {
        broken("read through the cache: what was there before");
    }
    return *at_address(address, 1u);
}

#endif

void bench_power_on(void)
{
    if (!blank_made) {
        bench_erase();
    }
    ht_regfile_reset(&registers, bench_board->map);
    ht_port_bind(&bench_chip, &registers, bench_board);
    (void)ht_board_start(&bench_chip);
    bench.operations = 0;
    bench.cut_at = 0;
    bench.fail_at = 0;
#ifndef HT_FAKE_F28335
    initialised = false;
    active = false;
    busy = 0u;
    status = 0u;
#endif
}

ht_store_port bench_store(void)
{
    ht_store_port port = {NULL, NULL, NULL, 0};
    (void)ht_image_memory(&bench_chip, &port);
    return port;
}

void bench_erase(void)
{
    unsigned k;
    for (k = 0; !blank_made && (k < WORDS); k++) { /* the image's sectors hold something else */
        memory[k] = 0x1234u;
    }
    blank_made = true;
    erase(STORE);
    erase(STORE + SECTOR);
    erase(LOG);
    erase(LOG + SECTOR);
}

uint16_t *bench_word(unsigned area, unsigned word)
{
    return &memory[STORE - FIRST + area * SECTOR + word];
}

bool fake_flash_rest_is_untouched(void)
{
    unsigned k;
    for (k = 0; k < WORDS; k++) {
        if (!ours(FIRST + k) && (memory[k] != 0x1234u)) {
            return false;
        }
    }
    return true;
}
