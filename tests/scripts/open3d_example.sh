#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
#   open3d_example.sh DYNSLAM WORK
#
# examples/python/open3d_odometry.py on a rendered office, in which people walk, with the masks of `dynslam masks`: a pose per
# frame near the truth, and a mesh. Says that it is skipped where Debian's python3-open3d is missing.
set -euo pipefail
dynslam=$1 work=$2
example=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)/examples/python/open3d_odometry.py
fail() {
  echo "open3d_example: $*" >&2
  exit 1
}
python=''
for candidate in python3 /usr/bin/python3; do  # Debian's packages are the latter's
  if "$candidate" -c 'import open3d, numpy' 2> /dev/null; then python=$candidate; fi
done
if [ -z "$python" ]; then
  echo "SKIPPED: Open3D for Python is missing (Debian: python3-open3d)"
  exit 77
fi
rm -rf "$work"
mkdir -p "$work"
"$dynslam" synth "$work/office" --frames 15 --size 320x240 --path xyz --seed 2 > "$work/log"
"$dynslam" masks "$work/office" --out "$work/masks" >> "$work/log"
OMP_NUM_THREADS=1 "$python" "$example" "$work/office" --masks "$work/masks" --out "$work/trajectory.txt" --mesh "$work/mesh.ply" ||
  fail "ends with $?"
[ "$(wc -l < "$work/trajectory.txt")" -eq 15 ] || fail "15 frames have not 15 poses"
"$dynslam" eval "$work/trajectory.txt" "$work/office" --json > "$work/eval.json"
"$python" - "$work/eval.json" << 'PY' || fail "is far from the truth"
import json, sys
error = json.load(open(sys.argv[1]))["ate_m"]["rmse"]
print(f"ATE {100 * error:.1f} cm")
sys.exit(error is None or error > 0.03)
PY
grep -a -q '^element vertex [1-9]' "$work/mesh.ply" || fail "the mesh is empty"
if "$python" "$example" "$work" 2> "$work/log"; then fail "a folder without a sequence is no error"; fi
[ "$(wc -l < "$work/log")" -eq 1 ] || fail "a folder without a sequence is more than one line"
