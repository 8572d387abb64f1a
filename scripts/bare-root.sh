# SPDX-License-Identifier: BSD-3-Clause
#
# A root folder with a release of Debian that has nothing else, for scripts/clean-root.sh and scripts/clean-build.sh,
# which source this after they have set `suite` and `work`, a folder: the root is $work/root. ROOT names a folder in
# which the bare root is kept for the next call, MIRROR where Debian is fetched from. Needs root, debootstrap, network.
# shellcheck shell=bash disable=SC2154

fail() {
  echo "$(basename "$0" .sh): $*" >&2
  exit 1
}

needs_of_bare_root() {
  [ "$(id -u)" -eq 0 ] || fail "needs root: a root folder is made and entered with chroot"
  command -v debootstrap > /dev/null || fail "needs debootstrap: apt-get install debootstrap"
}

make_bare_root() {
  local base=${ROOT:-$work/base}
  if [ ! -e "$base/.complete" ]; then
    rm -rf --one-file-system "$base"
    echo "$(basename "$0" .sh): making a bare $suite"
    debootstrap --variant=minbase "$suite" "$base" "${MIRROR:-http://deb.debian.org/debian}" > "$work/log" 2>&1 || {
      tail -n 20 "$work/log" >&2
      fail "debootstrap could not make $suite (is the network up?)"
    }
    touch "$base/.complete"
  fi
  grep -q "VERSION_CODENAME=$suite\$" "$base/etc/os-release" || fail "$base is not $suite"
  cp -a "$base" "$work/root.partial"
  cp /etc/resolv.conf "$work/root.partial/etc/resolv.conf"
  # What this machine trusts besides Debian's certificates (a proxy that signs for itself), ca-certificates takes over.
  mkdir -p "$work/root.partial/usr/local/share/ca-certificates"
  find /usr/local/share/ca-certificates -maxdepth 1 -name '*.crt' \
    -exec cp -t "$work/root.partial/usr/local/share/ca-certificates" {} + 2> /dev/null || true
  printf '#!/bin/sh\nexit 101\n' > "$work/root.partial/usr/sbin/policy-rc.d"  # no services
  chmod +x "$work/root.partial/usr/sbin/policy-rc.d"
  mv "$work/root.partial" "$work/root"
}

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
