/* F28377S, image in flash bank 0. The drive's code and constants are loaded there and run
 * from RAM. Kept free: the last 16 words of every range next to nothing (the CPU
 * prefetches beyond the end) and before the log and the parameters' store (store/): sectors K to N, the
 * last of the bank. TI's library that writes them runs from RAM. */
#ifdef HT_FLASH_API /* the library's name, from the build */
#define HT_IN_RAM *(.TI.ramfunc) -l HT_FLASH_API (.text)
#else
#define HT_IN_RAM
#endif

MEMORY
{
    BOOT    : origin = 0x000000, length = 0x000123   /* stack of the boot ROM */
    STACK   : origin = 0x000400, length = 0x0003F0   /* M1; last 16 words free */
    CODE    : origin = 0x008000, length = 0x004000   /* LS0..LS5, D0, D1 */
    DATA    : origin = 0x00C000, length = 0x00FFF0   /* GS0..GS15 */
    BEGIN   : origin = 0x080000, length = 0x000002   /* the boot ROM's jump to flash */
    FLASH   : origin = 0x080002, length = 0x037FEE   /* sectors A..J */
    LOG     : origin = 0x0B8000, length = 0x004000   /* sectors K, L; no section goes there */
    STORE   : origin = 0x0BC000, length = 0x004000   /* sectors M, N; nor there */
    RESET   : origin = 0x3FFFC0, length = 0x000002   /* in the boot ROM */
}

SECTIONS
{
    codestart   : > BEGIN
    /* Code Composer gives every file one option, --ramfunc=on. What CMake compiles without
     * it stays by name: main, which copies the rest, and what only the background runs. */
    .stays      : { *main.*(.TI.ramfunc)
                    *ht_dictionary.*(.TI.ramfunc)
                    *ht_log.*(.TI.ramfunc)
                    *ht_log_ring.*(.TI.ramfunc)
                    *ht_no_store.*(.TI.ramfunc)
                    *ht_packet.*(.TI.ramfunc)
                    *ht_requests_drive.*(.TI.ramfunc)
                    *ht_requests_sampling.*(.TI.ramfunc)
                    *ht_requests_session.*(.TI.ramfunc)
                    *ht_reset.*(.TI.ramfunc)
                    *ht_service.*(.TI.ramfunc)
                    *ht_service_requests.*(.TI.ramfunc)
                    *ht_snapshot.*(.TI.ramfunc)
                    *ht_store.*(.TI.ramfunc) } > FLASH, ALIGN(8)
    .text       : > FLASH, ALIGN(8)
    .cinit      : > FLASH, ALIGN(8)
    .init_array : > FLASH, ALIGN(8)
    .switch     : > FLASH, ALIGN(8)
    .TI.ramfunc : { HT_IN_RAM } LOAD = FLASH, RUN = CODE, ALIGN(8),
                  LOAD_START(ht_code_load), RUN_START(ht_code_run), LOAD_SIZE(ht_code_size)
    .texts      : { *ht_params.*(.const) *ht_channels.*(.const) *ht_faults.*(.const)
                    *ht_dictionary.*(.const) *ht_reset.*(.const) } > FLASH, ALIGN(8)
    .const      : LOAD = FLASH, RUN = DATA, ALIGN(8),
                  LOAD_START(ht_const_load), RUN_START(ht_const_run), LOAD_SIZE(ht_const_size)
    .stack      : > STACK
    .data       : > DATA
    .bss        : > DATA
    .TI.noinit  : > DATA                    /* ht_image_reset_memory: no start clears it */
    .sysmem     : > DATA
    .reset      : > RESET, TYPE = DSECT
}
