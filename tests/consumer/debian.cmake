# SPDX-License-Identifier: BSD-3-Clause
#
# Debian packages of BUILD, made below WORK: what is in which, what each needs, and that program and core run out of an
# unpacked root, in an empty environment. lintian, where it is installed, finds no error.
cmake_minimum_required(VERSION 3.24)

function(check out)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE text ERROR_VARIABLE err)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${code}:\n${text}${err}")
  endif()
  set(${out} "${text}${err}" PARENT_SCOPE)
endfunction()

# holds PACKAGE PATTERN...: each pattern is in the list of its files; after NOT, none of them.
function(holds package)
  check(files dpkg-deb -c ${${package}})
  set(wanted TRUE)
  foreach(pattern IN LISTS ARGN)
    if(pattern STREQUAL "NOT")
      set(wanted FALSE)
    elseif(wanted AND NOT files MATCHES "${pattern}")
      message(FATAL_ERROR "${package} has no ${pattern}:\n${files}")
    elseif(NOT wanted AND files MATCHES "${pattern}")
      message(FATAL_ERROR "${package} has ${pattern}:\n${files}")
    endif()
  endforeach()
endfunction()

function(needs package)
  check(dependencies dpkg-deb -f ${${package}} Depends)
  foreach(pattern IN LISTS ARGN)
    if(NOT dependencies MATCHES "${pattern}")
      message(FATAL_ERROR "${package} does not depend on ${pattern}: ${dependencies}")
    endif()
  endforeach()
endfunction()

file(REMOVE_RECURSE ${WORK})
check(ignored ${CPACK} --config ${BUILD}/CPackConfig.cmake -B ${WORK}/packages)
check(architecture dpkg --print-architecture)
string(STRIP "${architecture}" architecture)
set(libdynslam-dev ${WORK}/packages/libdynslam-dev_${VERSION}_all.deb)
set(libdynslam-runtime-dev ${WORK}/packages/libdynslam-runtime-dev_${VERSION}_${architecture}.deb)
set(dynslam ${WORK}/packages/dynslam_${VERSION}_${architecture}.deb)

holds(libdynslam-dev usr/include/dynslam/dynslam.hpp usr/include/dynslam/interop/opencv.hpp
  usr/lib[a-z0-9_/-]*/cmake/dynslam/dynslamConfig.cmake usr/share/pkgconfig/dynslam.pc
  usr/share/doc/libdynslam-dev/copyright NOT include/dynslam/runtime/ usr/bin/ "\\.a\n" "\\.so")
holds(libdynslam-runtime-dev usr/include/dynslam/runtime/slam.hpp "libdynslam_io.a\n" "libdynslam_runtime.a\n"
  dynslam-runtime.cmake
  NOT usr/bin/ "\\.so")
holds(dynslam usr/bin/dynslam usr/share/man/man1/dynslam-run.1.gz usr/share/bash-completion/completions/dynslam
  usr/share/dynslam/cameras/realsense_d435.txt usr/share/dynslam/models/demo_segmenter.onnx
  usr/share/doc/dynslam/copyright NOT usr/include "\\.a\n" "usr/lib[a-z0-9_/-]*/libonnxruntime.so\n")
if(EXISTS ${BUILD}/share/dynslam/report/report.html)
  holds(dynslam usr/share/dynslam/report/report.html)
endif()
needs(libdynslam-dev libeigen3-dev)
needs(libdynslam-runtime-dev "libdynslam-dev .= ${VERSION}" "dynslam .= ${VERSION}" libopencv-dev liboctomap-dev)
needs(dynslam libopencv-core liboctomap libfmt libc6)

if(EXISTS ${WORK}/packages/python3-dynslam_${VERSION}_${architecture}.deb)
  set(python3-dynslam ${WORK}/packages/python3-dynslam_${VERSION}_${architecture}.deb)
  holds(python3-dynslam usr/lib/python3/dist-packages/dynslam/_dynslam usr/lib/python3/dist-packages/dynslam/__init__.pyi
    dynslam/cameras/realsense_d435.txt NOT usr/bin/ "\\.a\n")
  needs(python3-dynslam python3-numpy "python3 .<<" libopencv-core)
endif()

foreach(package IN ITEMS libdynslam-dev libdynslam-runtime-dev dynslam)
  check(ignored dpkg-deb -x ${${package}} ${WORK}/root)
endforeach()
set(program env -i ${WORK}/root/usr/bin/dynslam)
check(ignored ${program} synth ${WORK}/sequence --frames 4)
check(ignored ${program} run ${WORK}/sequence --out ${WORK}/out
  --model ${WORK}/root/usr/share/dynslam/models/demo_segmenter.onnx)
if(NOT EXISTS ${WORK}/out/trajectory.txt)
  message(FATAL_ERROR "trajectory.txt was not written")
endif()

find_program(LINTIAN lintian)
if(LINTIAN)
  execute_process(COMMAND ${LINTIAN} --no-cfg --fail-on error --tag-display-limit 0
    --suppress-tags bogus-mail-host  # of the maintainer that nobody has stated
    ${libdynslam-dev} ${libdynslam-runtime-dev} ${dynslam}
    RESULT_VARIABLE code OUTPUT_VARIABLE text ERROR_VARIABLE err)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "lintian ended with ${code}:\n${text}${err}")
  endif()
else()
  message(STATUS "lintian is not installed: the packages were not compared with Debian's policy")
endif()
