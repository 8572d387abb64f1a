#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds with g++ and clang, warnings as errors, and runs every test; then the tests again under the address
# and undefined behaviour sanitizers. Ends with one line that says what passed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/install-deps.sh
jobs=${JOBS:-$(nproc)}
# ccache learns from the compiler which headers a source needs, instead of preprocessing each source once more.
export CCACHE_DEPEND=${CCACHE_DEPEND:-1}
# And it may keep what was compiled with a precompiled header (cmake/self_containment.cmake).
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros}

step() { printf '\n=== %s (%d s so far)\n' "$*" "$SECONDS"; }

# One preset: configure, build, test; tests that compute little are optimised as $2 says, and benchmarks and examples
# are built if $3 says ON. Keeps the last lines of ctest for the summary. Sources are compiled several as one
# (CMAKE_UNITY_BUILD), which takes less than half the time of compiling them one by one.
check() {
  local preset=$1 tests=$2 beside=$3
  step "$preset: configure"
  mkdir -p "build/$preset"
  cmake --preset "$preset" -D DYNSLAM_WERROR=ON -D DYNSLAM_BUILD_TESTS=ON -D DYNSLAM_BUILD_BENCHMARKS="$beside" \
    -D DYNSLAM_BUILD_EXAMPLES="$beside" -D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=8 \
    -D DYNSLAM_TEST_OPTIMIZATION="$tests" \
    > "build/$preset/configure.log" 2>&1 || {
    cat "build/$preset/configure.log"
    exit 1
  }
  step "$preset: build"
  cmake --build --preset "$preset" -j "$jobs"
  step "$preset: test"
  ctest --preset "$preset" -j "$jobs" 2>&1 | tee "build/$preset/ctest.log"
  summary+=("$preset: $(grep 'tests passed' "build/$preset/ctest.log")")
}

summary=()
check release -O1 ON
# clang compiles all but benchmarks and examples (the preset "clang" does) with warnings as errors here, so one build
# serves both purposes.
check asan-ubsan -O0 OFF

step "done"
printf '%s\n' "${summary[@]}"
