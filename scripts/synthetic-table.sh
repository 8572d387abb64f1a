#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Ablates synthetic sequences of 300 frames, four camera paths with people walking and one with people sitting, three
# seeds each, and prints one line of ATE RMSE [m] per sequence. About a minute per sequence on two cores.
#
#   scripts/synthetic-table.sh [FOLDER]     results and sequences go there (default: results/synthetic)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-results/synthetic}
program=${DYNSLAM:-build/release/bin/dynslam}
mkdir -p "$out"

. scripts/run-figures.sh

printf '%-22s %10s %10s %10s %10s\n' sequence none semantic geometric both
for scene in walking_static walking_xyz walking_rpy walking_halfsphere sitting_halfsphere; do
  for seed in 1 2 3; do
    name=${scene}_$seed
    sequence=$out/$name/sequence
    if [ ! -e "$sequence/synth.json" ]; then
      "$program" synth "$sequence" --seed "$seed" --frames 300 --scenario "${scene%_*}" --path "${scene#*_}" > /dev/null
    fi
    printf '%-22s' "$name"
    for mode in none semantic geometric both; do
      "$program" run "$sequence" --out "$out/$name/$mode" --dynamics "$mode" --map false \
        --model models/demo_segmenter.onnx > /dev/null 2> "$out/$name/$mode.log" || true
      "$program" eval "$out/$name/$mode/trajectory.txt" "$sequence/groundtruth.txt" --json > "$out/$name/$mode.json"
      printf ' %10.4f' "$(ate "$out/$name/$mode.json")"
    done
    printf '  lost in both: %s\n' "$(sed -n 's/.*"lost": \([0-9]*\).*/\1/p' "$out/$name/both/summary.json")"
  done
done
