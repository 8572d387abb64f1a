#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# scripts/bench-table.py: a table of some runs, and an earlier table that keeps the rows of what was not run. Ends with
# 77 (skipped) where python3 is missing.
set -euo pipefail
command -v python3 > /dev/null || { echo "python3 is missing"; exit 77; }
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "FAILED: $*" >&2
  exit 1
}
has() { grep -qxF "$2" "$1" || { cat "$1"; fail "$1 has no line: $2"; }; }
has_no() { ! grep -qF "$2" "$1" || { cat "$1"; fail "$1 has: $2"; }; }

# runs FILE NAME=NANOSECONDS...: what Google Benchmark would write of them, medians and others
runs() {
  local file=$1 pair separator=''
  shift
  {
    echo '{"context": {"num_cpus": 2, "mhz_per_cpu": 1000}, "benchmarks": ['
    for pair in "$@"; do
      printf '%s{"name": "%s_mean", "run_type": "aggregate", "aggregate_name": "mean", "cpu_time": 1, "time_unit": "ns"},\n' \
        "$separator" "${pair%=*}"
      printf '{"name": "%s_median", "run_type": "aggregate", "aggregate_name": "median", "cpu_time": %s, ' "${pair%=*}" "${pair#*=}"
      printf '"time_unit": "ns", "bytes_per_second": 2e9, "heap_MB": 1.5, "error_px": 0.25, "error_px_95": 0.5, "right": 0.9}\n'
      separator=','
    done
    echo ']}'
  } > "$file"
}

printf 'Compiler: GNU 1, Release: -O3\nLibraries: Eigen 1\n' > "$work/build.txt"
runs "$work/a.json" fast/one/float/dynslam=100 fast/one/float/rival=250 fast/gone/float/dynslam=7
runs "$work/b.json" slow/one/double/dynslam=2000 slow/one/double/rival=1000 copy/1kB/uint8/memcpy=5
python3 scripts/bench-table.py "$work/build.txt" "$work/a.json" "$work/b.json" > "$work/all.md"
has "$work/all.md" '| fast/one | float | 100 ns | rival | 250 ns | 2.50 |'
has "$work/all.md" '| fast/gone | float | 7 ns | - | - | - |'
has "$work/all.md" '| slow/one | double | 2 us | rival | 1 us | **0.50** |'
has "$work/all.md" '| copy/1kB | uint8 | memcpy | 2.00 |'
has "$work/all.md" '| slow/one | double | rival | 0.250 px | 0.500 px | 90.0 % | - |'
has "$work/all.md" '| slow/one | double | rival | 1.50 |'
grep -q 'in bold, 1 of them' "$work/all.md" || fail "the losses are not counted"

# One executable anew: its rows change, go and come; the others and the count of losses stay right.
runs "$work/a.json" fast/one/float/dynslam=500 fast/one/float/rival=250 fast/two/float/dynslam=30
python3 scripts/bench-table.py --keep "$work/all.md" "$work/build.txt" "$work/a.json" > "$work/merged.md"
has "$work/merged.md" '| fast/one | float | 500 ns | rival | 250 ns | **0.50** |'
has "$work/merged.md" '| fast/two | float | 30 ns | - | - | - |'
has_no "$work/merged.md" 'fast/gone'
has "$work/merged.md" '| slow/one | double | 2 us | rival | 1 us | **0.50** |'
has "$work/merged.md" '| copy/1kB | uint8 | memcpy | 2.00 |'
has "$work/merged.md" '| slow/one | double | dynslam | 2.00 |'
has "$work/merged.md" '| slow/one | double | rival | 0.250 px | 0.500 px | 90.0 % | - |'
has "$work/merged.md" '| slow/one | double | rival | 1.50 |'
grep -q 'in bold, 2 of them' "$work/merged.md" || fail "the losses are not counted again"
python3 scripts/bench-table.py --keep "$work/merged.md" "$work/build.txt" "$work/a.json" > "$work/again.md"
cmp "$work/merged.md" "$work/again.md" || fail "the same runs once more give another table"

# What another compiler made does not stand beside it.
sed 's/GNU 1/GNU 2/' "$work/build.txt" > "$work/other.txt"
if python3 scripts/bench-table.py --keep "$work/all.md" "$work/other.txt" "$work/a.json" > "$work/none.md" 2> "$work/error"; then
  fail "rows of two compilers stand in one table"
fi
grep -q 'measure all anew' "$work/error" || fail "no word about what to do: $(cat "$work/error")"

# The table in the repository can be read: nothing of it is lost but the family that was run anew.
runs "$work/c.json" nothing/like/float/dynslam=1
{
  sed -n 's/^- \(Compiler: .*\)/\1/p; s/^- \(Libraries: .*\)/\1/p' docs/benchmarks.md
} > "$work/build.txt"
cpu=$(sed -n 's/^- CPU: \(.*\), [0-9]* cores.*/\1/p' docs/benchmarks.md)
here=$(sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo 2> /dev/null | head -n 1)
if [ "$cpu" = "$here" ]; then
  python3 scripts/bench-table.py --keep docs/benchmarks.md "$work/build.txt" "$work/c.json" > "$work/kept.md"
  diff <(grep '^| ' docs/benchmarks.md) <(grep '^| ' "$work/kept.md" | grep -v '^| nothing/like ') ||
    fail "rows of docs/benchmarks.md changed"
fi
