#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Trains the demo network on synthetic sequences and writes it as ONNX.

Needs Debian's python3-torch, python3-numpy and python3-pil, and the dynslam program:

  models/train_demo_segmenter.py --program build/release/bin/dynslam --out models/demo_segmenter.onnx

Renders sequences of the seeds 100 and up (the demo and the tests use small seeds), trains on the CPU, and
prints the intersection over union per class on sequences of seeds that were not trained on. Everything is
seeded; the order of additions in parallel kernels is not, so two trainings differ in the last digits.
"""
import argparse
import pathlib
import random
import subprocess
import sys
import time

import numpy as np
import torch
from PIL import Image
from torch import nn
from torch.nn import functional as F

CLASSES = ["background", "person", "chair", "display"]
MEAN = torch.tensor([0.485, 0.456, 0.406]).view(1, 3, 1, 1)
DEVIATION = torch.tensor([0.229, 0.224, 0.225]).view(1, 3, 1, 1)
PATHS = ["halfsphere", "xyz", "rpy", "static"]


def block(inputs, outputs, stride=1, dilation=1):
    """Depthwise 3x3, then pointwise, each with normalisation."""
    return nn.Sequential(
        nn.Conv2d(inputs, inputs, 3, stride, dilation, dilation, groups=inputs, bias=False), nn.BatchNorm2d(inputs), nn.ReLU(),
        nn.Conv2d(inputs, outputs, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU())


class DemoSegmenter(nn.Module):
    """RGB 3 x 240 x 320 (ImageNet normalisation) to logits 4 x 120 x 160."""

    def __init__(self):
        super().__init__()
        self.stem = nn.Sequential(nn.Conv2d(3, 16, 3, 2, 1, bias=False), nn.BatchNorm2d(16), nn.ReLU(), block(16, 24))
        self.quarter = nn.Sequential(block(24, 48, 2), block(48, 48))
        self.eighth = nn.Sequential(block(48, 96, 2), block(96, 96))
        self.sixteenth = nn.Sequential(block(96, 160, 2), block(160, 160), block(160, 160, 1, 2), block(160, 160, 1, 4), block(160, 96))
        self.up8 = block(96 + 96, 64)
        self.up4 = block(64 + 48, 48)
        self.up2 = block(48 + 24, 32)
        self.head = nn.Conv2d(32, len(CLASSES), 1)

    def forward(self, x):
        x2 = self.stem(x)
        x4 = self.quarter(x2)
        x8 = self.eighth(x4)
        x16 = self.sixteenth(x8)
        y = self.up8(torch.cat([F.interpolate(x16, scale_factor=2.0, mode="nearest"), x8], 1))
        y = self.up4(torch.cat([F.interpolate(y, scale_factor=2.0, mode="nearest"), x4], 1))
        y = self.up2(torch.cat([F.interpolate(y, scale_factor=2.0, mode="nearest"), x2], 1))
        return self.head(y)


def render(program, folder, seed, frames):
    scenario = "sitting" if seed % 5 == 4 else "walking"
    if not (folder / "groundtruth.txt").exists():
        command = [program, "synth", folder, "--seed", seed, "--frames", frames, "--fps", 4, "--path", PATHS[seed % 4],
                   "--scenario", scenario, "--walkers", 1 + seed % 3, "--box", "true" if seed % 2 else "false"]
        if seed % 3 == 0:
            command.append("--exposure-change")
        if seed % 4 == 1:
            command.append("--motion-blur")
        subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL)
    images, labels = [], []
    for path in sorted((folder / "rgb").glob("*.png")):
        image = Image.open(path).convert("RGB").resize((320, 240), Image.BOX)
        label = np.array(Image.open(folder / "label" / path.name))
        images.append(np.array(image))
        labels.append(label[2::4, 2::4])
    return images, labels


def load(program, folder, seeds, frames):
    images, labels = [], []
    for seed in seeds:
        a, b = render(program, folder / f"seed_{seed}", seed, frames)
        images += a
        labels += b
    return torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2), torch.from_numpy(np.stack(labels)).long()


def normalise(x):
    return (x.float() / 255 - MEAN) / DEVIATION


def augment(x, y):
    if random.random() < 0.5:
        x, y = x.flip(3), y.flip(2)
    x = x.float()
    n = x.shape[0]
    gain = torch.empty(n, 3, 1, 1).uniform_(0.85, 1.15) * torch.empty(n, 1, 1, 1).uniform_(0.7, 1.3)
    x = x * gain + torch.empty(n, 1, 1, 1).uniform_(-15, 15) + torch.randn_like(x) * random.uniform(0, 5)
    return x.clamp(0, 255), y


def intersection_over_union(model, images, labels):
    model.eval()
    both, either = torch.zeros(len(CLASSES)), torch.zeros(len(CLASSES))
    with torch.no_grad():
        for i in range(0, len(images), 8):
            found, truth = model(normalise(images[i:i + 8])).argmax(1), labels[i:i + 8]
            for c in range(len(CLASSES)):
                both[c] += ((found == c) & (truth == c)).sum()
                either[c] += ((found == c) | (truth == c)).sum()
    return both / either


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", required=True, help="the dynslam program, which renders the sequences")
    arguments.add_argument("--out", type=pathlib.Path, required=True)
    arguments.add_argument("--data", type=pathlib.Path, default=pathlib.Path("results/segmenter_data"))
    arguments.add_argument("--seeds", type=int, default=60)
    arguments.add_argument("--frames", type=int, default=12, help="per seed")
    arguments.add_argument("--minutes", type=float, default=20)
    arguments.add_argument("--rate", type=float, default=4e-3)
    arguments.add_argument("--threads", type=int, default=2)
    o = arguments.parse_args()
    random.seed(1)
    torch.manual_seed(1)
    torch.set_num_threads(o.threads)
    images, labels = load(o.program, o.data, range(100, 100 + o.seeds), o.frames)
    unseen = load(o.program, o.data, range(900, 912), o.frames)
    print(f"{len(images)} images to train on, {len(unseen[0])} of unseen seeds", flush=True)

    model = DemoSegmenter()
    weights = torch.tensor([0.6, 1.0, 1.6, 1.6])
    optimiser = torch.optim.AdamW(model.parameters(), lr=o.rate, weight_decay=1e-3)
    start, step, batch = time.time(), 0, 8
    while (done := (time.time() - start) / (60 * o.minutes)) < 1:
        for group in optimiser.param_groups:  # warm up, then fall linearly
            group["lr"] = o.rate * min(1.0, (step + 1) / 50) * max(0.01, 1 - done)
        model.train()
        pick = torch.randint(len(images), (batch,))
        x, y = augment(images[pick], labels[pick])
        loss = F.cross_entropy(model(normalise(x)), y, weight=weights)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        step += 1
        if step % 100 == 0:
            print(f"step {step} {done:.0%} loss {loss.item():.3f}", flush=True)
    iou = intersection_over_union(model, *unseen)
    print("IoU on unseen seeds: " + ", ".join(f"{n} {v:.3f}" for n, v in zip(CLASSES, iou)))
    o.out.parent.mkdir(parents=True, exist_ok=True)
    model.eval()
    torch.onnx.export(model, torch.zeros(1, 3, 240, 320), str(o.out), opset_version=12, input_names=["image"], output_names=["out"])
    print(f"{o.out}: {o.out.stat().st_size} bytes, {step} steps")
    return 0


if __name__ == "__main__":
    sys.exit(main())
