# ATmega2560: like the C28x it has 16-bit int and 32-bit double, unlike the host.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR avr)
set(CMAKE_C_COMPILER avr-gcc)
set(CMAKE_OBJDUMP avr-objdump)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
# avr-gcc 5.4 compiles wrongly without this: after its registers are chosen, the pass postreload
# writes an address as the sum of another one and a constant, although one half of the other has been
# used as a scratch register meanwhile. The build-up of the flux took no time because of that.
# Short calls, and registers saved by a routine that all functions share: else the code has no room.
set(CMAKE_C_FLAGS_INIT "-mmcu=atmega2560 -mrelax -mcall-prologues -fdisable-rtl-postreload")
