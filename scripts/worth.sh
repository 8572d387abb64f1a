#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# What each part of the method is worth: every sequence at hand is run with all of it and with one part left out, in the
# modes `geometric` and `both`, with three seeds. One line per part: the geometric mean over the sequences of its ATE
# through that of the whole method (above 1: the part is worth something, once it is beyond the spread between seeds, which
# the first line has), frames lost, and the masks' recall, IoU and spill (share of a frame masked beyond what moves [%]).
#
#   scripts/worth.sh [PART...] [--only NAME] [--seeds 1,2,3] [--modes geometric,both]
#
# Goes on where it stopped (dynslam sweep). Environment: as scripts/results.sh; the table is left in WORK/worth.md.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec python3 scripts/worth.py "$@"
