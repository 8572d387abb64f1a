#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# scripts/get-model.sh compares the whole SHA-256 of what it downloads: with a made-up curl that brings made-up
# weights, and a made-up python that would export them.
set -euo pipefail
script=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)/scripts/get-model.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/bin"
cat > "$work/bin/curl" <<'CURL'
#!/bin/sh
while [ "$1" != -o ]; do shift; done
printf '%s' "$WEIGHTS" > "$2"
CURL
cat > "$work/bin/python" <<'PYTHON'
#!/bin/sh
[ "$1" = -c ] && exit 0
while [ "$1" != --out ]; do shift; done
echo model > "$2"
PYTHON
chmod +x "$work/bin/"*
export PATH=$work/bin:$PATH PYTHON=$work/bin/python WEIGHTS=weights
sum=$(printf '%s' weights | sha256sum | cut -d' ' -f1)
out=$work/models/m.onnx
kept=$work/models/maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth.sha256

fail() {
  echo "FAILED: $*" >&2
  exit 1
}
# refused REASON [NAME=VALUE]...: nothing is exported.
refused() {
  local reason=$1
  shift
  rm -f "$out"
  ! env "$@" "$script" maskrcnn "$out" > "$work/log" 2>&1 || fail "accepted: $*"
  grep -qF "$reason" "$work/log" || fail "'$reason' is not said: $(cat "$work/log")"
  [ ! -e "$out" ] || fail "exported all the same: $*"
}

refused "not bf2d0c1e... as its name says"                          # another file than the name's
refused "is no SHA-256 of 64 digits" WEIGHTS_SHA256="${sum:0:8}"    # a beginning is not enough
refused "not ${sum:0:63}" WEIGHTS_SHA256="${sum:0:63}$([ "${sum:63}" = 0 ] && echo 1 || echo 0)"
[ ! -e "$kept" ] || fail "a sum that was refused is kept"
WEIGHTS_SHA256=$sum "$script" maskrcnn "$out" > /dev/null 2>&1 || fail "refused with its whole sum"
[ -e "$out" ] || fail "nothing was exported"
[ "$(cut -d' ' -f1 "$kept")" = "$sum" ] || fail "the sum is not kept"
refused "($kept)" WEIGHTS=others                                    # the next download is compared with it
"$script" maskrcnn "$out" > /dev/null 2>&1 || fail "the same file is refused the second time"
echo > "$kept"
refused "$kept: '' is no SHA-256"
