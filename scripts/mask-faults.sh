#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Runs a sequence with masks of ten kinds that are wrong (dynslam mask-faults --help) and prints coverage and ATE of
# `both` with each, beside `none` and `geometric`, which use none of them.
#
#   scripts/mask-faults.sh SEQUENCE [FOLDER [SEEDS]]
#
# Results go to FOLDER (default: results/mask-faults/NAME). With several seeds, as "1 2 3 4 5" (default: 1), the fewest
# frames tracked by one of them, the median of their ATE and the greatest, and the masks rejected in the last.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
sequence=${1:?a sequence in TUM layout, with ground truth}
out=${2:-results/mask-faults/$(basename "$sequence")}
read -ra seeds <<< "${3:-1}"
program=${DYNSLAM:-build/release/bin/dynslam}
faults='object-always object-third object-first-half object-second-half cover mirrored late shifted empty blobs'
mkdir -p "$out"

. scripts/run-figures.sh

run() {  # name, then the mode and its options
  local name=$1 seed folder error errors=() tracked=() sorted least
  shift
  for seed in "${seeds[@]}"; do
    folder=$out/$name/$seed
    mkdir -p "$folder"
    "$program" run "$sequence" --out "$folder" --seed "$seed" --map false "${@}" > /dev/null 2> "$folder/log" || true
    "$program" eval "$folder/trajectory.txt" "$sequence/groundtruth.txt" --json > "$folder/eval.json" 2> /dev/null || true
    error=$(ate "$folder/eval.json")
    errors+=("${error:-inf}")  # nothing was tracked
    tracked+=("$(number tracked "$folder/summary.json")")
  done
  mapfile -t sorted < <(printf '%s\n' "${errors[@]}" | sort -g)
  least=$(printf '%s\n' "${tracked[@]}" | sort -n | sed -n 1p)
  printf '%-20s %4s of %4s %9.4f %9.4f %9s\n' "$name" "$least" "$(number frames "$folder/summary.json")" \
    "${sorted[$(((${#sorted[@]} - 1) / 2))]}" "${sorted[-1]}" "$(number masks_rejected "$folder/summary.json")"
}

printf '%-20s %12s %9s %9s %9s\n' masks tracked 'ATE [m]' greatest rejected
run none --dynamics none
run geometric --dynamics geometric
for fault in $faults; do
  "$program" mask-faults "$sequence" "$out/masks/$fault" --fault "$fault" > /dev/null 2>&1
  run "$fault" --dynamics both --masks "$out/masks/$fault"
done
