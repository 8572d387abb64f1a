#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Replays a TUM sequence back and forth, as a robot that drives up and down all day, and prints what the run takes up:
# for every 1,000 frames the memory at their end [MB], keyframes and points of the map, and the median and the 95th
# percentile of the keyframe stage (of the frames with a keyframe) and of the whole frame [ms]. Images are links to the
# sequence's, nothing is copied; stamps go on at the recorded pace.
#
# Backwards, rows that were read from the top down come from the bottom up, and what was recorded late comes early: a
# camera that says how long it reads its rows would be told the contrary of the truth half of the time, and the map would
# have every surface twice. Its file is therefore used without readout_time and depth_time_offset.
#
#   scripts/long-run.sh SEQ [FRAMES] [OPTION...]      default: 6000 frames; OPTIONs go to `dynslam run`
#
# Environment: DYNSLAM the program (default build/release/bin/dynslam), STEP frames per line (default 1000), OUT a folder
# for the results, which is kept (default: a temporary one), LIST=1 only writes the sequence (OUT/replay).
set -euo pipefail
sequence=$(realpath "$1")
shift
frames=6000
[[ ${1-} =~ ^[0-9]+$ ]] && { frames=$1; shift; }
cd "$(dirname "${BASH_SOURCE[0]}")/.."
program=${DYNSLAM:-build/release/bin/dynslam}
if [ -n "${OUT-}" ]; then
  mkdir -p "$OUT"
  work=$(realpath "$OUT")
else
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
replay=$work/replay
rm -rf "$replay"
mkdir -p "$replay"
for folder in rgb depth; do ln -s "$sequence/$folder" "$replay/$folder"; done
for file in calibration.txt camera.txt synth.json; do
  [ ! -e "$sequence/$file" ] || ln -s "$sequence/$file" "$replay/$file"
done

# Pairs every colour image with the nearest depth image within 20 ms and walks the list up and down. The time between
# two frames is that between them in the recording, the time from colour to depth image stays.
paste_list() { sed -e '/^#/d' -e '/^[[:space:]]*$/d' "$1" | sort -n; }
paste_list "$sequence/depth.txt" > "$work/depth.list"
paste_list "$sequence/rgb.txt" | awk -v frames="$frames" -v rgb="$replay/rgb.txt" -v depth="$replay/depth.txt" '
  function distance(a, b) { return a > b ? a - b : b - a }
  NR == FNR { depth_t[++depths] = $1; depth_file[depths] = $2; next }
  {
    while (at < depths && (at == 0 || distance(depth_t[at + 1], $1) <= distance(depth_t[at], $1))) ++at
    if (distance(depth_t[at], $1) > 0.02 || used[at]) next
    used[at] = 1
    t[++n] = $1; file[n] = $2; d[n] = at
  }
  END {
    if (n < 2) { print "long-run: fewer than two frames" > "/dev/stderr"; exit 1 }
    now = t[1]
    for (k = 0; k < frames; ++k) {
      i = k % (2 * n - 2)
      i = i < n ? i + 1 : 2 * n - 1 - i
      if (k > 0) now += distance(t[i], t[last])
      last = i
      printf "%.6f %s\n", now, file[i] > rgb
      printf "%.6f %s\n", now + depth_t[d[i]] - t[i], depth_file[d[i]] > depth
    }
  }' "$work/depth.list" -
[ -z "${LIST-}" ] || exit 0

if ! grep -q -- '--camera' <<< "$*"; then  # by the name of the folder, as for the sequence itself
  case $sequence in
    *freiburg1*|*fr1*) set -- --camera fr1 "$@" ;;
    *freiburg2*|*fr2*) set -- --camera fr2 "$@" ;;
    *freiburg3*|*fr3*) set -- --camera fr3 "$@" ;;
  esac
fi
options=()
while [ $# -gt 0 ]; do
  case $1 in --camera=*) set -- --camera "${1#*=}" "${@:2}" ;; esac
  options+=("$1")
  if [ "$1" = --camera ] && [ $# -gt 1 ]; then
    shift
    camera=$1
    for file in "examples/cameras/$1.txt" "examples/cameras/tum_$1.txt"; do
      [ -f "$camera" ] || camera=$file
    done
    if [ -f "$camera" ] && grep -qE '^(readout_time|depth_time_offset)' "$camera"; then
      sed -E '/^(readout_time|depth_time_offset)/d' "$camera" > "$work/camera.txt"
      options+=("$work/camera.txt")
    else
      options+=("$1")
    fi
  fi
  shift
done
"$program" run "$replay" --out "$work/out" "${options[@]}" > "$work/log" 2>&1 || { tail -3 "$work/log" >&2; exit 1; }

awk -F, -v step="${STEP:-1000}" '
  function percentile(values, count, share,    i, j, x) {
    for (i = 2; i <= count; ++i) {  # sorts
      x = values[i]
      for (j = i - 1; j > 0 && values[j] > x; --j) values[j + 1] = values[j]
      values[j + 1] = x
    }
    return count > 0 ? values[int((count - 1) * share + 0.5) + 1] : 0
  }
  function row() {
    printf "%8d %8.1f %9d %8d %6d  %7.1f %7.1f  %7.1f %7.1f\n", frames, $column["rss_mb"], $column["keyframes"],
           $column["points"], made, percentile(stage, made, 0.5), percentile(stage, made, 0.95),
           percentile(frame, in_step, 0.5), percentile(frame, in_step, 0.95)
    made = in_step = 0
  }
  NR == 1 {
    for (i = 1; i <= NF; ++i) column[$i] = i
    print "  frames   rss_mb keyframes   points   made  stage50 stage95  frame50 frame95"
    next
  }
  {
    ++frames
    frame[++in_step] = $column["frame"]
    # A frame that makes no keyframe leaves the stage after microseconds.
    if ($column["keyframe"] > 0.5) stage[++made] = $column["keyframe"]
    if (frames % step == 0) row()
  }
  END { if (in_step > 0) row() }' "$work/out/timings.csv"
sed -n 's/^ *"\(tracked\|lost\|broken\)": \([0-9]*\),*$/\1 \2/p' "$work/out/summary.json" | paste -sd ' '
