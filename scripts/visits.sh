#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Visits the same place again and again, each time loading the map of the last visit and saving it in its place, and
# prints what the map takes after each: bytes of its files, and keyframes and points that tracking goes by.
#
#   scripts/visits.sh SEQ [VISITS] [OPTION...]      default: 20 visits; OPTIONs go to `dynslam run`
#
# Environment: DYNSLAM the program (default build/release/bin/dynslam).
set -euo pipefail
sequence=$(realpath "$1")
shift
visits=20
[[ ${1-} =~ ^[0-9]+$ ]] && { visits=$1; shift; }
cd "$(dirname "${BASH_SOURCE[0]}")/.."
program=${DYNSLAM:-build/release/bin/dynslam}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

size() { stat -c %s "$work/map/$1"; }

echo "visit keyframes.bin  scans.bin   map.sot keyframes points   lost"
load=()
for ((visit = 1; visit <= visits; ++visit)); do
  "$program" run "$sequence" --out "$work/out" "${load[@]}" --save-map "$work/map" "$@" > "$work/log" 2>&1 ||
    { tail -3 "$work/log" >&2; exit 1; }
  load=(--load-map "$work/map")
  printf '%5d %13d %10d %9d %9d %6d %6d\n' "$visit" "$(size keyframes.bin)" "$(size scans.bin)" "$(size map.sot)" \
    "$(tail -1 "$work/out/timings.csv" | awk -F, '{print $(NF - 1)}')" \
    "$(tail -1 "$work/out/timings.csv" | awk -F, '{print $NF}')" \
    "$(sed -n 's/^ *"lost": \([0-9]*\),*$/\1/p' "$work/out/summary.json")"
done
