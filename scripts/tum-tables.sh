#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# The tables of S. Wen et al. 2021 (Tables 1 to 5) from TUM's five official sequences, as far as DIR has them:
# scripts/get-tum.sh fetches what is missing. One sweep (docs/sweeps.md); the same call goes on where it stopped.
#
#   scripts/tum-tables.sh DIR       DIR holds rgbd_dataset_freiburg3_walking_xyz, ... as get-tum.sh leaves them
#
# Tables 1 to 3: ATE, RPE in translation and in rotation, without masks and with them; 4: by mode, which masks count; 5:
# beside the published figures of other systems. All of them twice: `paper` has the paper's steps alone, `full` what
# dynslam adds.
#
# Environment: MODEL a network (docs/segmentation.md), without which there are no modes `semantic` and `both`; SEEDS (1 2
# 3); JOBS runs at a time (1); OUT (results/tum-tables); DYNSLAM the program (build/release/bin/dynslam); ONLY_LIST=1
# writes the sweep and says where, for --jobs-to.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
[ $# -eq 1 ] || { sed -n '3,/^set /{s/^# \{0,1\}//;/^set /!p}' "${BASH_SOURCE[0]}" >&2; exit 2; }
dir=$1 out=${OUT:-$root/results/tum-tables} program=${DYNSLAM:-$root/build/release/bin/dynslam}

fail() {
  echo "tum-tables: $*" >&2
  exit 1
}
[ -d "$dir" ] || fail "$dir is not a folder"
[ -x "$program" ] || fail "$program is missing: scripts/demo.sh builds it"
dir=$(cd "$dir" && pwd)

sequences=() missing=()
for name in walking_halfsphere walking_xyz walking_rpy walking_static sitting_static; do
  for folder in "$dir/rgbd_dataset_freiburg3_$name" "$dir/freiburg3_$name" ""; do
    [ -z "$folder" ] || [ ! -f "$folder/rgb.txt" ] || break
  done
  if [ -n "$folder" ]; then sequences+=("$folder"); else missing+=("fr3_$name"); fi
done
[ ${#sequences[@]} -gt 0 ] || fail "none of the five sequences is in $dir; OUT=$dir scripts/get-tum.sh ${missing[*]}"
[ ${#missing[@]} -eq 0 ] || echo "tum-tables: without ${missing[*]} (OUT=$dir scripts/get-tum.sh ${missing[*]})" >&2

modes=(none geometric)
if [ -n "${MODEL:-}" ]; then
  [ -f "$MODEL" ] || fail "$MODEL is missing"
  modes=(none semantic geometric both)
else
  echo "tum-tables: without MODEL there are no modes semantic and both, which are the paper's" >&2
fi

list() { printf '"%s", ' "$@" | sed 's/, $//'; }
read -r -a seeds <<< "${SEEDS:-1 2 3}"
mkdir -p "$out"
out=$(cd "$out" && pwd)
sweep=$out/tum-tables.toml
{
  echo "sequences = [$(list "${sequences[@]}")]"
  echo "modes = [$(list "${modes[@]}")]"
  echo "seeds = [$(printf '%s, ' "${seeds[@]}" | sed 's/, $//')]"
  echo "out = \"$out\""
  echo "[options]"
  echo "map = false"
  if [ -n "${MODEL:-}" ]; then echo "model = \"$(realpath "$MODEL")\""; fi
  printf '[variants.paper]\nmethod = "paper"\n[variants.full]\nmethod = "full"\n'
} > "$sweep"
if [ -n "${ONLY_LIST:-}" ]; then
  echo "tum-tables: $sweep; then '$program' sweep $sweep --jobs-to FILE, run FILE, and this script once more"
  exit 0
fi
code=0
"$program" sweep "$sweep" --jobs "${JOBS:-1}" || code=$?
[ -f "$out/sweep.json" ] || exit "$code"

python3 - "$out" << 'PYTHON'
import json, pathlib, sys
out = pathlib.Path(sys.argv[1])
results = json.loads((out / "sweep.json").read_text())["results"]
# ATE RMSE [m] as published: ORB-SLAM2, DynaSLAM, the paper with a mask alone, and the paper.
published = {"walking_halfsphere": (0.3409, 0.0292, 0.0270, 0.0267), "walking_xyz": (0.5023, 0.0202, 0.0206, 0.0190),
             "walking_rpy": (0.9331, 0.0417, 0.0409, 0.0316), "walking_static": (0.1486, 0.0077, 0.0081, 0.0071),
             "sitting_static": (0.0084, 0.0072, 0.0070, 0.0066)}
text = (out / "tables.md").read_text()
for number, title in enumerate(("Absolute trajectory error [m]", "Relative pose error, translation [m/s]",
                                "Relative pose error, rotation [deg/s]",
                                "Absolute trajectory error by mode, RMSE [m]"), 1):
    text = text.replace(f"### {title}\n", f"### Table {number}: {title}\n")
best = lambda mode: {"both": 0, "geometric": 1}.get(mode, 2)
ours = {}
for r in results:
    if best(r["mode"]) < 2 and r["ate_m"]["rmse"]["mean"] is not None:
        key = (r["sequence"], r["variant"])
        if key not in ours or best(r["mode"]) < best(ours[key][0]):
            ours[key] = (r["mode"], r["ate_m"]["rmse"]["mean"])
rows = ["### Table 5: Absolute trajectory error beside other systems, RMSE [m]\n",
        "| sequence | ORB-SLAM2 | DynaSLAM | paper, mask alone | paper | dynslam, paper's steps | dynslam |",
        "|---|---:|---:|---:|---:|---:|---:|"]
for sequence in dict.fromkeys(r["sequence"] for r in results):
    name = next(n for n in published if sequence.endswith(n))
    cells = [f"{x:.4f}" for x in published[name]]
    for variant in ("paper", "full"):
        found = ours.get((sequence, variant))
        cells.append(f"{found[1]:.4f} ({found[0]})" if found else "-")
    rows.append("| " + " | ".join([name, *cells]) + " |")
at = text.index("### Coverage")
(out / "tum-tables.md").write_text(text[:at] + "\n".join(rows) + "\n\nThe first four columns are as published.\n\n" + text[at:])
print(f"tum-tables: {out / 'tum-tables.md'}")
PYTHON
exit "$code"
