# SPDX-License-Identifier: BSD-3-Clause
#
# Renders a short sequence, runs PROGRAM on it in two modes with --report, and has browser.mjs look at the report of both
# in CHROMIUM. Screenshots stay in WORK.
cmake_minimum_required(VERSION 3.24)

function(check out)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE text ERROR_VARIABLE err)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${code}:\n${text}${err}")
  endif()
  set(${out} "${text}" PARENT_SCOPE)
endfunction()

file(SIZE ${MODULES}/report.html size)
if(size EQUAL 0)
  message(STATUS "SKIPPED: the page of reports was not built, npm reached no registry")
  return()
endif()
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
check(ignored ${PROGRAM} synth ${WORK}/office --frames 45 --path xyz --walkers 1 --size 320x240)
check(ignored ${PROGRAM} run ${WORK}/office --out ${WORK}/none --dynamics none --report)
check(ignored ${PROGRAM} run ${WORK}/office --out ${WORK}/both --masks ${WORK}/office/label --report)
check(ignored ${PROGRAM} report ${WORK}/none ${WORK}/both --out ${WORK}/report.html)
check(figures ${PROGRAM} eval ${WORK}/both ${WORK}/office --json)
file(WRITE ${WORK}/eval.json "${figures}")
check(seen ${CMAKE_COMMAND} -E env HOME=${WORK} ${NODE} ${CMAKE_CURRENT_LIST_DIR}/browser.mjs ${MODULES} ${CHROMIUM} ${WORK})
message(STATUS "${seen}")
