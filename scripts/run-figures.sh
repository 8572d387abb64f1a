# SPDX-License-Identifier: BSD-3-Clause
#
# Figures of what `dynslam run` and `dynslam eval --json` wrote, for scripts that print tables; to be sourced.
# shellcheck shell=bash

# number NAME SUMMARY.JSON: a whole number of a run's summary, as tracked
number() { sed -n "s/^ *\"$1\": \([0-9]*\).*/\1/p" "$2"; }
# ate EVAL.JSON: RMSE of the absolute trajectory error [m]
ate() { sed -n 's/.*"ate_m":{[^}]*"rmse":\([0-9.e-]*\).*/\1/p' "$1"; }
