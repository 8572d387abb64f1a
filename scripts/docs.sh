#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Builds the API reference of the core and the public runtime, warnings being errors, and says where it is. Nothing is
# fetched, neither now nor by the pages: equations are set by Debian's MathJax, which is copied beside them.
#
#   scripts/docs.sh [OUT]       default: build/docs; the first page is OUT/html/index.html
#
# Environment: DOXYGEN, MATHJAX (a folder) where they are elsewhere. Exits with 77 where one of them is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-build/docs}
doxygen=${DOXYGEN:-doxygen}
mathjax=${MATHJAX:-/usr/share/javascript/mathjax}

skip() {
  echo "docs: skipped, $* (scripts/install-deps.sh installs it)" >&2
  exit 77
}
command -v "$doxygen" > /dev/null || skip "doxygen was not found"
[ -f "$mathjax/MathJax.js" ] || skip "MathJax 2 was not found in $mathjax"
command -v python3 > /dev/null || skip "python3 was not found"

rm -rf "${out:?}/html" "$out/xml"
mkdir -p "$out/html/mathjax"
out=$(cd "$out" && pwd)
DYNSLAM_VERSION=$(sed -nE 's/^  VERSION ([0-9]+\.[0-9]+\.[0-9]+)$/\1/p' CMakeLists.txt)
export DYNSLAM_DOCS_OUT=$out DYNSLAM_VERSION
"$doxygen" docs/api/Doxyfile
python3 scripts/check-api-docs.py "$out/xml" docs/api
rm -rf "$out/xml"

# Of MathJax what setting TeX as SVG takes, 2 of its 50 MB.
copy() {
  mkdir -p "$out/html/mathjax/$(dirname "$1")"
  cp -rL "$mathjax/$1" "$out/html/mathjax/$1"
}
copy MathJax.js
for part in extensions/tex2jax.js extensions/TeX extensions/MathEvents.js jax/element/mml jax/input/TeX \
  jax/output/SVG/jax.js jax/output/SVG/config.js jax/output/SVG/autoload jax/output/SVG/fonts/TeX; do
  copy "$part"
done
echo "docs: $out/html/index.html"
