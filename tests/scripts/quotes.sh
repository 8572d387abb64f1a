#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# check-quotes.py finds numbers that quote nothing, in the lines that have them and in no other.
set -euo pipefail
tests=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
found=$("$tests/../scripts/check-quotes.py" "$tests/support/quote_faults" || true)
lines=$(cut -d: -f2 <<< "$found" | tr '\n' ' ')
expected='16 19 20 21 23 '
[ "${lines#"$expected"}" != "$lines" ] && grep -q 'results --> is not closed' <<< "$found" && [ "$(wc -l <<< "$found")" -eq 6 ] || {
  echo "found, where lines $expected and an open block have faults:"
  echo "$found"
  exit 1
}
