#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds and runs the benchmarks: medians of five repetitions as JSON, one file per executable, in build/bench/, and from
# these docs/benchmarks.md, a table of ratios. Each runs on one core, pinned to it where taskset exists.
#
#   scripts/bench.sh [--smoke] [--filter REGEX] [--only REGEX] [--no-build]
#
#   --smoke         one short run of each case but the slow ones (bench/slow_cases.txt); nothing is written to docs/
#   --filter REGEX  only cases that match (`pose_only`, `insertion/5cm.*octomap`); nothing is written to docs/
#   --only REGEX    only executables that match (`optim_`); the table has them anew, the others as they stand in it
#   --no-build      the executables as they are
#
# Environment: DYNSLAM_DATA names recorded data; CPU the core (default: the last); REPETITIONS; MIN_TIME seconds of each.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

smoke='' filter='' only='' build=1
while [ $# -gt 0 ]; do
  case $1 in
    --smoke) smoke=1 ;;
    --filter | --only)
      [ $# -gt 1 ] || { echo "bench.sh: $1 takes a regular expression" >&2; exit 2; }
      declare "${1#--}=$2"
      shift
      ;;
    --no-build) build='' ;;
    -h | --help) sed -n '4,15s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) echo "bench.sh: no such option: $1 (see --help)" >&2; exit 2 ;;
  esac
  shift
done

if [ -n "$build" ]; then
  mkdir -p build/release
  cmake --preset release -D DYNSLAM_BUILD_BENCHMARKS=ON -D DYNSLAM_BENCH_FLAGS= > build/release/configure.log 2>&1 ||
    { cat build/release/configure.log; exit 1; }
  targets=()
  for source in bench/*/*_bench.cpp; do
    name=${source#bench/}
    name=${name%.cpp}
    name=${name/\//_}
    if [ -z "$only" ] || [[ $name =~ $only ]]; then targets+=("$name"); fi
  done
  cmake --build --preset release -j "${JOBS:-$(nproc)}" --target "${targets[@]}"
fi

pin=()
if command -v taskset > /dev/null; then
  pin=(taskset -c "${CPU:-$(($(nproc) - 1))}")
fi
options=()
if [ -n "$smoke" ]; then
  slow=$(paste -s -d '|' bench/slow_cases.txt)
  options=(--benchmark_min_time=0.001 "--benchmark_filter=${filter:--$slow}")
else
  options=(--benchmark_repetitions="${REPETITIONS:-5}" --benchmark_min_time="${MIN_TIME:-0.1}"
    --benchmark_report_aggregates_only=true "--benchmark_filter=${filter:-.}")
  # Virtual machines often count nothing.
  if command -v perf > /dev/null && perf stat -x, -e instructions:u true 2>&1 | grep -qE '^[0-9]+,'; then
    options+=(--benchmark_perf_counters=INSTRUCTIONS)
  fi
fi

out=build/bench
mkdir -p "$out"
failed=0 runs=()
for executable in build/release/bench/*_bench; do
  name=$(basename "$executable")
  if [ -n "$only" ] && ! [[ $name =~ $only ]]; then continue; fi
  printf '\n=== %s\n' "$name"
  rm -f "$out/$name.json"
  "${pin[@]}" "$executable" "${options[@]}" --benchmark_out="$out/$name.json" 2> "$out/$name.log" |
    tee "$out/$name.txt"
  runs+=("$out/$name.json")
  if grep -q 'ERROR OCCURRED' "$out/$name.txt"; then failed=$((failed + 1)); fi
done

if [ "$failed" -gt 0 ]; then
  echo "bench.sh: $failed executables with wrong answers (ERROR OCCURRED above)" >&2
  exit 1
fi
[ "${#runs[@]}" -gt 0 ] || { echo "bench.sh: no executable matches '$only'" >&2; exit 2; }
if [ -z "$smoke$filter" ]; then
  keep=()
  if [ -n "$only" ]; then keep=(--keep docs/benchmarks.md); fi
  python3 scripts/bench-table.py "${keep[@]}" build/release/bench/build.txt "${runs[@]}" > "$out/benchmarks.md"
  cp "$out/benchmarks.md" docs/benchmarks.md
  echo "docs/benchmarks.md"
fi
