#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# The API reference builds without a warning, has what a reader looks for, and fetches nothing; what a header lacks or a
# page of docs/api names wrongly ends the build.
#
#   api_reference.sh WORK       a folder for what it makes; exits with 77 where Doxygen or MathJax is missing
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
work=$1

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

scripts/docs.sh "$work" || exit $?
html=$work/html

# A page for each folder says what it is for.
for folder in include/dynslam/*/ {runtime/io,runtime,tools}/include/dynslam/runtime/ \
  {runtime/io,runtime,tools}/include/dynslam/runtime/*/; do
  folder=${folder%/}
  page=$(grep -lF "<title>dynslam: $folder Directory Reference</title>" "$html"/dir_*.html) ||
    fail "$folder has no page"
  grep -q 'name="details"' "$page" || fail "$folder: its page says nothing; docs/api/core.dox, runtime.dox"
done
for part in classdynslam_1_1SE3.html classdynslam_1_1MotionSegmenter.html classdynslam_1_1runtime_1_1Slam.html \
  conceptdynslam_1_1ImageLike.html namespacedynslam.html equations.html search/searchdata.js; do
  [ -s "$html/$part" ] || fail "$part is missing"
done
for example in examples/[0-9]*.cpp; do
  name=$(basename "$example" .cpp)
  [ -s "$html/${name}_8cpp-example.html" ] || fail "$example is missing: docs/api/examples.dox"
done
grep -q 'optimize_pose' "$html/pose_8hpp.html" || fail "pose.hpp's page has no function"
grep -q 'href="equations.html#eq_7"' "$html"/*.html || fail "no header leads to an equation"

# Nothing comes from elsewhere: scripts, styles, images, fonts.
if grep -nE '<(script|img|iframe|source|embed)[^>]*src="(https?:)?//|<link[^>]*href="(https?:)?//' "$html"/*.html \
  "$html"/search/*.html > "$work/remote"; then
  fail "a page fetches from elsewhere: $(head -n 1 "$work/remote")"
fi
grep -nE '@import|url\(["'\'']?(https?:)?//' "$html"/*.css && fail "a style sheet fetches from elsewhere"
grep -q 'src="mathjax/MathJax.js"' "$html/equations.html" || fail "the equations' source is not local"
# All that the page's configuration of MathJax names is there.
for part in MathJax.js extensions/tex2jax.js jax/input/TeX/jax.js jax/output/SVG/jax.js; do
  [ -s "$html/mathjax/$part" ] || fail "mathjax/$part is missing"
done

# The build ends where a header or a page is wrong: in a copy, with a function that has no word, a parameter that does
# not exist and a page that names nothing.
copy=$work/copy
rm -rf "$copy"
mkdir -p "$copy"
cp -r CMakeLists.txt docs examples include runtime scripts tools "$copy"
header=$copy/include/dynslam/dynamics/classify.hpp
refused() {
  if "$copy/scripts/docs.sh" "$copy/out" > "$work/refused" 2>&1; then fail "$1 passed"; fi
  grep -qF "$2" "$work/refused" || fail "$1 is not told: $(cat "$work/refused")"
}
before=$(cat "$header")
sed -i 's|^}  // namespace dynslam|inline int no_word() { return 0; }\n&|' "$header"
sed -i 's|dynslam::is_dynamic|dynslam::is_static|' "$copy/docs/api/equations.md"
refused "a function without a word" "dynslam::no_word is not documented"
refused "a page that names what is not there" "no header has dynslam::is_static"
printf '%s\n' "$before" |
  sed 's|^}  // namespace dynslam|/// None.\n/// @param nothing  is not there\ninline int a_word(int something) { return something; }\n&|' \
    > "$header"
refused "a parameter that does not exist" "argument 'nothing' of command @param"
rm -rf "$copy"
