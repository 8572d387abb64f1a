# SPDX-License-Identifier: BSD-3-Clause
# Every public header compiles alone: the target `self_containment` has a source for each that includes it and nothing
# else. Of the big libraries, those that a header reaches in any case are precompiled and stand before it, so that it
# sees no declaration more than alone, and the compiler reads Eigen once instead of a hundred times.

set(self_containment_precompiled Eigen/Core opencv2/core.hpp octomap/OccupancyOcTreeBase.h)

# Which of self_containment_precompiled HEADER includes, by itself or by our headers.
function(dynslam_reached header out)
  get_property(known GLOBAL PROPERTY dynslam_reached_${header} SET)
  if(NOT known)
    set_property(GLOBAL PROPERTY dynslam_reached_${header} "")  # ends a circle
    set(reached)
    file(STRINGS ${header} lines REGEX "^#include [<\"]")
    foreach(line IN LISTS lines)
      string(REGEX REPLACE "^#include [<\"]([^>\"]*).*" "\\1" name ${line})
      if(name IN_LIST self_containment_precompiled)
        list(APPEND reached ${name})
      elseif(name MATCHES "^dynslam/")
        foreach(folder IN ITEMS ${PROJECT_SOURCE_DIR}/include ${PROJECT_SOURCE_DIR}/runtime/io/include
            ${PROJECT_SOURCE_DIR}/runtime/include ${PROJECT_SOURCE_DIR}/tools/include)
          if(EXISTS ${folder}/${name})
            dynslam_reached(${folder}/${name} more)
            list(APPEND reached ${more})
          endif()
        endforeach()
      endif()
    endforeach()
    list(SORT reached)
    list(REMOVE_DUPLICATES reached)
    set_property(GLOBAL PROPERTY dynslam_reached_${header} "${reached}")
  endif()
  get_property(reached GLOBAL PROPERTY dynslam_reached_${header})
  set(${out} "${reached}" PARENT_SCOPE)
endfunction()

# The sources of TARGETS' headers, compiled as what links to TARGETS.
function(dynslam_check_self_containment)
  set(parts)
  foreach(target IN LISTS ARGN)
    get_property(headers TARGET ${target} PROPERTY HEADER_SET)
    list(FILTER headers EXCLUDE REGEX "/(push|pop)_macros\\.hpp$")  # the two belong together
    foreach(header IN LISTS headers)
      dynslam_reached(${header} reached)
      string(MAKE_C_IDENTIFIER "self_containment_${ARGV0}_${reached}" part)
      string(REGEX REPLACE "^.*/include/dynslam/" "dynslam/" header ${header})
      string(MAKE_C_IDENTIFIER ${header} name)
      file(GENERATE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/self_containment/${name}.cpp CONTENT "#include <${header}>\n")
      list(APPEND sources_${part} ${CMAKE_CURRENT_BINARY_DIR}/self_containment/${name}.cpp)
      set(reached_${part} ${reached})
      list(APPEND parts ${part})
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES parts)
  foreach(part IN LISTS parts)
    add_library(${part} OBJECT EXCLUDE_FROM_ALL ${sources_${part}})
    set_target_properties(${part} PROPERTIES UNITY_BUILD OFF)
    target_link_libraries(${part} PRIVATE ${ARGN})
    dynslam_warnings(${part})
    dynslam_header_warnings(${part})
    target_compile_options(${part} PRIVATE -O0 -g0)
    list(LENGTH sources_${part} count)
    if(reached_${part} AND count GREATER 3)  # what fewer need is not worth a precompiled header
      list(TRANSFORM reached_${part} REPLACE "(.+)" "<\\1>")
      target_precompile_headers(${part} PRIVATE ${reached_${part}})
    endif()
    add_dependencies(self_containment ${part})
  endforeach()
endfunction()
