#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Makes the pictures of README.md and docs/ anew, in docs/figures/. A picture whose data is absent stays as it is, and a
# line says so. The same program and data give the same pictures, but for the times in stages.svg.
#
#   scripts/figures.sh              all
#   scripts/figures.sh NAME...      these: overview masks weights maps trajectory stages pipeline troubleshooting
#                                   reliability (needs the examples)
#
# Needs python3-opencv and python3-numpy (Debian). Environment: DYNSLAM the program (build/release/bin/dynslam);
# DYNSLAM_DATA the folder with recorded sequences (tum/) and networks (models/); WORK where runs are kept
# (results/figures); OUT where the pictures go (docs/figures).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python3=python3
"$python3" -c 'import cv2, numpy' 2> /dev/null || python3=/usr/bin/python3
"$python3" -c 'import cv2, numpy' 2> /dev/null ||
  { echo "figures: python3-opencv and python3-numpy are missing" >&2; exit 1; }
exec "$python3" scripts/figures.py "$@"
