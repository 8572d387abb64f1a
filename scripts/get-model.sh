#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Fetches public weights and makes an ONNX file of them. The weights keep their own licences.
#
#   [WEIGHTS_SHA256=...] \
#   scripts/get-model.sh maskrcnn [OUT]   torchvision's Mask R-CNN (COCO; weights BSD-3-Clause), exported here
#                                         with Debian's python3-torch and python3-torchvision
#
# WEIGHTS_SHA256 is the whole sum that the weights must have. Without it the sum that OUT's folder holds from an
# earlier download is taken; without that, too, the first download is believed as far as HTTPS and the eight digits in
# the file's name go, and its sum is kept for the next one. Only numbers are taken from the file, no code.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
  echo "get-model: $*" >&2
  exit 1
}

[ "${1:-}" = maskrcnn ] || fail "usage: scripts/get-model.sh maskrcnn [OUT.onnx]"
out=${2:-models/maskrcnn_coco_640x480.onnx}
file=maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth
kept=$(dirname "$out")/$file.sha256
if [ -n "${WEIGHTS_SHA256:-}" ]; then
  sum=$WEIGHTS_SHA256 said_by=WEIGHTS_SHA256
elif [ -e "$kept" ]; then
  sum=$(cut -d' ' -f1 "$kept") said_by=$kept
else
  sum= said_by=
fi
[[ -z $said_by || $sum =~ ^[0-9a-f]{64}$ ]] || fail "$said_by: '$sum' is no SHA-256 of 64 digits 0-9 a-f"
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import torch, torchvision' 2> /dev/null ||
  fail "needs Debian's python3-torch and python3-torchvision: apt-get install python3-torch python3-torchvision"
command -v curl > /dev/null || fail "needs curl"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
curl -fsSL --proto '=https' -o "$work/$file" "https://download.pytorch.org/models/$file" ||
  fail "could not fetch https://download.pytorch.org/models/$file (is the network up?)"
found=$(sha256sum < "$work/$file")
found=${found%% *}
if [ -n "$sum" ]; then
  [ "$found" = "$sum" ] || fail "$file has the SHA-256 $found, not $sum ($said_by)"
else
  [[ $found == bf2d0c1e* ]] || fail "$file has the SHA-256 $found, not bf2d0c1e... as its name says"
  echo "get-model: first download of $file: its SHA-256 $found is kept in $kept and compared from now on" >&2
fi
mkdir -p "$(dirname "$out")"
"$python" models/export_maskrcnn.py --weights "$work/$file" --out "$out"
echo "$found  $file" > "$kept"
echo "get-model: run it with --model $out"
