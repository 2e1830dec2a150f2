# Complete images for a C2000 device: the drive, and the drive for processor in the loop
# (docs/pil.md). Each has a variant for flash and one for RAM (debugger or SCI boot).
# This file is included with TI's toolchain. HT_DEVICE and HT_BOARD come from the preset.
enable_language(ASM)

set(HT_DEVICE "" CACHE STRING "chip of firmware/port/c2000/ht_chips.def")
set(HT_BOARD "" CACHE STRING "board of that table with this chip")
option(HT_XCP "an XCP slave beside the link, on the same serial line (docs/xcp.md)" OFF)
set(HT_PIL_BAUD 625000 CACHE STRING "rate of the serial line, processor in the loop")
set(port firmware/port/c2000)
set(HT_FLASH_API "" CACHE PATH
  "C2000Ware's folder: the flash image keeps parameters, by TI's flash API; empty: it does not")
# Rows of the table: HT_CHIP(chip, family), HT_CHIP_BOARD(chip, board).
file(STRINGS ${port}/ht_chips.def rows REGEX "^HT_CHIP")
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${port}/ht_chips.def)
set(family "")
set(chips "")
set(boards "")
foreach(row IN LISTS rows)
  if(row MATCHES "^HT_CHIP\\(([a-z0-9_]+), ([a-z0-9_]+)\\)")
    list(APPEND chips ${CMAKE_MATCH_1})
    if(CMAKE_MATCH_1 STREQUAL HT_DEVICE)
      set(family ${CMAKE_MATCH_2})
    endif()
  elseif(row MATCHES "^HT_CHIP_BOARD\\(([a-z0-9_]+), ([a-z0-9_]+)\\)" AND CMAKE_MATCH_1 STREQUAL HT_DEVICE)
    list(APPEND boards ${CMAKE_MATCH_2})
  endif()
endforeach()
if(NOT family)
  list(JOIN chips ", " names)
  message(FATAL_ERROR "HT_DEVICE = \"${HT_DEVICE}\": choose one of ${names}")
endif()
if(NOT HT_BOARD IN_LIST boards)
  list(JOIN boards ", " names)
  message(FATAL_ERROR "HT_BOARD = \"${HT_BOARD}\" is no board with a ${HT_DEVICE}: choose one of ${names}")
endif()

# Results must equal the host's bit for bit, so there is no relaxed arithmetic and no TMU.
set(machine -v28 -ml -mt --float_support=fpu32 --abi=eabi)
# The F28335's FPU: no move to a register right before F32TOUI32, FRACF32 or UI16TOF32
# (docs/chip-errata.md). This is TI's default without TMU; the option makes it explicit.
list(APPEND machine --silicon_errata_fpu1_workaround=on)
set(arithmetic --fp_mode=strict --fp_reassoc=off)
set(messages --display_error_number --diag_wrap=off --diag_warning=225)

include(cmake/BuildName.cmake)

# Memory for captures, in 32-bit values: the rest of the RAM.
if(family STREQUAL "f28335")
  set(capture_flash 3072)
  set(capture_ram 256)
else()
  set(capture_flash 20480)
  set(capture_ram 20480)
endif()

# The code of the interrupts runs from RAM: every function in these files.
file(GLOB core CONFIGURE_DEPENDS firmware/core/*.c)
file(GLOB app CONFIGURE_DEPENDS firmware/app/*.c)
file(GLOB link CONFIGURE_DEPENDS firmware/link/*.c)
file(GLOB drivers CONFIGURE_DEPENDS ${port}/*.c)
# The link of the drive's image. It runs from flash, because its requests may wait.
set(background firmware/app/ht_service.c firmware/app/ht_service_requests.c
  firmware/app/ht_requests_drive.c firmware/app/ht_requests_sampling.c firmware/app/ht_requests_session.c
  firmware/app/ht_dictionary.c firmware/app/ht_log.c firmware/app/ht_log_ring.c firmware/app/ht_reset.c
  firmware/app/ht_store.c)
# Frames and the fault snapshot, which both images use. They may run from flash as well.
set(frames firmware/app/ht_snapshot.c firmware/link/ht_packet.c)
set(octets "${CMAKE_CURRENT_SOURCE_DIR}/firmware/link/ht_octets.c")
list(TRANSFORM background PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
list(TRANSFORM frames PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/")
set(service ${link} "${CMAKE_CURRENT_SOURCE_DIR}/firmware/app/ht_service_fast.c")
list(REMOVE_ITEM app ${background} ${frames} ${service})
list(REMOVE_ITEM service ${frames} ${octets})
set(ram ${core} ${app} ${octets} ${port}/image/ht_wait.c)
set(drive_ram ${service} ${drivers} ${port}/image/ht_image.c)
# Processor in the loop: the drivers of the hardware to which the plant is connected run on the PC.
set(chip ht_board ht_c2000_map ht_clock_f28335 ht_clock_f28377s ht_flash ht_pins ht_sci ht_timer
  ht_watchdog)
list(TRANSFORM chip REPLACE "(.+)" "${port}/\\1.c")
# Saving parameters: with a memory for them, or without.
set(no_store ${port}/image/ht_no_store.c)
set(store ${port}/store/ht_store_flash.c ${port}/store/ht_flash_${HT_DEVICE}.c)
file(GLOB pil CONFIGURE_DEPENDS firmware/pil/*.c firmware/pil/calls/*.c ${port}/pil/*.c)
set(pil_ram ${chip} ${pil})
# XCP: what the fast interrupt calls, and the rest. Its memory comes from that for captures.
set(xcp "")
if(HT_XCP)
  set(xcp_ram firmware/link/xcp/ht_xcp_daq.c firmware/link/xcp/ht_xcp_fast.c)
  file(GLOB xcp CONFIGURE_DEPENDS RELATIVE "${CMAKE_CURRENT_SOURCE_DIR}" firmware/link/xcp/*.c)
  set_source_files_properties(${xcp_ram} PROPERTIES COMPILE_OPTIONS "--ramfunc=on")
  if(family STREQUAL "f28335")
    set(capture_flash 1024)
    set(capture_ram 16)
  else()
    set(capture_flash 18432)
    set(capture_ram 18432)
  endif()
endif()
set_source_files_properties(${ram} ${drive_ram} ${pil_ram} ${store} PROPERTIES COMPILE_OPTIONS "--ramfunc=on")
# The code that copies the others to RAM stays in flash.
set(flash ${port}/image/main.c ${port}/image/codestart.asm)

# An image that runs from `place`, with further sources and include folders.
function(ht_c2000_image image place sources folders)
  set(command_file "${CMAKE_CURRENT_SOURCE_DIR}/${port}/image/${HT_DEVICE}_${place}.cmd")
  if(NOT EXISTS "${command_file}") # the memories are those of the family's first chip
    set(command_file "${CMAKE_CURRENT_SOURCE_DIR}/${port}/image/${family}_${place}.cmd")
  endif()
  add_executable(${image} ${ram} ${frames} ${flash} ${sources})
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

# TI's flash API in the user's C2000Ware: include folder and library. For the F28377S also the source
# of the functions that the user must provide (Fapi_UserDefinedFunctions.c), which must have the
# library's version.
if(HT_FLASH_API)
  if(NOT EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${port}/store/ht_flash_${HT_DEVICE}.c")
    message(FATAL_ERROR "HT_FLASH_API: an image for the ${HT_DEVICE} keeps no parameters, for there is "
      "no ${port}/store/ht_flash_${HT_DEVICE}.c")
  endif()
  if(family STREQUAL "f28335")
    set(api f2833x)
    set(headers Flash2833x_API_Library.h)
    set(library "Flash28335_API*.lib")
  else()
    set(api f2837xs)
    set(headers F021_F2837xS_C28x.h F021_F2837xD_C28x.h)
    set(library "F021_API_F2837xS_FPU32*.lib")
  endif()
  set(folder "${HT_FLASH_API}/libraries/flash_api")
  set(api_header "")
  foreach(header IN LISTS headers)
    file(GLOB_RECURSE found "${folder}/${api}/*${header}" "${folder}/f28335/*${header}")
    if(found AND NOT api_header)
      list(GET found 0 api_header)
    endif()
  endforeach()
  file(GLOB_RECURSE api_library "${folder}/${api}/${library}" "${folder}/f28335/${library}")
  # The images use EABI. If there are several libraries, take the one with EABI.
  set(eabi ${api_library})
  list(FILTER eabi INCLUDE REGEX "[Ee][Aa][Bb][Ii]")
  if(eabi)
    set(api_library ${eabi})
  endif()
  if(NOT api_header OR NOT api_library)
    message(FATAL_ERROR
      "HT_FLASH_API = \"${HT_FLASH_API}\": no flash API for the ${HT_DEVICE} in libraries/flash_api.\n"
      "Wanted: the folder of C2000Ware, with one of ${headers} and ${library} in it.\n"
      "Without -DHT_FLASH_API the image keeps no parameters. See docs/flash.md.")
  endif()
  list(GET api_library 0 api_library)
  file(GLOB_RECURSE api_sources
    "${HT_FLASH_API}/device_support/${api}/*Fapi_UserDefinedFunctions.c"
    "${HT_FLASH_API}/driverlib/${api}/*Fapi_UserDefinedFunctions.c"
    "${folder}/${api}/*Fapi_UserDefinedFunctions.c")
  if(api_sources)
    list(GET api_sources 0 api_sources)
    set_source_files_properties(${api_sources} PROPERTIES COMPILE_OPTIONS "--ramfunc=on")
  endif()
  get_filename_component(api_include "${api_header}" DIRECTORY)
  get_filename_component(api_header "${api_header}" NAME)
  get_filename_component(api_place "${api_library}" DIRECTORY)
  get_filename_component(api_library "${api_library}" NAME)
  message(STATUS "Parameters are kept: ${api_library}")
endif()

foreach(place flash ram)
  set(image hexatorque_${HT_BOARD}_${place})
  set(start "${drive_ram};${background};${xcp};${port}/image/devicecal.asm")
  if(HT_FLASH_API AND place STREQUAL "flash")
    ht_c2000_image(${image} ${place} "${start};${store};${api_sources}" "${port}/store;${api_include}")
    target_compile_definitions(${image} PRIVATE "HT_FLASH_API_HEADER=\"${api_header}\"")
    target_link_options(${image} PRIVATE "--search_path=${api_place}"
      "--define=HT_FLASH_API=${api_library}")
  else()
    ht_c2000_image(${image} ${place} "${start};${no_store}" "")
  endif()
  target_compile_definitions(${image} PRIVATE HT_CAPTURE_VALUES=${capture_${place}}u
    "HT_BUILD=\"${HT_BUILD}\"")
  if(HT_XCP)
    target_compile_definitions(${image} PRIVATE HT_XCP)
    target_include_directories(${image} PRIVATE firmware/link/xcp)
  endif()
  set(image hexatorque_${HT_BOARD}_pil_${place})
  ht_c2000_image(${image} ${place} "${pil_ram};${port}/image/devicecal.asm" "firmware/pil;firmware/pil/calls;${port}/pil")
  target_compile_definitions(${image} PRIVATE HT_PIL_BAUD=${HT_PIL_BAUD}u)
endforeach()
