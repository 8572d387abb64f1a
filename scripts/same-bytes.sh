#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# The safety net of a change that must not change results: SHA-256 of both trajectories, keyframes, map and masks of
# whole runs in all four modes, over three synthetic sequences and, where DYNSLAM_DATA names them, the recorded ones.
#
#   scripts/same-bytes.sh record FILE      runs everything and writes the sums to FILE
#   scripts/same-bytes.sh compare FILE     runs everything and compares with FILE; exits with 1 where a byte differs
#
# Environment: DYNSLAM the program (default build/release/bin/dynslam), WORK where sequences, cached network masks
# and results are kept between calls (default results/same-bytes), ONLY a pattern of "sequence mode" lines to run
# (an extended regular expression, e.g. '^synth_.* (none|geometric)$'), JOBS runs at a time (default 1).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

usage() {
  sed -n '3,13s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2
  exit 2
}
[ $# -eq 2 ] || usage
action=$1 file=$2
case "$action" in
  record) ;;
  compare) [ -r "$file" ] || { echo "same-bytes: $file cannot be read" >&2; exit 2; } ;;
  *) usage ;;
esac
program=${DYNSLAM:-build/release/bin/dynslam}
work=${WORK:-results/same-bytes}
only=${ONLY:-.}
mkdir -p "$work"

# name, then what `dynslam synth` is asked for
synthetic() {
  cat << 'END'
synth_walking --path xyz --scenario walking --seed 2 --frames 90
synth_board --path halfsphere --scenario board --seed 1 --frames 90
synth_loop --path loop --scenario walking --seed 3 --frames 600
END
}

sequences=()
while read -r name arguments; do
  if [ ! -e "$work/$name/synth.json" ]; then
    # shellcheck disable=SC2086  # several words
    "$program" synth "$work/$name" $arguments > "$work/$name.log"
  fi
  sequences+=("$name|$work/$name|models/demo_segmenter.onnx")
done < <(synthetic)
if [ -n "${DYNSLAM_DATA:-}" ] && [ -d "$DYNSLAM_DATA/tum" ]; then
  for folder in "$DYNSLAM_DATA"/tum/*/; do
    [ "$(grep -vc '^#' "$folder/rgb.txt" 2> /dev/null || echo 0)" -gt 10 ] || continue
    sequences+=("$(basename "$folder")|$folder|$DYNSLAM_DATA/models/yolo11n-seg_416x320_full.onnx")
  done
else
  echo "same-bytes: DYNSLAM_DATA names no recorded sequences: synthetic ones only" >&2
fi

# One line per output of one run.
one() {
  local name=$1 folder=$2 model=$3 mode=$4 out=$work/out/$1/$4
  rm -rf "$out"
  mkdir -p "$out"
  local network=()
  case "$mode" in semantic | both) network=(--model "$model" --cache-masks "$work/cache/$name-$mode") ;; esac
  "$program" run "$folder" --out "$out" --dynamics "$mode" --save-masks "${network[@]}" > "$out/log" 2>&1 ||
    echo "$name $mode exit $?"
  local what sum
  for what in trajectory.txt trajectory_live.txt keyframes.txt map.sot; do
    if [ -e "$out/$what" ]; then sum=$(sha256sum < "$out/$what" | cut -d' ' -f1); else sum=absent; fi
    echo "$name $mode $what $sum"
  done
  echo "$name $mode masks $(cd "$out/masks" && find . -name '*.png' | sort | xargs -r sha256sum | sha256sum | cut -d' ' -f1)"
}
export -f one
export program work

sums=$work/sums.txt
for entry in "${sequences[@]}"; do
  for mode in none semantic geometric both; do
    IFS='|' read -r name folder model <<< "$entry"
    if grep -Eq "$only" <<< "$name $mode"; then printf '%s\0%s\0%s\0%s\0' "$name" "$folder" "$model" "$mode"; fi
  done
done | xargs -0 -r -n 4 -P "${JOBS:-1}" bash -c 'one "$@"' _ | sort > "$sums"
[ -s "$sums" ] || { echo "same-bytes: nothing matches ONLY='$only'" >&2; exit 2; }

if [ "$action" = record ]; then
  cp "$sums" "$file"
  echo "same-bytes: $(wc -l < "$sums") sums of $(cut -d' ' -f1,2 "$sums" | sort -u | wc -l) runs recorded in $file"
  exit 0
fi
# Records from before maps were named .sot, and from before there were live trajectories.
compared=$sums.compared
if grep -Eq ' trajectory_live\.txt [0-9a-f]{64}$' "$file"; then cp "$sums" "$compared"; else
  grep -v ' trajectory_live\.txt ' "$sums" > "$compared" || true
fi
differing=$(grep -Fxv -f <(sed 's/ map\.ot / map.sot /' "$file") "$compared" | cut -d' ' -f1-3 || true)
if [ -n "$differing" ]; then
  echo "same-bytes: these differ from $file:"
  echo "$differing"
  exit 1
fi
echo "same-bytes: all $(wc -l < "$compared") outputs are the same as in $file"
