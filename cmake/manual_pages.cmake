# SPDX-License-Identifier: BSD-3-Clause
#
# Lets PROGRAM print its manual pages and completions into the folder OUT, laid out as below a prefix's share/.
cmake_minimum_required(VERSION 3.24)

function(print_to file)
  execute_process(COMMAND ${PROGRAM} ${ARGN} OUTPUT_FILE ${OUT}/${file} RESULT_VARIABLE code)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${PROGRAM} ${ARGN} ended with ${code}")
  endif()
endfunction()

file(REMOVE_RECURSE ${OUT})
file(MAKE_DIRECTORY ${OUT}/man/man1 ${OUT}/bash-completion/completions ${OUT}/zsh/site-functions
  ${OUT}/fish/vendor_completions.d)
print_to(man/man1/dynslam.1 man)
file(READ ${OUT}/man/man1/dynslam.1 page)
string(REPLACE "\\-" "-" page "${page}")
string(REGEX MATCHALL "dynslam-[a-z-]+" pages "${page}")  # the commands that it lists
list(REMOVE_DUPLICATES pages)
foreach(name IN LISTS pages)
  string(REPLACE "dynslam-" "" command ${name})
  print_to(man/man1/${name}.1 man ${command})
endforeach()
print_to(bash-completion/completions/dynslam completion bash)
print_to(zsh/site-functions/_dynslam completion zsh)
print_to(fish/vendor_completions.d/dynslam.fish completion fish)
