# SPDX-License-Identifier: BSD-3-Clause
#
# Installs the core of BUILD into a prefix below WORK, moves the prefix, and compiles and runs a program with nothing
# but the flags that pkg-config tells: those of Eigen among them.
cmake_minimum_required(VERSION 3.24)

function(check out)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE text ERROR_VARIABLE err
    OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${code}:\n${text}${err}")
  endif()
  set(${out} "${text}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${WORK})
check(ignored ${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix --component dynslam_core)
file(RENAME ${WORK}/prefix ${WORK}/moved)
set(ENV{PKG_CONFIG_PATH} ${WORK}/moved/share/pkgconfig)

check(version ${PKG_CONFIG} --modversion dynslam)
if(NOT version STREQUAL VERSION)
  message(FATAL_ERROR "pkg-config says version '${version}', the project is ${VERSION}")
endif()
file(READ ${WORK}/moved/share/pkgconfig/dynslam.pc text)
foreach(tree IN ITEMS ${BUILD} ${SOURCE})
  string(FIND "${text}" "${tree}" at)
  if(NOT at EQUAL -1)
    message(FATAL_ERROR "dynslam.pc names ${tree}")
  endif()
endforeach()

file(WRITE ${WORK}/main.cpp [[
#include <dynslam/geometry/se3.hpp>
int main() {
  const dynslam::SE3<double> turn = dynslam::SE3<double>::exp(Eigen::Matrix<double, 6, 1>::Constant(0.1));
  return (turn * turn.inverse()).log().norm() < 1e-12 ? 0 : 1;
}
]])
check(flags ${PKG_CONFIG} --cflags dynslam)
separate_arguments(flags UNIX_COMMAND "${flags}")
check(ignored ${COMPILER} -std=c++20 -O0 ${flags} ${WORK}/main.cpp -o ${WORK}/main)
check(ignored ${WORK}/main)
