#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Fetches public weights and makes an ONNX file of them. The weights keep their own licences.
#
#   [WEIGHTS_SHA256=...] \
#   scripts/get-model.sh maskrcnn [OUT]   torchvision's Mask R-CNN (COCO; weights BSD-3-Clause), exported here
#                                         with Debian's python3-torch and python3-torchvision
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
  echo "get-model: $*" >&2
  exit 1
}

[ "${1:-}" = maskrcnn ] || fail "usage: scripts/get-model.sh maskrcnn [OUT.onnx]"
out=${2:-models/maskrcnn_coco_640x480.onnx}
file=maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth
# The name ends in the first digits of the file's SHA-256, as for all of torchvision's weights. They find a damaged
# file, not a forged one: WEIGHTS_SHA256, where it is set, must be the whole sum; and only numbers are taken from the
# file, no code (weights_only).
sum=${WEIGHTS_SHA256:-bf2d0c1e}
python=/usr/bin/python3
"$python" -c 'import torch, torchvision' 2> /dev/null ||
  fail "needs Debian's python3-torch and python3-torchvision: apt-get install python3-torch python3-torchvision"
command -v curl > /dev/null || fail "needs curl"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
curl -fsSL -o "$work/$file" "https://download.pytorch.org/models/$file" ||
  fail "could not fetch https://download.pytorch.org/models/$file (is the network up?)"
found=$(sha256sum < "$work/$file")
found=${found%% *}
[[ $found == "$sum"* ]] || fail "$file has the SHA-256 $found, not ${WEIGHTS_SHA256:-$sum...}"
[[ -n ${WEIGHTS_SHA256:-} ]] ||
  echo "get-model: $file has the SHA-256 $found; set WEIGHTS_SHA256 to it to have the next download compared" >&2
mkdir -p "$(dirname "$out")"
"$python" tools/export_maskrcnn.py --weights "$work/$file" --out "$out"
echo "get-model: run it with --model $out"
