# SPDX-License-Identifier: BSD-3-Clause
#
# Makes the page of reports, WORK/report.html, out of SOURCE (tools/report): `npm ci` by its lock file, where that has
# changed since the last time, and esbuild. Where it cannot be made and REQUIRED is off, the file is left empty and the
# reason said: the program answers --report with an error then. With TO instead of SOURCE, puts the page there unless
# it is empty.
cmake_minimum_required(VERSION 3.24)

if(DEFINED TO)
  file(SIZE ${WORK}/report.html size)
  if(size GREATER 0)
    file(COPY ${WORK}/report.html DESTINATION ${TO})
  else()
    file(REMOVE ${TO}/report.html)
  endif()
  return()
endif()

# give_up(REASON LOG): LOG is what a command printed.
function(give_up reason log)
  if(REQUIRED)
    message(FATAL_ERROR "The page of reports cannot be made: ${reason}\n${log}")
  endif()
  message(NOTICE "Reports: --report is left out of this program: ${reason} (again when cmake configures; docs/report.md)")
  file(WRITE ${WORK}/report.html "")
endfunction()

file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json DESTINATION ${WORK})
file(SHA256 ${SOURCE}/package-lock.json wanted)
string(APPEND wanted " ${OMIT}")
set(got)
if(EXISTS ${WORK}/installed.txt)
  file(READ ${WORK}/installed.txt got)
endif()
if(NOT got STREQUAL wanted)
  file(REMOVE ${WORK}/installed.txt)
  set(omit)
  if(OMIT)
    set(omit --omit=${OMIT})
  endif()
  # Packages bring no scripts of their own to run; a registry that does not answer is not waited for.
  execute_process(COMMAND ${NPM} ci ${omit} --ignore-scripts --no-audit --no-fund --no-update-notifier --prefer-offline
      --fetch-retries=1 --fetch-timeout=60000
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE code OUTPUT_VARIABLE log ERROR_VARIABLE log TIMEOUT 300)
  if(NOT code EQUAL 0)
    string(REGEX MATCH "npm (error|ERR!) code [A-Z0-9_]+" why "${log}")
    give_up("npm ci ended with ${code}, ${why}" "${log}")
    return()
  endif()
  file(WRITE ${WORK}/installed.txt "${wanted}")
endif()
execute_process(COMMAND ${NODE} ${SOURCE}/build.mjs ${WORK} ${WORK}/report.html
  RESULT_VARIABLE code OUTPUT_VARIABLE log ERROR_VARIABLE log)
if(NOT code EQUAL 0)
  give_up("esbuild ended with ${code}" "${log}")
endif()
