# Complete images for a C2000 device, each one that runs from flash and one for RAM (debugger
# or SCI boot): the drive, and the drive for processor in the loop (docs/pil.md).
# Included when the toolchain is TI's; HT_DEVICE and HT_BOARD come from the preset.
enable_language(ASM)

set(HT_DEVICE "" CACHE STRING "f28335 or f28377s: linker command files")
set(HT_BOARD "" CACHE STRING "table of firmware/port/c2000/ht_board.c: f28335, f28377s, launchxl_f28377s")
set(HT_PIL_BAUD 625000 CACHE STRING "rate of the serial line, processor in the loop")
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

include(cmake/BuildName.cmake)

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
# The link, which the drive's image has. Its requests may wait for the flash.
set(background firmware/app/ht_service.c firmware/app/ht_service_requests.c
  firmware/app/ht_dictionary.c firmware/link/ht_packet.c)
list(TRANSFORM background PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
set(service ${link} "${CMAKE_CURRENT_SOURCE_DIR}/firmware/app/ht_service_fast.c")
list(REMOVE_ITEM app ${background} ${service})
list(REMOVE_ITEM service ${background})
set(ram ${core} ${app} ${port}/image/ht_wait.c)
set(drive_ram ${service} ${drivers} ${port}/image/ht_image.c)
# Processor in the loop: no driver of what the plant is connected to; that one is on the PC.
set(chip ht_board ht_c2000_map ht_clock_f28335 ht_clock_f28377s ht_flash ht_pins ht_sci ht_timer
  ht_watchdog)
list(TRANSFORM chip REPLACE "(.+)" "${port}/\\1.c")
file(GLOB pil CONFIGURE_DEPENDS firmware/pil/*.c firmware/pil/calls/*.c ${port}/pil/*.c)
set(pil_ram ${chip} ${pil})
set_source_files_properties(${ram} ${drive_ram} ${pil_ram} PROPERTIES COMPILE_OPTIONS "--ramfunc=on")
# What copies it there is not.
set(flash ${port}/image/main.c ${port}/image/codestart.asm)

# An image that runs from `place`, with more sources and include folders than all have.
function(ht_c2000_image image place sources folders)
  set(command_file "${CMAKE_CURRENT_SOURCE_DIR}/${port}/image/${HT_DEVICE}_${place}.cmd")
  add_executable(${image} ${ram} ${flash} ${sources})
  set_target_properties(${image} PROPERTIES SUFFIX ".out" LINK_DEPENDS "${command_file}")
  target_include_directories(${image} PRIVATE firmware/core firmware/app firmware/link
    firmware/port ${port} ${port}/image ${folders})
  target_compile_definitions(${image} PRIVATE HT_BOARD=ht_board_${HT_BOARD})
  target_compile_options(${image} PRIVATE ${machine} ${messages}
    $<$<COMPILE_LANGUAGE:C>:${arithmetic}> $<$<COMPILE_LANGUAGE:C>:--opt_level=2>)
  target_link_options(${image} PRIVATE --rom_model --entry_point=code_start --stack_size=0x3C0
    --warn_sections --reread_libs "--search_path=${TI_CGT_ROOT}/lib" --library=libc.a
    "${command_file}")
endfunction()

foreach(place flash ram)
  set(image hexatorque_${HT_BOARD}_${place})
  ht_c2000_image(${image} ${place} "${drive_ram};${background};${port}/image/devicecal.asm" "")
  target_compile_definitions(${image} PRIVATE HT_CAPTURE_VALUES=${capture_${place}}u
    "HT_BUILD=\"${HT_BUILD}\"")
  set(image hexatorque_${HT_BOARD}_pil_${place})
  ht_c2000_image(${image} ${place} "${pil_ram}" "firmware/pil;firmware/pil/calls;${port}/pil")
  target_compile_definitions(${image} PRIVATE HT_PIL_BAUD=${HT_PIL_BAUD}u)
endforeach()
