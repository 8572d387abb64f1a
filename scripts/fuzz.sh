#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Searches the parsers and decoders for inputs that crash them, hang them, or make them throw what is not
# documented: libFuzzer with the address and undefined behaviour sanitizers, one target after the other.
#
#   scripts/fuzz.sh [SECONDS_PER_TARGET] [TARGET...]      (600 and all)
#   scripts/fuzz.sh keep [TARGET...]                      keeps what was found to reach code (all)
#
# What it finds is left in build/fuzz/findings/TARGET and ends it with 1; what widened the coverage is kept in
# build/fuzz/corpus/TARGET. `keep` puts the least of that which reaches as much, and is not longer than 8 kB, into
# tests/fuzz/corpus/TARGET.tar.gz, from where every search begins, and every test run replays it. A mended finding
# belongs into tests/fuzz/corpus/TARGET/ under a name of its own.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

seconds=${1:-600}
shift || true
cmake --preset fuzz -D CMAKE_UNITY_BUILD=ON -D CMAKE_UNITY_BUILD_BATCH_SIZE=8 > /dev/null
cmake --build --preset fuzz --target fuzzer
work=build/fuzz
mapfile -t all < <(DYNSLAM_FUZZ_SEEDS=$work/seeds $work/tests/fuzzer)
targets=("${@:-${all[@]}}")
limits=(-timeout=20 -rss_limit_mb=3000)

if [ "$seconds" = keep ]; then
  for target in "${targets[@]}"; do
    [ -d "$work/corpus/$target" ] || continue
    rm -rf "$work/least"
    mkdir -p "$work/least"
    DYNSLAM_FUZZ_TARGET=$target $work/tests/fuzzer -merge=1 "${limits[@]}" -max_len=8192 "$work/least" \
      "$work/corpus/$target" > "$work/$target.merge.log" 2>&1
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime=@0 -C "$work/least" -c . |
      gzip -9n > "tests/fuzz/corpus/$target.tar.gz"
    printf '%-14s %6s inputs, %8s bytes\n' "$target" "$(find "$work/least" -type f | wc -l)" \
      "$(stat -c %s "tests/fuzz/corpus/$target.tar.gz")"
  done
  exit 0
fi

found=0
printf '%-14s %12s %10s %10s  %s\n' target executions coverage corpus findings
for target in "${targets[@]}"; do
  mkdir -p "$work/corpus/$target" "$work/findings/$target"
  kept=tests/fuzz/corpus/$target
  [ ! -f "$kept.tar.gz" ] || tar -xzf "$kept.tar.gz" -C "$work/corpus/$target"
  [ -d "$kept" ] || kept=
  DYNSLAM_FUZZ_TARGET=$target $work/tests/fuzzer "$work/corpus/$target" "$work/seeds/$target" $kept \
    -max_total_time="$seconds" "${limits[@]}" -max_len=65536 -print_final_stats=1 \
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
