/* F28335, image in flash. The drive's code and constants are loaded there and run from
 * RAM. Kept free: the last 16 words of every range next to nothing (the CPU
 * prefetches beyond the end), the words of the code security module, and sectors H to E: the store of
 * the parameters, and the log (store/). TI's library that writes them runs from RAM. */
#ifdef HT_FLASH_API /* the library's name, from the build */
#define HT_IN_RAM *(.TI.ramfunc) -l HT_FLASH_API (.text)
#else
#define HT_IN_RAM
#endif

MEMORY
{
    BOOT    : origin = 0x000000, length = 0x000050   /* stack of the boot ROM */
    STACK   : origin = 0x000400, length = 0x0003F0   /* M1; last 16 words free */
    CODE    : origin = 0x008000, length = 0x004000   /* L0..L3 */
    DATA    : origin = 0x00C000, length = 0x003FF0   /* L4..L7 */
    STORE   : origin = 0x300000, length = 0x010000   /* sectors H, G; no section goes there */
    LOG     : origin = 0x310000, length = 0x010000   /* sectors F, E; nor there */
    FLASH   : origin = 0x320000, length = 0x01FF70   /* sectors D..A; 0x33FF80 on: security */
    BEGIN   : origin = 0x33FFF6, length = 0x000002   /* the boot ROM's jump to flash */
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
