/* F28377S, image in RAM: for the debugger, or loaded by the SCI boot loader. Code is
 * where it runs already; main copies it onto itself. Code and data share one range, code
 * first: neither has an end of its own that it could come up against. */
MEMORY
{
    BEGIN   : origin = 0x000000, length = 0x000002   /* the boot ROM's jump to RAM */
    STACK   : origin = 0x000400, length = 0x0003F0   /* M1; last 16 words free */
    RAM     : origin = 0x008000, length = 0x013FF0   /* LS0..LS5, D0, D1, GS0..GS15; last 16 words free */
    RESET   : origin = 0x3FFFC0, length = 0x000002
}

SECTIONS
{
    codestart   : > BEGIN
    .text       : > RAM, ALIGN(8)
    .cinit      : > RAM, ALIGN(8)
    .init_array : > RAM, ALIGN(8)
    .switch     : > RAM, ALIGN(8)
    .TI.ramfunc : {} > RAM, ALIGN(8),
                  LOAD_START(ht_code_load), RUN_START(ht_code_run), LOAD_SIZE(ht_code_size)
    .const      : > RAM, ALIGN(8),
                  LOAD_START(ht_const_load), RUN_START(ht_const_run), LOAD_SIZE(ht_const_size)
    .stack      : > STACK
    .data       : > RAM
    .bss        : > RAM
    .TI.noinit  : > RAM                    /* ht_image_reset_memory: no start clears it */
    .sysmem     : > RAM
    .reset      : > RESET, TYPE = DSECT
}
