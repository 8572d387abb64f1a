# SPDX-License-Identifier: BSD-3-Clause
#
# The page that `--report` puts runs into: scripts of tools/report with libraries from npm, as one HTML file beside the
# program. DYNSLAM_REPORT says whether; without npm or a registry AUTO builds the program without it.
set(dynslam_report OFF)
if(PROJECT_IS_TOP_LEVEL)
  set(dynslam_report AUTO)
endif()
set(DYNSLAM_REPORT ${dynslam_report} CACHE STRING "Build the page of reports by npm: ON, OFF, or AUTO (where npm is there)")
set_property(CACHE DYNSLAM_REPORT PROPERTY STRINGS AUTO ON OFF)

set(dynslam_report OFF)
if(DYNSLAM_REPORT)
  find_program(DYNSLAM_NPM npm)
  find_program(DYNSLAM_NODE NAMES node nodejs)
  mark_as_advanced(DYNSLAM_NPM DYNSLAM_NODE)
  if(DYNSLAM_NPM AND DYNSLAM_NODE)
    set(dynslam_report ON)
  elseif(DYNSLAM_REPORT STREQUAL "AUTO")
    message(STATUS "Reports: --report is left out of the program, npm was not found (Debian: nodejs, npm)")
  else()
    message(FATAL_ERROR "DYNSLAM_REPORT is on, and npm was not found (Debian: nodejs, npm)")
  endif()
endif()

# dynslam_add_report(PROGRAM): the page in share/ of the build tree, up to date with the program.
function(dynslam_add_report program)
  if(NOT dynslam_report)
    return()
  endif()
  set(source ${PROJECT_SOURCE_DIR}/tools/report)
  set(work ${PROJECT_BINARY_DIR}/report)
  set(page ${work}/report.html)
  if(EXISTS ${page})  # an empty one was left by a build that could not make it
    file(SIZE ${page} size)
    if(size EQUAL 0)
      file(REMOVE ${page})
    endif()
  endif()
  set(required OFF)
  if(NOT DYNSLAM_REPORT STREQUAL "AUTO")
    set(required ON)
  endif()
  set(omit dev)
  if(DYNSLAM_BUILD_TESTS)  # which look at the page in a browser
    set(omit "")
  endif()
  file(GLOB scripts CONFIGURE_DEPENDS ${source}/src/*)
  add_custom_command(OUTPUT ${page} VERBATIM
    COMMAND ${CMAKE_COMMAND} -D SOURCE=${source} -D WORK=${work} -D NPM=${DYNSLAM_NPM} -D NODE=${DYNSLAM_NODE}
      -D REQUIRED=${required} -D OMIT=${omit} -P ${PROJECT_SOURCE_DIR}/cmake/report_page.cmake
    DEPENDS ${scripts} ${source}/build.mjs ${source}/package.json ${source}/package-lock.json
      ${PROJECT_SOURCE_DIR}/cmake/report_page.cmake
    COMMENT "Bundling the page of reports")
  add_custom_target(dynslam_report_page DEPENDS ${page})
  add_dependencies(${program} dynslam_report_page)
  set_property(TARGET ${program} APPEND PROPERTY LINK_DEPENDS ${page})  # what stands behind comes after it
  add_custom_command(TARGET ${program} POST_BUILD VERBATIM
    COMMAND ${CMAKE_COMMAND} -D WORK=${work} -D TO=${PROJECT_BINARY_DIR}/share/dynslam/report
      -P ${PROJECT_SOURCE_DIR}/cmake/report_page.cmake)
endfunction()
