# SPDX-License-Identifier: BSD-3-Clause
# cmake -D ROOT=<repository> -P cmake/include_scan.cmake
#
# Checks what the headers below ROOT/include/dynslam, and headers and sources below ROOT/runtime and ROOT/tools include:
#  - core headers: the C++ standard library (but not its streams, files and threads), Eigen and the core; and
#    detail/wide_vectors.hpp alone the compiler's vector instructions;
#  - inside the core in one direction: config and detail/ <- concepts <- image, geometry, robust <- the other folders;
#  - interop headers: the core and one library, never the runtime;
#  - the umbrella header dynslam.hpp: every header of the core;
#  - io, the runtime and the tools in one direction: threads <- ground <- io <- nets <- slam <- config, then synth, run, inspect
#    <- evaluation, view <- report <- cli and python. Ground is what is in no folder: errors, stopwatch, frame and masks;
#    slam.hpp and live.hpp belong to slam;
#  - every header, those of runtime/ and tools/, too: push_macros.hpp first, pop_macros.hpp last.
# Each fault is one line that begins with the file. With EXPECT_FAULTS=n exactly n faults are a success.
cmake_minimum_required(VERSION 3.24)

set(std_headers
  algorithm any array atomic bit bitset cassert cctype cerrno cfenv cfloat charconv chrono cinttypes climits
  cmath compare complex concepts coroutine csetjmp cstdarg cstddef cstdint cstdlib cstring ctime deque
  exception execution forward_list functional initializer_list iterator limits list map memory
  memory_resource new numbers numeric optional queue random ranges ratio set span stack stdexcept string
  string_view tuple type_traits typeindex typeinfo unordered_map unordered_set utility valarray variant
  vector version)

# The layer of a header given by its path below include/dynslam/.
function(layer path out)
  if(path MATCHES "^(config|push_macros|pop_macros)\\.hpp$|^detail/")
    set(${out} 0 PARENT_SCOPE)
  elseif(path MATCHES "^concepts/")
    set(${out} 1 PARENT_SCOPE)
  elseif(path MATCHES "^(image|geometry|robust)/")
    set(${out} 2 PARENT_SCOPE)
  elseif(path MATCHES "/")
    set(${out} 3 PARENT_SCOPE)
  else()
    set(${out} 4 PARENT_SCOPE)
  endif()
endfunction()

set(base ${ROOT}/include/dynslam)
file(GLOB_RECURSE headers ${base}/*.hpp)
if(NOT headers)
  message(FATAL_ERROR "no headers below ${base}")
endif()

set(faults 0)
foreach(header IN LISTS headers)
  cmake_path(RELATIVE_PATH header BASE_DIRECTORY ${base} OUTPUT_VARIABLE self)
  layer(${self} self_layer)
  string(REGEX MATCH "^interop/" interop "${self}")

  file(READ ${header} text)
  # A list separator or bracket in the text would change how CMake splits it into lines.
  string(REGEX REPLACE "[][;\\\\]" " " text "${text}")
  string(REPLACE "\n" ";" lines "${text}")
  set(number 0)
  foreach(line IN LISTS lines)
    math(EXPR number "${number} + 1")
    if(NOT line MATCHES "^[ \t]*#[ \t]*include[ \t]*([<\"])([^>\"]+)[>\"]")
      continue()
    endif()
    set(included ${CMAKE_MATCH_2})
    set(reason "")
    if(included MATCHES "^dynslam/(.+)$")
      set(other ${CMAKE_MATCH_1})
      layer(${other} other_layer)
      if(other MATCHES "^runtime/")
        set(reason "the runtime is above this header")
      elseif(NOT interop AND other MATCHES "^interop/")
        set(reason "the core must not include an interop header")
      elseif(NOT EXISTS ${base}/${other})
        set(reason "no such header")
      elseif(NOT interop AND other_layer GREATER self_layer)
        set(reason "${other} is in a higher layer")
      endif()
    elseif(included MATCHES "^(Eigen|unsupported/Eigen)/" OR included IN_LIST std_headers)
    elseif(interop AND included MATCHES "^(opencv2|octomap)/")
    elseif(self STREQUAL "detail/wide_vectors.hpp" AND included STREQUAL "immintrin.h")
    else()
      set(reason "not std, Eigen or the core of dynslam, or a part of std that the core does not use")
    endif()
    if(reason)
      math(EXPR faults "${faults} + 1")
      message("${header}:${number}: includes ${included}: ${reason}")
    endif()
  endforeach()
endforeach()

# The floor of a file of the libraries or the tools, given by its path below include/dynslam/runtime/, src/ or tools/; empty:
# it has none.
set(floors threads ground io nets slam config "synth run inspect" "evaluation view" report "cli python")
function(floor path out)
  if(path MATCHES "^(slam|live)\\.hpp$")
    set(folder slam)
  elseif(path MATCHES "^([a-z0-9_]+)/")
    set(folder ${CMAKE_MATCH_1})
  else()
    set(folder ground)
  endif()
  set(${out} "" PARENT_SCOPE)
  set(number 0)
  foreach(names IN LISTS floors)
    separate_arguments(names)
    if(folder IN_LIST names)
      set(${out} ${number} PARENT_SCOPE)
    endif()
    math(EXPR number "${number} + 1")
  endforeach()
endfunction()

file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/runtime/*.hpp ${ROOT}/runtime/*.cpp
  ${ROOT}/tools/*.hpp ${ROOT}/tools/*.cpp)
foreach(file IN LISTS files)
  string(REGEX MATCH "^(runtime/io|runtime|tools)/(include/dynslam/runtime/|src/)?(.*)$" self ${file})
  set(self ${CMAKE_MATCH_3})
  floor(${self} self_floor)
  if(self_floor STREQUAL "")
    math(EXPR faults "${faults} + 1")
    message("${ROOT}/${file}: stands in a folder that has no floor in cmake/include_scan.cmake")
    continue()
  endif()
  file(STRINGS ${ROOT}/${file} lines REGEX "^[ \t]*#[ \t]*include[ \t]*[<\"]")
  foreach(line IN LISTS lines)
    # Of this project are dynslam/runtime/FOLDER/NAME.hpp and "FOLDER/NAME.hpp".
    string(REGEX REPLACE "^[^<\"]*[<\"](.*)[>\"].*$" "\\1" included "${line}")
    string(REGEX REPLACE "^dynslam/runtime/" "" other "${included}")
    if(other STREQUAL included AND (NOT line MATCHES "\"[a-z0-9_]+/" OR included MATCHES "^dynslam/"))
      continue()
    endif()
    floor(${other} other_floor)
    if(NOT other_floor STREQUAL "" AND other_floor GREATER self_floor)
      math(EXPR faults "${faults} + 1")
      list(GET floors ${other_floor} above)
      message("${ROOT}/${file}: includes ${included}: ${above} is above this file")
    endif()
  endforeach()
endforeach()

file(GLOB_RECURSE runtime_headers ${ROOT}/runtime/io/include/dynslam/*.hpp ${ROOT}/runtime/include/dynslam/*.hpp
  ${ROOT}/tools/include/dynslam/*.hpp)
foreach(header IN LISTS headers runtime_headers)
  if(header MATCHES "/(push|pop)_macros\\.hpp$")
    continue()
  endif()
  file(READ ${header} text)
  string(REGEX MATCH "#include[^\n]*" first "${text}")
  if(NOT first STREQUAL "#include \"dynslam/push_macros.hpp\"" OR
     NOT text MATCHES "\n#include \"dynslam/pop_macros.hpp\"\n$")
    math(EXPR faults "${faults} + 1")
    message("${header}:1: does not include dynslam/push_macros.hpp first and dynslam/pop_macros.hpp last")
  endif()
endforeach()

if(EXISTS ${base}/dynslam.hpp)
  file(READ ${base}/dynslam.hpp umbrella)
  foreach(header IN LISTS headers)
    cmake_path(RELATIVE_PATH header BASE_DIRECTORY ${base} OUTPUT_VARIABLE self)
    if(self MATCHES "^interop/" OR self STREQUAL "dynslam.hpp")
      continue()
    endif()
    string(FIND "${umbrella}" "dynslam/${self}" position)
    if(position EQUAL -1)
      math(EXPR faults "${faults} + 1")
      message("${base}/dynslam.hpp:1: does not include dynslam/${self}")
    endif()
  endforeach()
endif()

list(LENGTH headers count)
message("${count} headers, ${faults} faults")
if(DEFINED EXPECT_FAULTS)
  if(NOT faults EQUAL EXPECT_FAULTS)
    message(FATAL_ERROR "expected ${EXPECT_FAULTS} faults")
  endif()
elseif(faults)
  message(FATAL_ERROR "include scan failed")
endif()
