#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Kills runs that load a map and save it again at the same place, at random moments, half of them while they save.
# After each the folder must hold the old map or the new one, byte for byte, and a file of the user's must be in it.
#
#   scripts/kill-test.sh [KILLS]      default 200: some minutes
#
# Environment: DYNSLAM the program (default build/release/bin/dynslam), SEED of the moments (default 1).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
program=${DYNSLAM:-build/release/bin/dynslam}
kills=${1:-200}
RANDOM=${SEED:-1}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

run() { "$program" run "$work/s" --dynamics none "$@"; }
map_of() { (cd "$1" && sha256sum keyframes.bin scans.bin map.sot); }

"$program" synth "$work/s" --frames 24 --path xyz --scenario empty > "$work/log"
run --out "$work/o1" --max-frames 12 --save-map "$work/old" > "$work/log"
echo precious > "$work/old/letter.txt"
begin=$(date +%s%N)
run --out "$work/o2" --load-map "$work/old" --save-map "$work/new" > "$work/log"
duration=$((($(date +%s%N) - begin) / 1000000))
old=$(map_of "$work/old") new=$(map_of "$work/new")
[ "$old" != "$new" ] || { echo "kill-test: the run does not change the map" >&2; exit 1; }

# N ms, as sleep wants it.
pause() { sleep "$(($1 / 1000)).$(printf %03d $(($1 % 1000)))"; }

held_old=0 held_new=0 done_before=0
for ((k = 1; k <= kills; ++k)); do
  rm -rf "$work"/m "$work"/m.* "$work/o"
  cp -r "$work/old" "$work/m"
  # Not by run(): the number would be that of a shell around the program.
  "$program" run "$work/s" --dynamics none --out "$work/o" --load-map "$work/m" --save-map "$work/m" > "$work/log" 2>&1 &
  pid=$!
  if ((k % 2)); then
    pause $((RANDOM % (duration + 1)))
  else  # keyframes.txt is written right before the maps are
    while kill -0 "$pid" 2> /dev/null && [ ! -e "$work/o/keyframes.txt" ]; do pause 2; done
    pause $((RANDOM % 100))
  fi
  kill -KILL "$pid" 2> /dev/null || done_before=$((done_before + 1))
  { wait "$pid" || true; } 2> /dev/null
  case $(map_of "$work/m") in
    "$old") held_old=$((held_old + 1)) ;;
    "$new") held_new=$((held_new + 1)) ;;
    *) echo "kill-test: after kill $k the folder holds neither map:"; map_of "$work/m" || true; ls -la "$work" "$work/m"; exit 1 ;;
  esac
  [ "$(cat "$work/m/letter.txt")" = precious ] || { echo "kill-test: after kill $k the user's file is gone"; exit 1; }
  if ((k % 20 == 0)); then  # and a later run finds its way, and clears what the kills left
    run --out "$work/o3" --load-map "$work/m" --save-map "$work/m" --max-frames 2 > "$work/log" 2>&1 ||
      { cat "$work/log"; exit 1; }
    [ "$(find "$work" -maxdepth 1 -name 'm.*' | wc -l)" -eq 0 ] || { echo "kill-test: something is left"; ls "$work"; exit 1; }
  fi
done
echo "kill-test: $kills runs: $held_old left the old map, $held_new the new one ($done_before had ended before)"
