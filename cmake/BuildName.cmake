# The build's name in the reply to HELLO, HT_BUILD: "version+commit", the gates' polarity if it is
# not the usual one, and a note if the initial values come from a set-up.
set(version "unknown")
foreach(file host/hexatorque/__init__.py ../__init__.py) # of the repository, installed
  if(EXISTS "${PROJECT_SOURCE_DIR}/${file}")
    file(STRINGS "${PROJECT_SOURCE_DIR}/${file}" line REGEX "^__version__")
    string(REGEX REPLACE ".*\"(.*)\".*" "\\1" version "${line}")
  endif()
endforeach()
execute_process(COMMAND git describe --always --dirty WORKING_DIRECTORY "${PROJECT_SOURCE_DIR}"
  OUTPUT_VARIABLE commit ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
set(HT_BUILD "${version}")
if(commit)
  string(APPEND HT_BUILD "+${commit}")
endif()
if(HT_GATES_ACTIVE_LOW)
  string(APPEND HT_BUILD "+active-low")
endif()
if(HT_SETUP)
  string(APPEND HT_BUILD "+setup")
endif()
