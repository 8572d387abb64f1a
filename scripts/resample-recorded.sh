#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Scales and thins recorded sequences, runs each with the defaults in the modes `none` and `geometric`, and prints
# frames tracked and ATE, and how much more or less that is than of the sequence as it is.
#
#   scripts/resample-recorded.sh SEQ...      results and sequences go to results/resample-recorded
#
# ROWS: the sizes and rates, as SIZE/EVERY (SIZE "as-is" or WxH, EVERY one of so many frames).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ $# -gt 0 ] || {
  echo "usage: scripts/resample-recorded.sh SEQ..." >&2
  exit 2
}
out=${OUT:-results/resample-recorded}
program=${DYNSLAM:-build/release/bin/dynslam}
rows=${ROWS:-as-is/1 as-is/3 320x240/1 540x405/1 540x405/6}
mkdir -p "$out"

. scripts/run-figures.sh

printf '%-44s %-10s %-12s %12s %9s %7s\n' sequence mode size/every tracked 'ATE [m]' change
for given in "$@"; do
  for mode in none geometric; do
    original=''
    for row in $rows; do
      size=${row%/*} every=${row#*/}
      name=$(basename "$given")_${size}_$every
      sequence=$given
      if [ "$row" != as-is/1 ]; then
        sequence=$out/$name/sequence
        scale=(--size "$size")
        [ "$size" != as-is ] || scale=()
        [ -e "$sequence/associations.txt" ] ||
          "$program" convert "$given" "$sequence" --every "$every" "${scale[@]}" > /dev/null
      fi
      result=$out/$name/$mode
      "$program" run "$sequence" --out "$result" --dynamics $mode --no-map > /dev/null 2> "$out/run.log" ||
        cat "$out/run.log" >&2
      "$program" eval "$result" "$sequence" --json > "$result/eval.json" 2> /dev/null || true
      error=$(ate "$result/eval.json")
      original=${original:-$error}
      printf '%-44s %-10s %-12s %4s of %4s %9.4f %6.0f%%\n' "$(basename "$given")" $mode "$row" \
        "$(number tracked "$result/summary.json")" "$(number frames "$result/summary.json")" "$error" \
        "$(awk -v a="${error:-nan}" -v b="${original:-nan}" 'BEGIN { print 100 * (a / b - 1) }')"
    done
  done
done
