# Initial values of the parameters from a set-up. They are written into a header for ht_params.c when
# CMake configures, and again when the set-up changes. This needs Python 3.11, but not the package.
find_package(Python3 3.11 REQUIRED COMPONENTS Interpreter)
set(initial_values "${CMAKE_CURRENT_BINARY_DIR}/ht_initial_values.h")
set(initial_values_tool "${CMAKE_CURRENT_SOURCE_DIR}/cmake/initial_values.py")
execute_process(
  COMMAND "${Python3_EXECUTABLE}" "${initial_values_tool}" "${HT_SETUP}" "${HT_DEVICE}" "${initial_values}"
  WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}"
  RESULT_VARIABLE result OUTPUT_VARIABLE initial_values_from ERROR_VARIABLE said
  OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_STRIP_TRAILING_WHITESPACE)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "HT_SETUP: ${said}")
endif()
string(REPLACE "\n" ";" initial_values_from "${initial_values_from}")
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
  "${initial_values_tool}" ${initial_values_from})
set_source_files_properties("${CMAKE_CURRENT_SOURCE_DIR}/firmware/app/ht_params.c" PROPERTIES
  COMPILE_DEFINITIONS "HT_INITIAL_VALUES=\"${initial_values}\""
  OBJECT_DEPENDS "${initial_values}")
message(STATUS "Parameters start with those of ${HT_SETUP}")
