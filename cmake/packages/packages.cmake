# SPDX-License-Identifier: BSD-3-Clause
#
# Debian packages, made by `cpack` in the build folder after the program was built:
#
#   libdynslam-dev          headers of the core and of its adapters, CMake and pkg-config files; any architecture
#   libdynslam-runtime-dev  dynslam::io, ::runtime, ::synth, ::evaluation: headers and static libraries
#   dynslam                 the program, its manual pages and completions, cameras and the demo's network; with ONNX
#                           Runtime in a folder of its own where scripts/install-onnxruntime.sh got it
#   python3-dynslam         the Python module, with DYNSLAM_BUILD_PYTHON, for the Python that it was built with
set(DYNSLAM_MAINTAINER "dynslam maintainers <maintainers@dynslam.invalid>" CACHE STRING
  "Who answers for the packages, as name and address")
mark_as_advanced(DYNSLAM_MAINTAINER)

# group, component, component...
set(package_groups
  "libdynslam_dev dynslam_core dynslam_opencv dynslam_octomap"
  "libdynslam_runtime_dev dynslam_runtime"
  "dynslam dynslam_program dynslam_onnxruntime")
if(TARGET dynslam_python)
  list(APPEND package_groups "python3_dynslam dynslam_python")
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME dynslam)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # it would go before each package's own
set(CPACK_PACKAGE_CONTACT "${DYNSLAM_MAINTAINER}")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/packages/prepare.cmake)
set(CPACK_DYNSLAM_SOURCE ${PROJECT_SOURCE_DIR})
list(TRANSFORM package_groups REPLACE " .*" "" OUTPUT_VARIABLE CPACK_DYNSLAM_GROUPS)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_LIBDYNSLAM_DEV_PACKAGE_NAME libdynslam-dev)
set(CPACK_DEBIAN_LIBDYNSLAM_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_LIBDYNSLAM_DEV_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_LIBDYNSLAM_DEV_PACKAGE_DEPENDS "libeigen3-dev (>= 3.4)")
set(CPACK_DEBIAN_LIBDYNSLAM_DEV_PACKAGE_SUGGESTS "libopencv-dev, liboctomap-dev, libdynslam-runtime-dev")
set(CPACK_DEBIAN_LIBDYNSLAM_DEV_DESCRIPTION "RGB-D SLAM for dynamic scenes, headers of the core
Cameras, robust estimation, bundle adjustment, segmentation of what moves,
labelled voxel maps and evaluation, as templates over any scalar, image and
camera type (C++20, Eigen alone), with adapters to OpenCV and OctoMap.")

set(CPACK_DEBIAN_LIBDYNSLAM_RUNTIME_DEV_PACKAGE_NAME libdynslam-runtime-dev)
set(CPACK_DEBIAN_LIBDYNSLAM_RUNTIME_DEV_PACKAGE_SECTION libdevel)
set(runtime_needs "libdynslam-dev (= ${PROJECT_VERSION})" "dynslam (= ${PROJECT_VERSION})"
  libopencv-dev liboctomap-dev nlohmann-json3-dev libfmt-dev libjpeg-dev)
if(ISAL_FOUND)
  list(APPEND runtime_needs libisal-dev)
else()
  list(APPEND runtime_needs libdeflate-dev)
endif()
if(BZip2_FOUND)
  list(APPEND runtime_needs libbz2-dev)
endif()
if(LZ4_FOUND)
  list(APPEND runtime_needs liblz4-dev)
endif()
if(Zstd_FOUND)
  list(APPEND runtime_needs libzstd-dev)
endif()
if(SQLite3_FOUND)
  list(APPEND runtime_needs libsqlite3-dev)
endif()
if(ONNXRuntime_FOUND AND NOT onnxruntime_installed)
  list(APPEND runtime_needs libonnxruntime-dev)
endif()
list(JOIN runtime_needs ", " CPACK_DEBIAN_LIBDYNSLAM_RUNTIME_DEV_PACKAGE_DEPENDS)
set(CPACK_DEBIAN_LIBDYNSLAM_RUNTIME_DEV_DESCRIPTION "RGB-D SLAM for dynamic scenes, the system as a library
The tracker as an object (frames in memory, or of a live camera), readers of
sequences and bags, segmentation networks, saved maps: headers and static
libraries.")

set(CPACK_DEBIAN_DYNSLAM_PACKAGE_NAME dynslam)
set(CPACK_DEBIAN_DYNSLAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_DYNSLAM_PACKAGE_SHLIBDEPS ON)
if(onnxruntime_installed)
  cmake_path(GET onnxruntime_library PARENT_PATH CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS)
endif()
set(CPACK_DEBIAN_DYNSLAM_DESCRIPTION "RGB-D SLAM for dynamic scenes, the program
Tracks the camera of an RGB-D sequence, finds what moves with or without a
segmentation network, and builds a labelled octree map of what stays. Reads
TUM, Bonn, ETH3D, ICL-NUIM, 7-Scenes, Replica, ScanNet and Redwood sequences
and recordings of ROS 1 and 2 (.bag, .mcap, .db3).")

if(TARGET dynslam_python)
  set(CPACK_DEBIAN_PYTHON3_DYNSLAM_PACKAGE_NAME python3-dynslam)
  set(CPACK_DEBIAN_PYTHON3_DYNSLAM_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON3_DYNSLAM_PACKAGE_SHLIBDEPS ON)
  math(EXPR next_python "${Python_VERSION_MINOR} + 1")
  set(python_needs "python3 (>= 3.${Python_VERSION_MINOR})" "python3 (<< 3.${next_python})" python3-numpy)
  if(onnxruntime_installed)
    list(APPEND python_needs "dynslam (= ${PROJECT_VERSION})")
  endif()
  list(JOIN python_needs ", " CPACK_DEBIAN_PYTHON3_DYNSLAM_PACKAGE_DEPENDS)
  set(CPACK_DEBIAN_PYTHON3_DYNSLAM_DESCRIPTION "RGB-D SLAM for dynamic scenes, the Python module
Masks of what moves for a SLAM system in Python, the whole system frame by
frame, readers of sequences, evaluation and queries to maps, on numpy arrays.")
endif()

set(CPACK_COMPONENTS_ALL)
foreach(group IN LISTS package_groups)
  separate_arguments(group)
  list(POP_FRONT group name)
  foreach(component IN LISTS group)
    string(TOUPPER ${component} upper)
    set(CPACK_COMPONENT_${upper}_GROUP ${name})
    list(APPEND CPACK_COMPONENTS_ALL ${component})
  endforeach()
endforeach()
if(NOT onnxruntime_installed)
  list(REMOVE_ITEM CPACK_COMPONENTS_ALL dynslam_onnxruntime)
endif()
include(CPack)
