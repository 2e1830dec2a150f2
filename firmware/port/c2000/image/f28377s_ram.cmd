/* F28377S, image in RAM: for the debugger, or loaded by the SCI boot loader. Code is
 * where it runs already; main copies it onto itself. */
MEMORY
{
    BEGIN   : origin = 0x000000, length = 0x000002   /* the boot ROM's jump to RAM */
    STACK   : origin = 0x000400, length = 0x0003F0   /* M1; last 16 words free */
    CODE    : origin = 0x008000, length = 0x004000   /* LS0..LS5, D0, D1 */
    DATA    : origin = 0x00C000, length = 0x00FFF0   /* GS0..GS15 */
    RESET   : origin = 0x3FFFC0, length = 0x000002
}

SECTIONS
{
    codestart   : > BEGIN
    .text       : > CODE, ALIGN(8)
    .cinit      : > CODE, ALIGN(8)
    .init_array : > CODE, ALIGN(8)
    .switch     : > CODE, ALIGN(8)
    .TI.ramfunc : {} > CODE, ALIGN(8),
                  LOAD_START(ht_code_load), RUN_START(ht_code_run), LOAD_SIZE(ht_code_size)
    .const      : > DATA, ALIGN(8),
                  LOAD_START(ht_const_load), RUN_START(ht_const_run), LOAD_SIZE(ht_const_size)
    .stack      : > STACK
    .data       : > DATA
    .bss        : > DATA
    .sysmem     : > DATA
    .reset      : > RESET, TYPE = DSECT
}
