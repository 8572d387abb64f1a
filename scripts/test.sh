#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds everything with g++, warnings as errors, and runs every test. Ends with one line that says what passed.
#
#   scripts/test.sh               what a user wants to know: does all of it work here?
#   scripts/test.sh --sanitizers  and then, as CI does: the core, the tests of it and of the runtime's parts with clang,
#                                 warnings as errors, and those tests again under the address and undefined behaviour
#                                 sanitizers (whole runs under sanitizers: CONTRIBUTING.md)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
sanitizers=
for argument in "$@"; do
  [[ $argument == --sanitizers ]] || {
    echo "$0: expected nothing or --sanitizers, not '$argument'" >&2
    exit 2
  }
  sanitizers=yes
done

scripts/install-deps.sh
jobs=${JOBS:-$(nproc)}
# ccache learns from the compiler which headers a source needs, instead of preprocessing each source once more.
export CCACHE_DEPEND=${CCACHE_DEPEND:-1}
# And it may keep what was compiled with a precompiled header (cmake/self_containment.cmake).
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros}

step() { printf '\n=== %s (%d s so far)\n' "$*" "$SECONDS"; }

# One preset: configure, build $2, test; what computes little is optimised as $3 says, and the further arguments are
# CMake's. Keeps the last lines of ctest for the summary. Sources are compiled several as one (CMAKE_UNITY_BUILD), which
# takes less than half the time of compiling them one by one, and with precompiled headers.
check() {
  local preset=$1 target=$2 optimization=$3
  shift 3
  step "$preset: configure"
  mkdir -p "build/$preset"
  cmake --preset "$preset" -D DYNSLAM_WERROR=ON -D DYNSLAM_BUILD_TESTS=ON -D CMAKE_UNITY_BUILD=ON \
    -D CMAKE_UNITY_BUILD_BATCH_SIZE=8 -D DYNSLAM_PRECOMPILE=ON -D DYNSLAM_TEST_OPTIMIZATION="$optimization" "$@" \
    > "build/$preset/configure.log" 2>&1 || {
    cat "build/$preset/configure.log"
    exit 1
  }
  step "$preset: build"
  cmake --build --preset "$preset" --target "$target" -j "$jobs"
  step "$preset: test"
  ctest --preset "$preset" -j "$jobs" 2>&1 | tee "build/$preset/ctest.log"
  summary+=("$preset: $(grep 'tests passed' "build/$preset/ctest.log")")
}

summary=()
# Benchmarks run here for a moment each: to compile them takes longer.
check release all -O1 -D DYNSLAM_BUILD_BENCHMARKS=ON -D DYNSLAM_BUILD_EXAMPLES=BEYOND_CORE \
  -D DYNSLAM_BENCH_FLAGS="-O1 -g0"
if [[ $sanitizers ]]; then
  # clang compiles these with warnings as errors here (all the rest: the preset "clang"), so one build serves both.
  check asan-ubsan unit_tests -O0 -D DYNSLAM_BUILD_BENCHMARKS=OFF -D DYNSLAM_BUILD_EXAMPLES=OFF
fi

step "done"
printf '%s\n' "${summary[@]}"
