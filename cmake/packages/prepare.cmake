# SPDX-License-Identifier: BSD-3-Clause
#
# cpack runs this when everything is staged: what Debian's policy asks of a package, and an installation from source
# need not have. Copyright and changelog of each package, and compressed manual pages.
cmake_minimum_required(VERSION 3.24)

function(compress file)
  execute_process(COMMAND gzip -9nf ${file} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # SOURCE_DATE_EPOCH, where that is set
foreach(group IN LISTS CPACK_DYNSLAM_GROUPS)
  set(root ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/${group}/usr)
  if(NOT IS_DIRECTORY ${root})
    message(FATAL_ERROR "the package of ${group} was not staged in ${root}")
  endif()
  string(REPLACE "_" "-" package ${group})
  set(doc ${root}/share/doc/${package})
  file(REMOVE_RECURSE ${root}/share/doc)  # the licence, under another name
  configure_file(${CPACK_DYNSLAM_SOURCE}/cmake/packages/copyright ${doc}/copyright COPYONLY)
  file(WRITE ${doc}/changelog "dynslam (${CPACK_PACKAGE_VERSION}) unstable; urgency=medium

  * What changed: CHANGELOG.md of the sources.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
  compress(${doc}/changelog)
endforeach()
file(GLOB pages ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/dynslam/usr/share/man/man1/*.1)
if(NOT pages)
  message(FATAL_ERROR "no manual pages were staged")
endif()
foreach(page IN LISTS pages)
  compress(${page})
endforeach()
