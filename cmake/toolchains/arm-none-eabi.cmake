# Bare-metal Arm with hard float, single precision. HT_CPU: cortex-m4 or cortex-m7.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_OBJDUMP arm-none-eabi-objdump)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES HT_CPU)

set(HT_CPU cortex-m4 CACHE STRING "core to compile for")
if(HT_CPU STREQUAL "cortex-m4")
  set(fpu fpv4-sp-d16)
elseif(HT_CPU STREQUAL "cortex-m7")
  set(fpu fpv5-sp-d16)
else()
  message(FATAL_ERROR "HT_CPU = ${HT_CPU}: cortex-m4 or cortex-m7")
endif()
set(CMAKE_C_FLAGS_INIT "-mcpu=${HT_CPU} -mthumb -mfpu=${fpu} -mfloat-abi=hard")

# The fast interrupt takes 28 % fewer instructions when its functions are compiled into each
# other, across files, and its loops over six legs are unrolled. This costs 10 kB. It changes only
# the speed: preset mps2-by-file does without it and gives the same bits. Fat objects are needed by
# the check for mutable data. -fstack-usage is repeated for the linker, because functions get their
# frames when linking. The control step is one large function with both laws in it, which GCC's
# limits would divide (8 % more instructions). With large-stack-frame-growth=0 inlining stops at
# frames of 320 bytes.
set(HT_LINK_TIME -flto -ffat-lto-objects -fstack-usage
  CACHE STRING "options of optimisation when linking")
set(HT_FAST -O3 --param=max-inline-insns-auto=100 --param=max-inline-insns-single=1000
    --param=large-function-insns=10000
    --param=large-stack-frame=320 --param=large-stack-frame-growth=0
  CACHE STRING "options for what the fast interrupt is made of")
