# TI's C2000 compiler: cmake --preset f28335 (or f28377s). TI_CGT_ROOT, a CMake or an environment
# variable, is the folder that contains bin/cl2000.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR c28x)

if(NOT TI_CGT_ROOT)
  set(TI_CGT_ROOT "$ENV{TI_CGT_ROOT}")
endif()
set(TI_CGT_ROOT "${TI_CGT_ROOT}" CACHE PATH "TI's C2000 code generation tools" FORCE)
foreach(name "cl2000" "cl2000.exe")
  if(TI_CGT_ROOT AND EXISTS "${TI_CGT_ROOT}/bin/${name}")
    set(CMAKE_C_COMPILER "${TI_CGT_ROOT}/bin/${name}")
  endif()
endforeach()
if(NOT CMAKE_C_COMPILER)
  message(FATAL_ERROR
    "TI's C2000 compiler was not found (TI_CGT_ROOT = \"${TI_CGT_ROOT}\", wanted: bin/cl2000 in it).\n"
    "Install the C2000 code generation tools (C2000-CGT, free, from ti.com; also part of Code Composer "
    "Studio) and say where:\n"
    "  TI_CGT_ROOT=/opt/ti/ti-cgt-c2000_22.6.1.LTS cmake --preset f28335\n"
    "See docs/flash.md.")
endif()
set(CMAKE_ASM_COMPILER "${CMAKE_C_COMPILER}")

# Test a static library: an executable does not link without a linker command file.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TI_CGT_ROOT)
