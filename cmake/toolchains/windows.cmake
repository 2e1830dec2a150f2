# Windows on x86-64, compiled by zig (the extra `dist`) and run by wine. HT_ZIG: the folder of its
# tools, which tools/windows.py makes.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR x86_64)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES HT_ZIG)
set(CMAKE_C_COMPILER "${HT_ZIG}/cc")
set(CMAKE_AR "${HT_ZIG}/ar")
set(CMAKE_RANLIB "${HT_ZIG}/ranlib")
set(CMAKE_RC_COMPILER "${HT_ZIG}/rc")
# To link a program here, zig would compile the whole C library as the build does not need it.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_CROSSCOMPILING_EMULATOR wine)
