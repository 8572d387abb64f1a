#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Renders the same camera paths through the same office at several image sizes and rates, runs each with the defaults,
# and prints frames tracked and ATE, and how much more or less that is than at 640x480 and 30 Hz.
#
#   scripts/resample-table.sh [FOLDER] [SECONDS]     results and sequences go to FOLDER (default: results/resample);
#                                                    each sequence lasts SECONDS (default: 3)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-results/resample}
seconds=${2:-3}
program=${DYNSLAM:-build/release/bin/dynslam}
mkdir -p "$out"

. scripts/run-figures.sh
step() {  # mean distance between frames [m]
  awk '!/^#/ { if (n++) s += sqrt(($2-x)^2 + ($3-y)^2 + ($4-z)^2); x = $2; y = $3; z = $4 } END { print s / (n - 1) }' "$1"
}

printf '%-20s %-10s %-9s %5s %9s %12s %9s %7s\n' scene mode size Hz 'step [m]' tracked 'ATE [m]' change
for scene in empty_xyz empty_halfsphere walking_xyz walking_halfsphere; do
  mode=none original='' eight=5  # Hz at which the path goes about 8 cm between frames
  if [[ $scene == walking* ]]; then mode=geometric; fi
  if [[ $scene == *halfsphere ]]; then eight=7; fi
  for row in 640x480@30 320x240@30 848x480@30 1280x720@30 640x480@10 640x480@60 "540x360@$eight"; do
    size=${row%@*} rate=${row#*@} name=${scene}_$row
    sequence=$out/$name/sequence
    if [ ! -e "$sequence/synth.json" ]; then
      "$program" synth "$sequence" --size "$size" --fps "$rate" --frames $((seconds * rate)) \
        --scenario "${scene%_*}" --path "${scene#*_}" > /dev/null 2>&1
    fi
    "$program" run "$sequence" --out "$out/$name/run" --dynamics $mode --no-map > /dev/null 2> "$out/$name/run.log" || true
    "$program" eval "$out/$name/run" "$sequence" --json > "$out/$name/eval.json" 2> /dev/null || true
    error=$(ate "$out/$name/eval.json")
    original=${original:-$error}
    printf '%-20s %-10s %-9s %5s %9.3f %4s of %4s %9.4f %6.0f%%\n' "$scene" $mode "$size" "$rate" \
      "$(step "$sequence/groundtruth.txt")" "$(number tracked "$out/$name/run/summary.json")" \
      "$(number frames "$out/$name/run/summary.json")" "$error" \
      "$(awk -v a="${error:-nan}" -v b="${original:-nan}" 'BEGIN { print 100 * (a / b - 1) }')"
  done
done
