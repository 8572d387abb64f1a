# SPDX-License-Identifier: BSD-3-Clause
#
# Installs the program of BUILD into a prefix below WORK, moves the prefix, and runs the program there with an empty
# environment: a rendered sequence, with the demo's network.
cmake_minimum_required(VERSION 3.24)

function(check)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${code}:\n${out}${err}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK})
check(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix --component dynslam_runtime)
file(RENAME ${WORK}/prefix ${WORK}/moved)
set(program env -i ${WORK}/moved/bin/dynslam)
check(${program} synth ${WORK}/sequence --frames 6)
check(${program} run ${WORK}/sequence --out ${WORK}/out --model ${SOURCE}/models/demo_segmenter.onnx)
check(${program} info ${WORK}/sequence --camera tum_fr3)  # a preset, by its name
foreach(file IN ITEMS man/man1/dynslam.1 man/man1/dynslam-run.1 bash-completion/completions/dynslam)
  if(NOT EXISTS ${WORK}/moved/share/${file})
    message(FATAL_ERROR "share/${file} is not installed")
  endif()
endforeach()
foreach(file IN ITEMS trajectory.txt map.ot summary.json)
  if(NOT EXISTS ${WORK}/out/${file})
    message(FATAL_ERROR "${file} was not written")
  endif()
endforeach()
