# SPDX-License-Identifier: BSD-3-Clause
# Configures, builds and runs against the installed core or the source tree: tests/consumer, or the examples
# that need nothing else (MODE examples). Optimised as much as their time to run asks for: most of it is the compiler's.
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})

if(NOT MODE STREQUAL "subdirectory")
  execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix --component dynslam_core
    COMMAND_ERROR_IS_FATAL ANY OUTPUT_QUIET)
  set(options -D CMAKE_PREFIX_PATH=${WORK}/prefix)
else()
  set(options -D DYNSLAM_SOURCE=${SOURCE})
endif()

set(project tests/consumer)
if(MODE STREQUAL "examples")
  set(project examples)
  list(APPEND options -D
    "CMAKE_CXX_FLAGS=-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Werror -Wno-maybe-uninitialized")
endif()
execute_process(
  COMMAND ${CMAKE_COMMAND} -S ${SOURCE}/${project} -B ${WORK}/build -G ${GENERATOR}
    -D CMAKE_BUILD_TYPE=Release -D "CMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG"
    -D CMAKE_CXX_COMPILER=${COMPILER} -D CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}
    -D CMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON -D CMAKE_DISABLE_FIND_PACKAGE_octomap=ON ${options}
  COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${WORK}/build COMMAND_ERROR_IS_FATAL ANY)
if(MODE STREQUAL "examples")
  execute_process(COMMAND ${CMAKE_CTEST_COMMAND} --test-dir ${WORK}/build --no-tests=error --output-on-failure
    COMMAND_ERROR_IS_FATAL ANY)
else()
  execute_process(COMMAND ${WORK}/build/consumer COMMAND_ERROR_IS_FATAL ANY)
endif()
