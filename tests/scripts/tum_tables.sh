#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# scripts/tum-tables.sh on a rendered sequence under an official name: five tables, of the runs that there are.
#
#   tum_tables.sh PROGRAM WORK      exits with 77 where python3 is missing
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
program=$1 work=$2
command -v python3 > /dev/null || { echo "SKIPPED: no python3"; exit 77; }

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

rm -rf "$work"
name=rgbd_dataset_freiburg3_walking_xyz
mkdir -p "$work/empty"
"$program" synth "$work/data/$name" --frames 40 --path xyz > "$work/log"
export DYNSLAM=$program OUT=$work/out SEEDS="1 2" MODEL=
if scripts/tum-tables.sh "$work/empty" > "$work/log" 2>&1; then fail "an empty folder passed"; fi
grep -q "none of the five sequences" "$work/log" || fail "an empty folder is not told: $(cat "$work/log")"
scripts/tum-tables.sh "$work/data" > "$work/log" 2>&1 || fail "$(cat "$work/log")"
grep -q "without fr3_walking_halfsphere fr3_walking_rpy" "$work/log" || fail "what is missing is not told"
grep -q "8 jobs, 0 done, 8 to run" "$work/log" || fail "not 1 sequence x 2 variants x 2 modes x 2 seeds: $(cat "$work/log")"
for n in 1 2 3 4 5; do grep -q "^### Table $n: " "$work/out/tum-tables.md" || fail "table $n is missing"; done
ate=$(sed -n "s/^| $name, full | geometric | \([0-9.]*\) ± .*/\1/p" "$work/out/tum-tables.md" | head -n 1)
grep -q "^| walking_xyz | 0.5023 | 0.0202 | 0.0206 | 0.0190 | .* | $ate (geometric) |$" "$work/out/tum-tables.md" ||
  fail "table 5 does not have what table 1 has: $(grep walking_xyz "$work/out/tum-tables.md")"
scripts/tum-tables.sh "$work/data" > "$work/log" 2>&1
grep -q "8 jobs, 8 done, 0 to run" "$work/log" || fail "the second call runs something again"
