#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# The version of the CMake project is the one that CITATION.cff and the headers have, and CHANGELOG.md tells what is in
# it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
version=$(sed -nE 's/^  VERSION ([0-9]+\.[0-9]+\.[0-9]+)$/\1/p' CMakeLists.txt)

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

[ -n "$version" ] || fail "CMakeLists.txt states no version"
grep -qx "version: $version" CITATION.cff || fail "CITATION.cff has another version than $version"
grep -qE "^## \[${version//./\\.}\]" CHANGELOG.md || fail "CHANGELOG.md has no section [$version]"
IFS=. read -r major minor patch <<< "$version"
for part in "MAJOR $major" "MINOR $minor" "PATCH $patch"; do
  grep -qx "#define DYNSLAM_VERSION_$part" include/dynslam/version.hpp || fail "version.hpp has another $part"
done
