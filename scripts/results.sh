#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Measures every number that README.md and docs/ show, and writes docs/results.md (the kernels': docs/benchmarks.md, by
# scripts/bench.sh). Hours, all in all; what is done is not done again as long as program, commit and options are the
# same. scripts/check-quotes.py then compares the other pages with it.
#
#   scripts/results.sh              all tables
#   scripts/results.sh NAME...      these; the others stay as they stand (--help lists the names)
#
# Environment: DYNSLAM the program (default build/release/bin/dynslam) and EXAMPLES the built examples; DYNSLAM_DATA the
# folder with recorded sequences (tum/), networks (models/) and the tool that composes more (compose/), without which
# their rows are left out with a line; WORK where sequences and runs are kept (default results/tables); JOBS runs at a
# time (default 1: more disturb what is timed).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec python3 scripts/results.py "$@"
