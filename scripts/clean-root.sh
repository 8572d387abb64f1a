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
packages=${1:-build/release/packages} suite=${SUITE:-bookworm} mirror=${MIRROR:-http://deb.debian.org/debian}

fail() {
  echo "clean-root: $*" >&2
  exit 1
}

[ "$(id -u)" -eq 0 ] || fail "needs root: a root folder is made and entered with chroot"
command -v debootstrap > /dev/null || fail "needs debootstrap: apt-get install debootstrap"
for name in dynslam libdynslam-dev; do
  [ "$(find "$packages" -maxdepth 1 -name "${name}_*.deb" 2> /dev/null | wc -l)" = 1 ] ||
    fail "$packages has not one package $name; cpack makes them"
done

work=$(mktemp -d)
trap 'rm -rf --one-file-system "$work"' EXIT
base=${ROOT:-$work/base}
if [ ! -e "$base/.complete" ]; then
  rm -rf --one-file-system "$base"
  echo "clean-root: making a bare $suite"
  debootstrap --variant=minbase "$suite" "$base" "$mirror" > "$work/log" 2>&1 || {
    tail -n 20 "$work/log" >&2
    fail "debootstrap could not make $suite (is the network up?)"
  }
  touch "$base/.complete"
fi
cp -a "$base" "$work/root"
cp /etc/resolv.conf "$work/root/etc/resolv.conf"
printf '#!/bin/sh\nexit 101\n' > "$work/root/usr/sbin/policy-rc.d"  # no services
chmod +x "$work/root/usr/sbin/policy-rc.d"
mkdir "$work/root/packages"
cp "$packages"/dynslam_*.deb "$work/root/packages/dynslam.deb"
cp "$packages"/libdynslam-dev_*.deb "$work/root/packages/libdynslam-dev.deb"

# /proc is what tells a program where it lies. It is mounted for the command alone, in a name space of its own: nothing
# of it is left to be removed by mistake.
inside() {
  env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive HOME=/root unshare --mount \
    sh -c 'mount -t proc proc "$0/proc" && exec chroot "$0" "$@"' "$work/root" "$@"
}
apt() {
  inside apt-get -qq -o Dpkg::Use-Pty=0 "$@" > "$work/log" 2>&1 || {
    tail -n 20 "$work/log" >&2
    fail "apt-get $* failed"
  }
}

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
