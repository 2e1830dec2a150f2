; Calls TI's Device_cal (F28377S, in OTP), which restores the factory's trim of ADCs and
; oscillators. It changes registers that a C function may keep values in: saved around it.

        .global ht_device_cal

        .sect   ".TI.ramfunc"
ht_device_cal:
        PUSH    ACC
        PUSH    DP
        PUSH    XAR0
        PUSH    XAR1
        PUSH    XAR2
        PUSH    XAR3
        PUSH    XAR4
        PUSH    XAR5
        LCR     #0x070282
        POP     XAR5
        POP     XAR4
        POP     XAR3
        POP     XAR2
        POP     XAR1
        POP     XAR0
        POP     DP
        POP     ACC
        LRETR
        .end
