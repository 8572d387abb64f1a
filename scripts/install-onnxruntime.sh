#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Puts ONNX Runtime 1.21.0 into .cache/onnxruntime of this repository, for distributions that have no
# package of it (Debian 12). Nothing on the system is changed. Does nothing when it is there already, or
# when the distribution's libonnxruntime-dev is installed.
#
# The shared library is the one in the npm package onnxruntime-node (built by Microsoft, needs glibc 2.28);
# no install script of that package is run. The headers are those of Debian 13's libonnxruntime-dev, fetched
# and checked by apt from the machine's own mirror, unpacked and never installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

version=1.21.0
prefix=$PWD/.cache/onnxruntime
keyring=/usr/share/keyrings/debian-archive-keyring.gpg

fail() {
  echo "install-onnxruntime: $*" >&2
  exit 1
}

case "$(uname -m)" in
  x86_64) folder=x64 sum=05bfddeefc536a44478c20226218dae8853995518bb2a994b4fa15a996f5f412 ;;
  aarch64) folder=arm64 sum=36671b53885a8433882c4db360138bd060f3580f7d7cb6578050e755e83b6128 ;;
  *) fail "no ready library for $(uname -m); set ONNXRUNTIME_ROOT to your own build" ;;
esac

if [ "$(dpkg-query -W -f '${db:Status-Status}' libonnxruntime-dev 2> /dev/null)" = installed ]; then
  echo "install-onnxruntime: the distribution's libonnxruntime-dev is installed"
  exit 0
fi
if [ -f "$prefix/VERSION" ] && [ "$(cat "$prefix/VERSION")" = "$version" ]; then
  echo "install-onnxruntime: version $version is in $prefix"
  exit 0
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

echo "install-onnxruntime: fetching the library"
if command -v npm > /dev/null; then
  (cd "$work" && npm pack --silent --ignore-scripts "onnxruntime-node@$version" > /dev/null) ||
    fail "npm could not fetch onnxruntime-node $version (is the network up?)"
else
  command -v curl > /dev/null || fail "needs npm or curl"
  curl -fsSL -o "$work/onnxruntime-node-$version.tgz" \
    "https://registry.npmjs.org/onnxruntime-node/-/onnxruntime-node-$version.tgz" ||
    fail "could not fetch onnxruntime-node $version (is the network up?)"
fi
library=package/bin/napi-v3/linux/$folder/libonnxruntime.so.$version
tar -xzf "$work/onnxruntime-node-$version.tgz" -C "$work" "$library"
echo "$sum  $work/$library" | sha256sum --check --quiet || fail "the library is not the one that was expected"

echo "install-onnxruntime: fetching the headers"
[ -f "$keyring" ] || fail "no $keyring: the headers' signature could not be checked"
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 2> /dev/null | grep -v security | grep debian | head -n 1 || true)
echo "deb [signed-by=$keyring] ${mirror:-http://deb.debian.org/debian} trixie main" > "$work/sources.list"
mkdir -p "$work/lists/partial" "$work/archives/partial" "$work/state"
apt=(apt-get -qq -o Dir::Etc::SourceList="$work/sources.list" -o Dir::Etc::SourceParts=/dev/null
  -o Dir::State::Lists="$work/lists" -o Dir::Cache::Archives="$work/archives"
  -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User="$(id -un)")
"${apt[@]}" update > /dev/null || fail "Debian 13's package list could not be fetched"
(cd "$work" && "${apt[@]}" download libonnxruntime-dev > /dev/null) || fail "libonnxruntime-dev could not be fetched"
dpkg-deb -x "$work"/libonnxruntime-dev_*.deb "$work/dev"
headers=$(find "$work/dev" -name onnxruntime_c_api.h -printf '%h\n' | head -n 1)
[ -n "$headers" ] || fail "Debian's package has no headers"
grep -q '#define ORT_API_VERSION 21' "$headers/onnxruntime_c_api.h" ||
  fail "Debian's headers are not those of version $version any more"

rm -rf "$prefix"
mkdir -p "$prefix/include" "$prefix/lib"
cp -r "$headers/." "$prefix/include/"
cp "$work/$library" "$prefix/lib/libonnxruntime.so.1"
ln -s libonnxruntime.so.1 "$prefix/lib/libonnxruntime.so"
echo "$version" > "$prefix/VERSION"
echo "install-onnxruntime: version $version is in $prefix"
