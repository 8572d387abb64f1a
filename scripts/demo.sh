#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds the program, renders a synthetic sequence with moving people and things, and runs the whole method and
# its variants on it, people found by the small network in models/; first as the paper has them, where each mask
# shows its worth, then with what came since, where the modes differ by their masks alone. Results, tables and
# images are left in results/demo.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/install-deps.sh app

# As scripts/test.sh, so that one finds what the other compiled.
export CCACHE_DEPEND=${CCACHE_DEPEND:-1}
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros}
mkdir -p build/release results
cmake --preset release -D DYNSLAM_BUILD_TESTS=OFF -D DYNSLAM_BUILD_BENCHMARKS=OFF -D DYNSLAM_BUILD_EXAMPLES=OFF \
  -D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=8 -D DYNSLAM_PRECOMPILE=ON > build/release/configure.log 2>&1 || {
  cat build/release/configure.log
  exit 1
}
cmake --build --preset release --target dynslam -j "$(nproc)"
dynslam=build/release/bin/dynslam

out=results/demo
rm -rf "$out"
"$dynslam" synth "$out/sequence" --path xyz --seed 2
echo
echo "The paper's method, its masks added one by one"
"$dynslam" ablate "$out/sequence" --model models/demo_segmenter.onnx --method paper --map false --out "$out/paper"
echo
echo "The whole method"
report=()  # the page of reports needs npm, as the build has said where there is none
if [ -s build/release/share/dynslam/report/report.html ]; then report=(--report); fi
"$dynslam" ablate "$out/sequence" --model models/demo_segmenter.onnx --out "$out" "${report[@]}"

echo
echo "Results: $PWD/$out (the paper's method: $PWD/$out/paper)"
