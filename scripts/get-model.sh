#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Fetches public weights and makes an ONNX file of them. The weights keep their own licences.
#
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
sum=bf2d0c1e  # the name ends in the first digits of the file's SHA-256, as for all of torchvision's weights
python=/usr/bin/python3
"$python" -c 'import torch, torchvision' 2> /dev/null ||
  fail "needs Debian's python3-torch and python3-torchvision: apt-get install python3-torch python3-torchvision"
command -v curl > /dev/null || fail "needs curl"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
curl -fsSL -o "$work/$file" "https://download.pytorch.org/models/$file" ||
  fail "could not fetch https://download.pytorch.org/models/$file (is the network up?)"
[[ $(sha256sum "$work/$file") == "$sum"* ]] || fail "$file is not the one that was expected"
mkdir -p "$(dirname "$out")"
"$python" tools/export_maskrcnn.py --weights "$work/$file" --out "$out"
echo "get-model: run it with --model $out"
