# SPDX-License-Identifier: BSD-3-Clause
# Helper functions of this project's own CMake files. None of this is installed.

# Warnings of our own code: PRIVATE, so that no consumer inherits them.
function(dynslam_warnings target)
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wconversion -Wdouble-promotion -Wshadow
    # clang 19 blames us for the std::iterator in OctoMap's headers; g++ tells of what is deprecated.
    $<$<AND:$<CXX_COMPILER_ID:Clang>,$<VERSION_GREATER_EQUAL:$<CXX_COMPILER_VERSION>,15>>:-Wno-deprecated-declarations>
    $<$<BOOL:${DYNSLAM_WERROR}>:-Werror>)
endfunction()

# Further ones that users of the core have: for what includes its headers and instantiates them.
function(dynslam_header_warnings target)
  target_compile_options(${target} PRIVATE -Wsign-conversion -Wold-style-cast -Wextra-semi -Wnon-virtual-dtor)
endfunction()

# Settings of tests, by DYNSLAM_TEST_OPTIMIZATION if it is given. With COMPUTES their time to run counts: -O1 then.
# A test's own lines are not in a debugger then: they are an eighth of clang's time.
function(dynslam_test_settings target)
  dynslam_warnings(${target})
  if(NOT DYNSLAM_TEST_OPTIMIZATION)
    return()
  endif()
  if("COMPUTES" IN_LIST ARGN)
    target_compile_options(${target} PRIVATE -O1 -g0)
  else()
    target_compile_options(${target} PRIVATE ${DYNSLAM_TEST_OPTIMIZATION} -g0)
  endif()
  # Below -O2 g++ takes values inside Eigen's expressions for ones that may be uninitialised.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endfunction()

# Where DYNSLAM_PRECOMPILE asks for it, TARGET's sources begin with HEADERS (as <Eigen/Dense>), which the compiler reads
# once then. A source still includes all that it uses: builds without this are the rule.
function(dynslam_precompile target)
  if(DYNSLAM_PRECOMPILE AND ARGN)
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
endfunction()

# Settings of benchmarks, and after those of tests of examples.
function(dynslam_bench_settings target)
  dynslam_warnings(${target})
  separate_arguments(flags NATIVE_COMMAND "${DYNSLAM_BENCH_FLAGS}")
  target_compile_options(${target} PRIVATE ${flags})
endfunction()

function(dynslam_example_settings target)
  dynslam_test_settings(${target} COMPUTES)
  dynslam_bench_settings(${target})
endfunction()

# dynslam::NAME, an INTERFACE target for include/dynslam/interop/NAME*.hpp on top of the core.
function(dynslam_add_interop name)
  file(GLOB headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/include/dynslam/interop/${name}*.hpp)
  add_library(dynslam_${name} INTERFACE)
  add_library(dynslam::${name} ALIAS dynslam_${name})
  set_target_properties(dynslam_${name} PROPERTIES EXPORT_NAME ${name})
  target_sources(dynslam_${name} INTERFACE
    FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR}/include FILES ${headers})
  target_link_libraries(dynslam_${name} INTERFACE dynslam::core ${ARGN})
endfunction()

# What nearly every source of the runtime and of the tools reads.
set(dynslam_precompiled_runtime <Eigen/Dense> <fmt/format.h> <opencv2/core.hpp> <opencv2/imgproc.hpp> <algorithm>
  <array> <filesystem> <functional> <map> <memory> <optional> <span> <string> <vector>)

# dynslam::NAME, a static library of the sources in src/FOLDER and the headers in include/dynslam/runtime/FOLDER
# for each of FOLDERS, below the directory at hand. It sees the headers beside its sources and those in PRIVATE_INCLUDES.
function(dynslam_add_library name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "FOLDERS;HEADERS;PRIVATE_INCLUDES;LINK")
  set(headers ${arg_HEADERS})
  set(sources)
  foreach(folder IN LISTS arg_FOLDERS)
    file(GLOB_RECURSE found CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/include/dynslam/runtime/${folder}/*.hpp)
    list(APPEND headers ${found})
    file(GLOB_RECURSE found CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/src/${folder}/*.cpp)
    list(APPEND sources ${found})
  endforeach()
  add_library(dynslam_${name} STATIC ${sources})
  add_library(dynslam::${name} ALIAS dynslam_${name})
  set_target_properties(dynslam_${name} PROPERTIES EXPORT_NAME ${name})
  target_sources(dynslam_${name} PUBLIC FILE_SET HEADERS BASE_DIRS include FILES ${headers})
  target_include_directories(dynslam_${name} PRIVATE src ${arg_PRIVATE_INCLUDES})
  target_compile_definitions(dynslam_${name} PRIVATE DYNSLAM_VERSION="${PROJECT_VERSION}")
  target_link_libraries(dynslam_${name} ${arg_LINK} PRIVATE fmt::fmt)
  dynslam_warnings(dynslam_${name})
  dynslam_precompile(dynslam_${name} ${dynslam_precompiled_runtime})
endfunction()

# Installs targets with their headers as component dynslam_NAME, each exported as dynslam::(its name).
function(dynslam_install name)
  install(TARGETS ${ARGN} EXPORT dynslam-${name} COMPONENT dynslam_${name}
    ARCHIVE COMPONENT dynslam_${name} FILE_SET HEADERS COMPONENT dynslam_${name})
  install(EXPORT dynslam-${name} FILE dynslam-${name}.cmake NAMESPACE dynslam::
    DESTINATION ${dynslam_cmake_dir} COMPONENT dynslam_${name})
endfunction()

# Registers one test per source file of a doctest executable, named PREFIX.FOLDER.FILE. The list is the
# one the executable was compiled from, so no file can be left out; a run in which no test case ran fails.
function(dynslam_register_doctest target prefix)
  foreach(source IN LISTS ARGN)
    cmake_path(RELATIVE_PATH source BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} OUTPUT_VARIABLE relative)
    string(REGEX REPLACE "_test\\.cpp$" "" name ${relative})
    string(REPLACE "/" "." name ${name})
    add_test(NAME ${name} COMMAND ${target} "--source-file=*/tests/${relative}")
    set_tests_properties(${name} PROPERTIES
      LABELS ${prefix} TIMEOUT 1500
      FAIL_REGULAR_EXPRESSION "test cases: +0 \\|")
    if(name MATCHES "_ceres$")
      # All cases of such a file need Ceres; without it they say so and ctest counts the file as skipped.
      set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION "SKIPPED: ")
    endif()
  endforeach()
endfunction()

# Links a target with LIBRARY of an optional package and defines DEFINITION=1, where the package was found.
function(dynslam_link_optional target scope package library definition)
  if(${package}_FOUND)
    target_link_libraries(${target} ${scope} ${library})
    target_compile_definitions(${target} ${scope} ${definition}=1)
  endif()
endfunction()
