#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds the headers' tests for 64-bit ARM by Debian's cross compiler and runs them by qemu-user: more than an hour,
# so not part of scripts/test.sh. Needs scripts/install-deps.sh arm64. The runtime is not built: Debian has no
# OpenCV for cross compilers.
#
#   scripts/test-arm64.sh          # JOBS=N compilers at a time, 2 unless given
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cmake --preset arm64 > /dev/null
cmake --build build/arm64 --target core_tests core_dense_tests conformance_tests conformance_dense_tests \
  --parallel "${JOBS:-2}"
ctest --test-dir build/arm64 --label-regex core --parallel "${JOBS:-2}" --timeout 3000 --output-on-failure "$@"
