; First instructions after the boot ROM. The watchdog counts from reset on and would
; bite while the runtime clears memory and main copies the program: its longest time
; first (prescaler 64), then the runtime's own start.

        .global code_start
        .ref    _c_int00

        .sect   "codestart"             ; two words, where the boot ROM jumps to
        .retain
code_start:
        LB      hold_watchdog

        .text
hold_watchdog:
        SETC    OBJMODE                 ; C28x instructions
        EALLOW
        MOVL    XAR4, #0x7029           ; WDCR, on both devices
        MOV     *+XAR4[0], #0x002F      ; WDCHK = 101, WDPS = 7
        EDIS
        LB      _c_int00
        .end
