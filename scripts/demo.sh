#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds the program, renders a synthetic office with people walking and a box being carried, and compares on it a plain
# tracker, the paper's method and dynslam, people found by the small network in models/. The last lines say what came
# out and how to look at it; tables, pictures and maps are left in results/demo.
#
#   ABLATION=off scripts/demo.sh    without the tables of all masks (results/demo/ablation), half of the time
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
began=$(date +%s)
# shellcheck source=scripts/progress.sh
source scripts/progress.sh

scripts/install-deps.sh app

# As scripts/test.sh, so that one finds what the other compiled.
export CCACHE_DEPEND=${CCACHE_DEPEND:-1}
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros}
build=build/release out=results/demo
mkdir -p "$build" results
configure() {
  cmake --preset release -D DYNSLAM_BUILD_TESTS=OFF -D DYNSLAM_BUILD_BENCHMARKS=OFF -D DYNSLAM_BUILD_EXAMPLES=OFF \
    -D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=8 -D DYNSLAM_PRECOMPILE=ON
}
with_progress "configuring the build" "$build/configure.log" configure
with_progress "compiling the program" "$build/build.log" cmake --build --preset release --target dynslam -j "$(nproc)"
dynslam=$build/bin/dynslam model=models/demo_segmenter.onnx

rm -rf "$out"
mkdir -p "$out"
with_progress "rendering the office" "$out/synth.log" "$dynslam" synth "$out/sequence" --path xyz --seed 2

# evaluate NAME: errors of its trajectory and masks, and what is left of people in its map
evaluate() {
  "$dynslam" eval "$out/$1" "$out/sequence" --map --json > "$out/$1/errors.json"
  "$dynslam" eval-masks "$out/$1/masks" "$out/sequence/dynamic_mask" --moving --json > "$out/$1/masks.json"
}
# compare NAME OPTIONS...: a run, and what it is like
compare() {
  local name=$1
  shift
  with_progress "running $name" "$out/$name.log" \
    "$dynslam" run "$out/sequence" --out "$out/$name" --save-masks ${report[@]+"${report[@]}"} "$@"
  with_progress "evaluating $name" "$out/$name.evaluation.log" evaluate "$name"
}
report=()  # the page of reports needs npm, as the build has said where there is none
if [ -s "$build/share/dynslam/report/report.html" ]; then report=(--report); fi
compare plain --dynamics none
compare paper --dynamics both --method paper --model "$model"
compare dynslam --dynamics both --model "$model"
if [ "${#report[@]}" -gt 0 ]; then
  with_progress "writing the report" "$out/report.log" \
    "$dynslam" report "$out/plain" "$out/paper" "$out/dynslam" --out "$out/report.html"
fi
if [ "${ABLATION:-on}" != off ]; then
  for method in paper full; do
    with_progress "comparing masks, method $method" "$out/ablation_$method.log" "$dynslam" ablate "$out/sequence" \
      --model "$model" --method "$method" --map false --out "$out/ablation/$method"
  done
fi

# field NAME FILE: the first number of that name
field() { sed -n "s/.*\"$1\":\([-0-9.e]*\).*/\1/p" "$2" | head -n 1; }
# ate FILE: RMSE in centimetres, of the final trajectory
ate() { grep -o '"ate_m":{[^}]*}' "$1" | head -n 1 | sed 's/.*"rmse":\([0-9.e-]*\).*/\1/' | awk '{printf "%.1f cm", 100 * $1}'; }
row() {
  local folder=$out/$2 iou=-
  if [ "$2" != plain ]; then iou=$(field iou "$folder/masks.json" | awk '{printf "%.2f", $1}'); fi
  printf '  %-42s %10s %10s %12s\n' "$1" "$(ate "$folder/errors.json")" "$iou" "$(field voxels "$folder/errors.json") voxels"
}
took=$(($(date +%s) - began))
echo
echo "An office with people walking and a box being carried, rendered: 150 frames, exact truth."
echo
printf '  %-42s %10s %10s %12s\n' "" "error" "mask IoU" "left in map"
row "plain tracker, no masks (--dynamics none)" plain
row "the paper's method (--method paper)" paper
row "dynslam (--dynamics both)" dynslam
echo
echo "  error: RMSE of the trajectory (ATE), one seed: millimetres between rows mean nothing. Left in map: 5 cm"
echo "  voxels that only people or the box were seen in."
echo
if [ "${#report[@]}" -gt 0 ]; then
  echo "See it:     $out/report.html, in any browser"
else
  echo "See it:     $out/dynslam/masks, and dynslam map render $out/dynslam/map.sot map.png"
fi
if [ "${ABLATION:-on}" != off ]; then echo "All masks:  $out/ablation/paper/tables.md, $out/ablation/full/tables.md"; fi
echo "Your data:  $dynslam info SEQ     (then run SEQ; docs/your-own-data.md)"
echo "Took:       $((took / 60)) min $((took % 60)) s"
