#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Runs a sequence with masks of ten kinds that are wrong (dynslam mask-faults --help) and prints coverage and ATE of
# `both` with each, beside `none` and `geometric`, which use none of them.
#
#   scripts/mask-faults.sh SEQUENCE [FOLDER]     results go to FOLDER (default: results/mask-faults/NAME)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
sequence=${1:?a sequence in TUM layout, with ground truth}
out=${2:-results/mask-faults/$(basename "$sequence")}
program=${DYNSLAM:-build/release/bin/dynslam}
faults='object-always object-third object-first-half object-second-half cover mirrored late shifted empty blobs'
mkdir -p "$out"

. scripts/run-figures.sh

run() {  # name, then the mode and its options
  local name=$1
  shift
  "$program" run "$sequence" --out "$out/$name" --map false "${@}" > /dev/null 2> "$out/$name.log" || true
  "$program" eval "$out/$name/trajectory.txt" "$sequence/groundtruth.txt" --json > "$out/$name.json" 2> /dev/null || true
  printf '%-20s %4s of %4s %9.4f %9s\n' "$name" "$(number tracked "$out/$name/summary.json")" \
    "$(number frames "$out/$name/summary.json")" \
    "$(ate "$out/$name.json")" \
    "$(number masks_rejected "$out/$name/summary.json")"
}

printf '%-20s %12s %9s %9s\n' masks tracked 'ATE [m]' rejected
run none --dynamics none
run geometric --dynamics geometric
for fault in $faults; do
  "$program" mask-faults "$sequence" "$out/masks/$fault" --fault "$fault" 2> /dev/null
  run "$fault" --dynamics both --masks "$out/masks/$fault"
done
