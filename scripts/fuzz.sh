#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Searches the parsers and decoders for inputs that crash them, hang them, or make them throw what is not
# documented: libFuzzer with the address and undefined behaviour sanitizers, one target after the other.
#
#   scripts/fuzz.sh [SECONDS_PER_TARGET] [TARGET...]      (600 and all)
#
# What it finds is left in build/fuzz/findings/TARGET and ends it with 1; what widened the coverage is kept in
# build/fuzz/corpus/TARGET. A mended finding belongs into tests/fuzz/corpus/TARGET, which every test run replays.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

seconds=${1:-600}
shift || true
cmake --preset fuzz -D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=8 > /dev/null
cmake --build --preset fuzz --target fuzzer
work=build/fuzz
mapfile -t all < <(DYNSLAM_FUZZ_SEEDS=$work/seeds $work/tests/fuzzer)
targets=("${@:-${all[@]}}")

found=0
printf '%-14s %12s %10s %10s  %s\n' target executions coverage corpus findings
for target in "${targets[@]}"; do
  mkdir -p "$work/corpus/$target" "$work/findings/$target"
  kept=tests/fuzz/corpus/$target
  [ -d "$kept" ] || kept=
  DYNSLAM_FUZZ_TARGET=$target $work/tests/fuzzer "$work/corpus/$target" "$work/seeds/$target" $kept \
    -max_total_time="$seconds" -timeout=20 -rss_limit_mb=3000 -max_len=65536 -print_final_stats=1 \
    -artifact_prefix="$work/findings/$target/" > "$work/$target.log" 2>&1 || true
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$work/$target.log")
  coverage=$(grep -o 'cov: [0-9]*' "$work/$target.log" | tail -1 | cut -d' ' -f2)
  findings=$(find "$work/findings/$target" -type f | wc -l)
  printf '%-14s %12s %10s %10s  %s\n' "$target" "${executions:-?}" "${coverage:-?}" \
    "$(find "$work/corpus/$target" -type f | wc -l)" "$findings"
  if [ "$findings" -gt 0 ] || [ -z "$executions" ]; then
    tail -n 30 "$work/$target.log"
    found=1
  fi
done
exit $found
