#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# What a new user does, on a Debian that has nothing but git: clones this repository's last commit into a bare root and
# runs commands of it there. Needs root, debootstrap and the network.
#
#   scripts/clean-build.sh [SUITE [COMMAND...]]     SUITE: bookworm; COMMAND...: the two of README.md
#
#   scripts/clean-build.sh trixie                            # scripts/demo.sh, then scripts/test.sh --sanitizers
#   WORK=/var/tmp/trixie scripts/clean-build.sh trixie sh -c 'scripts/install-deps.sh app && cmake --preset release'
#
# Environment: MIRROR; ROOT a folder in which the bare root is kept for the next call; WORK a folder that keeps the
# root that was used: the next call goes on in it, with the commit that is the last by then.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. scripts/bare-root.sh
suite=${1:-bookworm}
[ $# -eq 0 ] || shift

needs_of_bare_root
if [ -n "${WORK:-}" ]; then
  mkdir -p "$WORK"
  work=$(realpath "$WORK")
  rm -rf --one-file-system "$work/root.partial"
else
  work=$(mktemp -d)
  trap 'rm -rf --one-file-system "$work"' EXIT
fi
clone=$work/root/root/dynslam
[ -d "$work/root" ] || make_bare_root
grep -q "VERSION_CODENAME=$suite\$" "$work/root/etc/os-release" || fail "$work/root is not $suite"
if [ ! -x "$work/root/usr/bin/git" ]; then
  apt update
  apt install -y --no-install-recommends ca-certificates git
fi
[ -d "$clone" ] || git clone --quiet --no-hardlinks . "$clone"
git -C "$clone" fetch --quiet "$PWD" HEAD
git -C "$clone" checkout --quiet --detach FETCH_HEAD

in_clone() {
  echo "clean-build: $suite, $(git -C "$clone" rev-parse --short HEAD): $*"
  inside sh -c 'cd /root/dynslam && exec "$@"' sh "$@" || fail "$suite: $* ended with $?"
}
if [ $# -gt 0 ]; then
  in_clone "$@"
else
  in_clone ./scripts/demo.sh
  in_clone ./scripts/test.sh --sanitizers
fi
echo "clean-build: $suite: done in $SECONDS s"
