#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds the tests of the runtime and of whole runs with clang's thread sanitizer and runs them; a data race or a deadlock fails its test.
# Libraries that are not instrumented (OpenCV's pool, ONNX Runtime) are not looked into.
#
#   scripts/thread-sanitizer.sh [CTEST OPTION...]      e.g. -R runtime.slam
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/install-deps.sh
mkdir -p build/tsan
cmake --preset tsan -D DYNSLAM_BUILD_TESTS=ON -D DYNSLAM_BUILD_BENCHMARKS=OFF -D DYNSLAM_BUILD_EXAMPLES=OFF \
  -D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=8 > build/tsan/configure.log 2>&1 || {
  cat build/tsan/configure.log
  exit 1
}
cmake --build --preset tsan --target runtime_tests system_tests -j "${JOBS:-$(nproc)}"
ctest --preset tsan "$@"
