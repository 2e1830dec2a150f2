# Rules for the firmware that no compiler warning checks.

# The configuration fails if a source uses a type that the C28x does not have: an 8-bit type, or
# double. Comments and strings are ignored. The FMU is for hosts alone, and FMI has numbers of both types.
function(ht_check_sources root)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS "${root}/*.c" "${root}/*.h" "${root}/*.def")
  list(FILTER sources EXCLUDE REGEX "/port/fmu/")
  foreach(source IN LISTS sources)
    file(READ "${source}" text)
    string(REPLACE ";" " " text "${text}")
    # Comments of both kinds, then string literals.
    string(REGEX REPLACE "/\\*([^*]|\\*+[^*/])*\\*+/" " " text "${text}")
    string(REGEX REPLACE "//[^\n]*" " " text "${text}")
    string(REGEX REPLACE "\"[^\"\n]*\"" " " text "${text}")
    if(text MATCHES "(^|[^A-Za-z0-9_])(u?int8_t|u?int_fast8_t|u?int_least8_t)([^A-Za-z0-9_]|$)")
      message(FATAL_ERROR "${source}: ${CMAKE_MATCH_2} does not exist on C28x (16-bit char)")
    endif()
    if(text MATCHES "(^|[^A-Za-z0-9_])double([^A-Za-z0-9_]|$)")
      message(FATAL_ERROR "${source}: double is not allowed (32 or 64 bits, depending on the ABI)")
    endif()
    # A floating constant without f, in decimal or exponent form.
    if(text MATCHES "(^|[^A-Za-z0-9_.])([0-9]+\\.[0-9]*([eE][-+]?[0-9]+)?|\\.[0-9]+([eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+)([^0-9A-Za-z_.]|$)")
      message(FATAL_ERROR "${source}: double constant ${CMAKE_MATCH_2} (write ${CMAKE_MATCH_2}f)")
    endif()
  endforeach()
endfunction()

# The build fails if a library has mutable data: state belongs to the caller.
function(ht_check_no_mutable_data target)
  if(CMAKE_C_FLAGS MATCHES "-fsanitize")
    return() # sanitizers register every object as data of their own
  endif()
  if(NOT CMAKE_OBJDUMP)
    message(FATAL_ERROR "objdump is needed to check ${target} for mutable data")
  endif()
  add_custom_command(TARGET ${target} POST_BUILD
    COMMAND "${CMAKE_COMMAND}" "-DOBJDUMP=${CMAKE_OBJDUMP}" "-DLIBRARY=$<TARGET_FILE:${target}>"
      -P "${CMAKE_CURRENT_SOURCE_DIR}/cmake/CheckMutableData.cmake"
    VERBATIM)
endfunction()
