#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Installs the Debian packages of a folder in a root that has nothing else, uses them, removes them, and says what they
# leave behind. Needs root, debootstrap and the network.
#
#   scripts/clean-root.sh [FOLDER]     FOLDER: build/release/packages, where cpack puts them
#
# Environment: SUITE (bookworm) the release of Debian; MIRROR; ROOT a folder in which the bare root is kept for the next
# call. Program and core are used: `dynslam` renders and tracks a sequence with the packaged network, a program
# is compiled with pkg-config's flags.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. scripts/bare-root.sh
packages=${1:-build/release/packages} suite=${SUITE:-bookworm}

needs_of_bare_root
for name in dynslam libdynslam-dev; do
  [ "$(find "$packages" -maxdepth 1 -name "${name}_*.deb" 2> /dev/null | wc -l)" = 1 ] ||
    fail "$packages has not one package $name; cpack makes them"
done

work=$(mktemp -d)
trap 'rm -rf --one-file-system "$work"' EXIT
make_bare_root
mkdir "$work/root/packages"
cp "$packages"/dynslam_*.deb "$work/root/packages/dynslam.deb"
cp "$packages"/libdynslam-dev_*.deb "$work/root/packages/libdynslam-dev.deb"

apt update
echo "clean-root: installing dynslam"
apt install -y --no-install-recommends /packages/dynslam.deb
inside dynslam --version
inside dynslam synth /tmp/sequence --frames 6 > /dev/null
inside dynslam run /tmp/sequence --out /tmp/out --model /usr/share/dynslam/models/demo_segmenter.onnx | head -n 1
[ ! -e "$work/root/usr/share/dynslam/report/report.html" ] || inside dynslam report /tmp/out
inside dynslam info /tmp/sequence --camera tum_fr3 > /dev/null
[ -s "$work/root/tmp/out/trajectory.txt" ] || fail "no trajectory was written"
echo "clean-root: installing libdynslam-dev"
apt install -y --no-install-recommends /packages/libdynslam-dev.deb g++ pkg-config
cp tests/consumer/main.cpp "$work/root/tmp/main.cpp"
inside sh -c 'g++ -std=c++20 -O0 /tmp/main.cpp $(pkg-config --cflags dynslam) -o /tmp/main && /tmp/main'
echo "clean-root: removing both"
apt purge -y dynslam libdynslam-dev
left=$(cd "$work/root" && find usr etc var/lib/dpkg/info -iname '*dynslam*')
[ -z "$left" ] || fail "left behind: $left"
echo "clean-root: $suite: installed, run, compiled against, removed; nothing is left"
