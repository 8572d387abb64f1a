# SPDX-License-Identifier: BSD-3-Clause
#
# Writes the commit that is built, as a string, into OUT where it is another one than before: cmake -D SOURCE=DIR -D
# OUT=FILE -P commit.cmake. Empty where SOURCE is no repository, or git is not installed.
set(commit "")
find_program(GIT git)
if(GIT AND EXISTS ${SOURCE}/.git)
  execute_process(COMMAND ${GIT} describe --always --dirty --abbrev=12 --exclude=* WORKING_DIRECTORY ${SOURCE}
    OUTPUT_VARIABLE commit ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
endif()
file(CONFIGURE OUTPUT ${OUT} CONTENT "#pragma once\n#define DYNSLAM_COMMIT \"${commit}\"\n" @ONLY)
