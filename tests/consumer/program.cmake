# SPDX-License-Identifier: BSD-3-Clause
#
# Installs BUILD into a prefix below WORK, moves the prefix, and uses what is there: the program with an empty
# environment (a rendered sequence, with the demo's network), and the library from another project, which is
# told what is missing where OpenCV is not found.
cmake_minimum_required(VERSION 3.24)

function(check)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${code}:\n${out}${err}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK})
foreach(component IN ITEMS core opencv octomap runtime onnxruntime program)
  check(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix --component dynslam_${component})
endforeach()
file(RENAME ${WORK}/prefix ${WORK}/moved)
set(program env -i ${WORK}/moved/bin/dynslam)
check(${program} synth ${WORK}/sequence --frames 6)
check(${program} run ${WORK}/sequence --out ${WORK}/out --model ${WORK}/moved/share/dynslam/models/demo_segmenter.onnx)
if(EXISTS ${BUILD}/share/dynslam/report/report.html)  # npm was there
  check(${program} report ${WORK}/out)
endif()
check(${program} info ${WORK}/sequence --camera tum_fr3)  # a preset, by its name
foreach(file IN ITEMS man/man1/dynslam.1 man/man1/dynslam-run.1 bash-completion/completions/dynslam)
  if(NOT EXISTS ${WORK}/moved/share/${file})
    message(FATAL_ERROR "share/${file} is not installed")
  endif()
endforeach()
foreach(file IN ITEMS trajectory.txt map.sot summary.json)
  if(NOT EXISTS ${WORK}/out/${file})
    message(FATAL_ERROR "${file} was not written")
  endif()
endforeach()

set(configure ${CMAKE_COMMAND} -S ${SOURCE}/tests/consumer/runtime -G ${GENERATOR} -D CMAKE_PREFIX_PATH=${WORK}/moved
  -D CMAKE_BUILD_TYPE=Release -D "CMAKE_CXX_FLAGS_RELEASE=-O0 -DNDEBUG" -D CMAKE_CXX_COMPILER=${COMPILER}
  -D CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
check(${configure} -B ${WORK}/consumer)
check(${CMAKE_COMMAND} --build ${WORK}/consumer)
check(env -i ${WORK}/consumer/consumer ${WORK}/sequence)
execute_process(COMMAND ${configure} -B ${WORK}/without_opencv -D CMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON
  RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE err)
string(REGEX REPLACE "[ \n]+" " " err "${err}")  # CMake breaks lines
if(code EQUAL 0 OR NOT err MATCHES "its component 'opencv' needs OpenCV, which was not found .Debian: libopencv-dev")
  message(FATAL_ERROR "without OpenCV, the configuration ended with ${code}:\n${err}")
endif()

# Package files name nothing of the build tree, nor of the sources.
file(GLOB package_files ${WORK}/moved/lib*/cmake/dynslam/*.cmake ${WORK}/moved/lib*/*/cmake/dynslam/*.cmake)
foreach(file IN LISTS package_files)
  file(READ ${file} text)
  foreach(tree IN ITEMS ${BUILD} ${SOURCE})
    string(FIND "${text}" "${tree}" at)
    if(NOT at EQUAL -1)
      message(FATAL_ERROR "${file} names ${tree}")
    endif()
  endforeach()
endforeach()
if(NOT package_files)
  message(FATAL_ERROR "no package files are installed")
endif()
