#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes torchvision's Mask R-CNN as an ONNX file that dynslam runs (`--model`, kind mask-rcnn).

Needs Debian's python3-torch and python3-torchvision.

  models/export_maskrcnn.py --weights maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth --out maskrcnn.onnx
  models/export_maskrcnn.py --tiny --out tests/data/tiny_maskrcnn.onnx --golden tests/data/tiny_maskrcnn.txt

Without --weights the network has seeded random weights: useful for tests only. --golden also writes what
torchvision itself answers to a picture that tests can make again.
"""
import argparse
import pathlib
import sys

import torch
import torchvision
from torch import nn
from torchvision.models.detection import MaskRCNN
from torchvision.models.detection.anchor_utils import AnchorGenerator


class TinyBackbone(nn.Module):
    """Three convolutions, stride 8: as small as a detector's backbone can be."""

    out_channels = 16

    def __init__(self):
        super().__init__()
        self.layers = nn.Sequential(nn.Conv2d(3, 8, 3, 2, 1), nn.ReLU(), nn.Conv2d(8, 16, 3, 2, 1), nn.ReLU(),
                                    nn.Conv2d(16, 16, 3, 2, 1), nn.ReLU())

    def forward(self, x):
        return self.layers(x)


def tiny(width, height):
    pool = torchvision.ops.MultiScaleRoIAlign(["0"], 4, 2)
    return MaskRCNN(
        TinyBackbone(), min_size=min(width, height), max_size=max(width, height),
        rpn_anchor_generator=AnchorGenerator(((24, 48),), ((0.5, 1.0),)), rpn_pre_nms_top_n_test=50, rpn_post_nms_top_n_test=12,
        box_roi_pool=pool, box_head=torchvision.models.detection.faster_rcnn.TwoMLPHead(16 * 4 * 4, 32),
        box_predictor=torchvision.models.detection.faster_rcnn.FastRCNNPredictor(32, 4), box_detections_per_img=8,
        mask_roi_pool=torchvision.ops.MultiScaleRoIAlign(["0"], 14, 2),
        mask_head=torchvision.models.detection.mask_rcnn.MaskRCNNHeads(16, (16,), 1),
        mask_predictor=torchvision.models.detection.mask_rcnn.MaskRCNNPredictor(16, 16, 4))


def picture(width, height):
    """3 x height x width, 0..1; exact multiples of 1/255 from integer arithmetic, so that C++ makes the same."""
    v, u = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    return torch.stack([(7 * u + 3 * v) % 256, (5 * u * v // 16) % 256, (u * u // 8 + 11 * v) % 256]).float() / 255


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--weights", type=pathlib.Path, help="state dictionary of maskrcnn_resnet50_fpn")
    arguments.add_argument("--tiny", action="store_true", help="a network of some kilobytes with random weights")
    arguments.add_argument("--width", type=int)
    arguments.add_argument("--height", type=int)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--golden", type=pathlib.Path, help="write torchvision's own answer there, as text")
    arguments.add_argument("--out", type=pathlib.Path, required=True)
    o = arguments.parse_args()
    width, height = o.width or (96 if o.tiny else 640), o.height or (64 if o.tiny else 480)
    torch.manual_seed(o.seed)
    if o.tiny:
        model = tiny(width, height)
    else:
        model = torchvision.models.detection.maskrcnn_resnet50_fpn(
            weights=None, weights_backbone=None, min_size=min(width, height), max_size=max(width, height))
    if o.weights:
        model.load_state_dict(torch.load(o.weights, map_location="cpu", weights_only=True))
    model.eval()
    image = picture(width, height)
    torch.onnx.export(model, ([image],), str(o.out), opset_version=11, input_names=["image"],
                      output_names=["boxes", "labels", "scores", "masks"],
                      dynamic_axes={name: {0: "detections"} for name in ("boxes", "labels", "scores", "masks")})
    print(f"{o.out}: {o.out.stat().st_size} bytes")
    if o.golden:
        with torch.no_grad():
            answer = model([image])[0]
        with open(o.golden, "w", encoding="ascii") as out:
            print("# What torchvision answers: per detection x1 y1 x2 y2 label score, then the mask's mean and the sum of its pixels above 0.5", file=out)
            for box, label, score, mask in zip(answer["boxes"], answer["labels"], answer["scores"], answer["masks"]):
                print(*[f"{x:.5f}" for x in box.tolist()], label.item(), f"{score.item():.6f}", f"{mask.mean().item():.6f}",
                      int((mask > 0.5).sum()), file=out)
        print(f"{o.golden}: {len(answer['boxes'])} detections")
    return 0


if __name__ == "__main__":
    sys.exit(main())
