# Complete images for a C2000 device: one that runs from flash, one for RAM (debugger
# or SCI boot). Included when the toolchain is TI's; HT_DEVICE and HT_BOARD come
# from the preset.
enable_language(ASM)

set(HT_DEVICE "" CACHE STRING "f28335 or f28377s: linker command files")
set(HT_BOARD "" CACHE STRING "table of firmware/port/c2000/ht_board.c: f28335, f28377s, launchxl_f28377s")
set(port firmware/port/c2000)
if(NOT EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${port}/image/${HT_DEVICE}_flash.cmd")
  message(FATAL_ERROR "HT_DEVICE = \"${HT_DEVICE}\": f28335 or f28377s")
endif()
if(NOT HT_BOARD MATCHES "^(f28335|f28377s|launchxl_f28377s)$" OR NOT HT_BOARD MATCHES "${HT_DEVICE}")
  message(FATAL_ERROR "HT_BOARD = \"${HT_BOARD}\" is no board with a ${HT_DEVICE}")
endif()

# Results must be those of the host, bit for bit: no relaxed arithmetic, no TMU.
set(machine -v28 -ml -mt --float_support=fpu32 --abi=eabi)
set(arithmetic --fp_mode=strict --fp_reassoc=off)
set(messages --display_error_number --diag_wrap=off --diag_warning=225)

# Version and commit, told by HELLO.
set(version "unknown")
foreach(file host/hexatorque/__init__.py ../__init__.py) # of the repository, installed
  if(EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${file}")
    file(STRINGS ${file} line REGEX "^__version__")
    string(REGEX REPLACE ".*\"(.*)\".*" "\\1" version "${line}")
  endif()
endforeach()
execute_process(COMMAND git describe --always --dirty WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}"
  OUTPUT_VARIABLE commit ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
set(build "${version}+${commit}")

# Memory for captures, 32-bit values: what is left of the RAM.
if(HT_DEVICE STREQUAL "f28335")
  set(capture_flash 3072)
  set(capture_ram 256)
else()
  set(capture_flash 20480)
  set(capture_ram 20480)
endif()

# What the interrupts run is in RAM: every function of these.
file(GLOB core CONFIGURE_DEPENDS firmware/core/*.c)
file(GLOB app CONFIGURE_DEPENDS firmware/app/*.c)
file(GLOB link CONFIGURE_DEPENDS firmware/link/*.c)
file(GLOB drivers CONFIGURE_DEPENDS ${port}/*.c)
# The link's requests may wait for the flash.
set(background firmware/app/ht_service.c firmware/app/ht_service_requests.c
  firmware/app/ht_dictionary.c firmware/link/ht_packet.c)
list(TRANSFORM background PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
list(REMOVE_ITEM app ${background})
list(REMOVE_ITEM link ${background})
set(ram ${core} ${app} ${link} ${drivers} ${port}/image/ht_image.c ${port}/image/ht_wait.c)
set_source_files_properties(${ram} PROPERTIES COMPILE_OPTIONS "--ramfunc=on")
# What copies it there is not.
set(flash ${port}/image/main.c ${port}/image/codestart.asm)

foreach(place flash ram)
  set(image hexatorque_${HT_BOARD}_${place})
  set(command_file "${CMAKE_CURRENT_SOURCE_DIR}/${port}/image/${HT_DEVICE}_${place}.cmd")
  add_executable(${image} ${ram} ${background} ${flash})
  set_target_properties(${image} PROPERTIES SUFFIX ".out" LINK_DEPENDS "${command_file}")
  target_include_directories(${image} PRIVATE firmware/core firmware/app firmware/link firmware/port ${port}
    ${port}/image)
  target_compile_definitions(${image} PRIVATE HT_BOARD=ht_board_${HT_BOARD}
    HT_CAPTURE_VALUES=${capture_${place}}u "HT_BUILD=\"${build}\"")
  target_compile_options(${image} PRIVATE ${machine} ${messages}
    $<$<COMPILE_LANGUAGE:C>:${arithmetic}> $<$<COMPILE_LANGUAGE:C>:--opt_level=2>)
  target_link_options(${image} PRIVATE --rom_model --entry_point=code_start --stack_size=0x3C0
    --warn_sections --reread_libs "--search_path=${TI_CGT_ROOT}/lib" --library=libc.a
    "${command_file}")
endforeach()
