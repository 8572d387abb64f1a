#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes the pictures of docs/figures/; scripts/figures.sh says how."""
import argparse
import base64
import json
import os
import pathlib
import subprocess
import sys

import cv2
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("DYNSLAM", str(ROOT / "build/release/bin/dynslam"))
DATA = pathlib.Path(os.environ["DYNSLAM_DATA"]).resolve() if os.environ.get("DYNSLAM_DATA") else None
WORK = pathlib.Path(os.environ.get("WORK", ROOT / "results/figures")).resolve()
OUT = pathlib.Path(os.environ.get("OUT", ROOT / "docs/figures")).resolve()

WALKING = "rgbd_dataset_freiburg3_walking_halfsphere_first50"
PEOPLE = "fr1_xyz_people_200"
RED, ORANGE = np.array([40.0, 40.0, 255.0]), np.array([0.0, 165.0, 255.0])  # BGR


class Absent(Exception):
    """What a picture needs and this machine does not have."""


def sequence(name):
    folder = DATA / "tum" / name if DATA else None
    if folder is None or not (folder / "rgb.txt").exists():
        raise Absent(f"DYNSLAM_DATA names no folder with tum/{name}")
    return folder


def run(name, path, mode, *options):
    """A run of the program, once. @return its folder"""
    folder = WORK / name / mode
    if not (folder / "summary.json").exists() or json.loads((folder / "summary.json").read_text())["interrupted"]:
        if mode in ("semantic", "both"):
            network = DATA / "models/yolo11n-seg_416x320_full.onnx" if DATA else pathlib.Path("/nonexistent")
            if not network.exists():
                raise Absent(f"no network {network}")
            options = (*options, "--model", network)
        call("run", path, "--dynamics", mode, "--save-masks", "--report", "--map-resolution", "0.02", "--out", folder,
             *options)
    return folder


def call(*arguments):
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def colour_images(folder):
    """Stamp and file of each colour image."""
    lines = [line.split() for line in (folder / "rgb.txt").read_text().splitlines() if line and line[0] != "#"]
    return [(line[0], folder / line[1]) for line in lines]


def with_mask(image, mask):
    """Red where something moves, orange where it only may, with the border drawn."""
    shown = image.copy()
    there = mask > 0
    for part, colour in ((mask == 255, RED), (there & (mask < 255), ORANGE)):
        shown[part] = (0.5 * shown[part] + 0.5 * colour).astype(np.uint8)
    borders, _ = cv2.findContours(there.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(shown, borders, -1, (255, 255, 255), 1)


def mask_of(folder, stamp):
    return cv2.imread(str(folder / "masks" / f"{stamp}.png"), cv2.IMREAD_GRAYSCALE)


def labelled(image, text, size):
    """The image in a box of SIZE (width, height) with a line of text above it."""
    scale = min(size[0] / image.shape[1], size[1] / image.shape[0])
    fitted = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    box = np.full((size[1] + 26, size[0], 3), 255, np.uint8)
    top, left = 26 + (size[1] - fitted.shape[0]) // 2, (size[0] - fitted.shape[1]) // 2
    box[top:top + fitted.shape[0], left:left + fitted.shape[1]] = fitted
    cv2.putText(box, text, (2, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    return box


def sheet(rows, gap=8):
    columns = max(len(row) for row in rows)
    blank = np.full_like(rows[0][0], 255)
    space = np.full((blank.shape[0], gap, 3), 255, np.uint8)
    lines = []
    for row in rows:
        parts = []
        for image in [*row, *[blank] * (columns - len(row))]:
            parts += [image, space]
        lines.append(np.hstack(parts[:-1]))
    return np.vstack(lines)


def rendered_map(folder, like=None):
    """The map of a run, cut to what is in it, or to the window of another one. @return picture, window"""
    file = folder / "map.png"
    if not file.exists():
        call("map", "render", folder / "map.sot", file)
    picture = cv2.imread(str(file))
    if like is None:
        ground = picture[0, 0].astype(int)
        there = np.argwhere(np.abs(picture.astype(int) - ground).max(axis=2) > 8)
        (top, left), (bottom, right) = there.min(axis=0) - 10, there.max(axis=0) + 10
        like = (max(top, 0), bottom, max(left, 0), right)
    return picture[like[0]:like[1], like[2]:like[3]], like


def write(name, picture):
    """As PNG, or as JPEG by the name."""
    file = OUT / name
    cv2.imwrite(str(file), picture, [cv2.IMWRITE_JPEG_QUALITY, 85, cv2.IMWRITE_PNG_COMPRESSION, 9])
    return file


# --- the pictures ------------------------------------------------------------------------------------


def overview():
    """Input, mask and map, side by side, of people who get up and walk (README)."""
    folder = sequence(WALKING)
    both = run(WALKING, folder, "both")
    stamp, file = colour_images(folder)[26]
    image = cv2.imread(str(file))
    picture, _ = rendered_map(both)
    size = (320, 240)
    return write("overview.png", sheet([[labelled(image, "input: colour and depth", size),
                                         labelled(with_mask(image, mask_of(both, stamp)), "dynamic mask", size),
                                         labelled(picture, "map without the people", size)]]))


def masks():
    """Masks over people: without a network, and with one."""
    folder = sequence(WALKING)
    rows = []
    for mode, text in (("geometric", "geometric (no network)"), ("both", "both (yolo11n-seg)")):
        done = run(WALKING, folder, mode)
        row = []
        for index in (6, 20, 34, 46):
            stamp, file = colour_images(folder)[index]
            shown = with_mask(cv2.imread(str(file)), mask_of(done, stamp))
            row.append(labelled(shown, f"{text}, frame {index}", (320, 240)))
        rows.append(row)
    return write("masks.jpg", sheet(rows))


def weights():
    """Static weights (Eq 7) of the reference keyframe's keypoints, red to blue."""
    folder = sequence(WALKING)
    done = run(WALKING, folder, "geometric")
    images = dict(colour_images(folder))
    row = []
    lines = [json.loads(line) for line in (done / "report.jsonl").read_text().splitlines()]
    for index in (20, 34):
        frame = [line for line in lines if "frame" in line][index]
        shown = cv2.imread(str(images[frame["frame"]]))
        shown = cv2.addWeighted(shown, 0.6, np.full_like(shown, 255), 0.4, 0)
        data = np.frombuffer(base64.b64decode(frame["keypoints"]), np.uint8).reshape(-1, 5)
        for u0, u1, v0, v1, weight in data.astype(int):
            at = (round((u0 + 256 * u1) / 8), round((v0 + 256 * v1) / 8))
            share = weight / 255
            colour = (int(255 * share), int(60 * (1 - abs(2 * share - 1))), int(255 * (1 - share)))
            cv2.circle(shown, at, 5, (255, 255, 255), -1, cv2.LINE_AA)
            cv2.circle(shown, at, 4, colour, -1, cv2.LINE_AA)
        row.append(labelled(shown, f"frame {index}: weight 0 (red, moves) to 1 (blue, static)", (480, 360)))
    return write("weights.jpg", sheet([row]))


def maps():
    """The map of a plain tracker, and that without what moves."""
    folder = sequence(WALKING)
    kept, window = rendered_map(run(WALKING, folder, "none"))
    removed, _ = rendered_map(run(WALKING, folder, "both"), window)
    size = (480, 360)
    return write("maps.jpg", sheet([[labelled(kept, "--dynamics none: people are in the map", size),
                                     labelled(removed, "--dynamics both: they are not", size)]]))


def positions(file):
    rows = [line.split() for line in pathlib.Path(file).read_text().splitlines() if line and line[0] != "#"]
    return np.array([[float(word) for word in row[:4]] for row in rows])


def aligned(estimate, truth):
    """Estimate and truth at the same times (20 ms), the estimate moved on the truth (SE(3), Horn)."""
    nearest = np.abs(truth[:, 0][None] - estimate[:, 0][:, None]).argmin(axis=1)
    close = np.abs(truth[nearest, 0] - estimate[:, 0]) < 0.02
    e, g = estimate[close, 1:], truth[nearest[close], 1:]
    e0, g0 = e.mean(axis=0), g.mean(axis=0)
    u, _, vt = np.linalg.svd((g - g0).T @ (e - e0))
    r = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    return (e - e0) @ r.T + g0, g


def svg(width, height, parts):
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
            'font-family="sans-serif" font-size="13">\n<rect width="100%" height="100%" fill="white"/>\n')
    return head + "\n".join(parts) + "\n</svg>\n"


def words(x, y, text, anchor="start", size=13, fill="#222"):
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" font-size="{size}" fill="{fill}">{text}</text>'


def trajectory():
    """Estimates of both modes over the truth, from the side where the motion is largest."""
    folder = sequence(WALKING)
    truth = positions(folder / "groundtruth.txt")
    found = {mode: aligned(positions(run(WALKING, folder, mode) / "trajectory.txt"), truth) for mode in ("none", "both")}
    g = found["both"][1]
    axes = np.argsort(np.ptp(g, axis=0))[::-1][:2]
    everything = np.vstack([g[:, axes], *(e[:, axes] for e, _ in found.values())])
    low, scale = everything.min(axis=0), 520 / np.ptp(everything, axis=0).max()
    height = 60 + scale * np.ptp(everything[:, 1])

    def line(points, colour, width, extra=""):
        xy = 40 + (points[:, axes] - low) * scale
        return (f'<polyline fill="none" stroke="{colour}" stroke-width="{width}" {extra} points="'
                + " ".join(f"{x:.1f},{height - y + 10:.1f}" for x, y in xy) + '"/>')

    parts = [line(g, "#999", 7, 'stroke-linecap="round"'), line(found["none"][0], "#d62728", 2),
             line(found["both"][0], "#1f4fd6", 2)]
    for row, (text, colour) in enumerate((("ground truth", "#999"), ("--dynamics none", "#d62728"),
                                          ("--dynamics both", "#1f4fd6"))):
        parts += [f'<rect x="610" y="{40 + 24 * row}" width="24" height="4" fill="{colour}"/>',
                  words(642, 47 + 24 * row, text)]
    parts += [f'<rect x="610" y="126" width="{0.05 * scale:.0f}" height="3" fill="#222"/>', words(610, 122, "5 cm")]
    file = OUT / "trajectory.svg"
    file.write_text(svg(780, round(max(height + 40, 170)), parts))
    return file


def stages():
    """Median time of a frame by stage."""
    folder = sequence(PEOPLE)
    shown = {"features": "features", "initial_pose": "first pose", "local_map": "local map", "lucas_kanade": "patches",
             "residuals": "residuals", "free_space": "free space", "growing": "mask", "pose": "pose again",
             "keyframe": "keyframe"}
    colours = ("#4e79a7", "#f28e2b", "#e15759", "#76b7b2", "#59a14f", "#edc948", "#b07aa1", "#9c755f", "#bab0ac")
    parts, y, scale = [], 30, None
    for mode in ("geometric", "none"):
        done = json.loads((run(PEOPLE, folder, mode) / "summary.json").read_text())["stages"]
        times = [done[name]["median_ms"] for name in shown]
        scale = scale or 560 / sum(times)
        parts.append(words(10, y + 22, f"--dynamics {mode}"))
        x = 170
        for time, colour in zip(times, colours):
            parts.append(f'<rect x="{x:.1f}" y="{y}" width="{time * scale:.1f}" height="34" fill="{colour}"/>')
            x += time * scale
        parts.append(words(x + 6, y + 22, f"{sum(times):.0f} ms"))
        y += 54
    for index, (name, colour) in enumerate(zip(shown.values(), colours)):
        x = 170 + 130 * (index % 5)
        row = y + 6 + 24 * (index // 5)
        parts += [f'<rect x="{x}" y="{row}" width="14" height="14" fill="{colour}"/>', words(x + 20, row + 12, name)]
    file = OUT / "stages.svg"
    file.write_text(svg(840, y + 60, parts))
    return file


def pipeline():
    """What happens to a frame."""
    boxes = [(20, 60, 140, "colour, depth", "files, camera, bag", "#e8eef7"),
             (200, 60, 150, "features", "own thread", "#e8eef7"),
             (390, 60, 150, "initial pose", "last frame, then map", "#e8eef7"),
             (580, 60, 170, "motion of the scene", "static weights, free space", "#fbe3e0"),
             (790, 60, 150, "pose again", "without what moves", "#e8eef7"),
             (200, 200, 150, "network (optional)", "masks of this frame", "#fbe3e0"),
             (580, 200, 170, "dynamic mask", "PNG, TrackResult", "#fbe3e0"),
             (790, 200, 150, "keyframe", "points off the mask", "#e8eef7"),
             (390, 330, 150, "loops, relocalisation", "place, proof, pose graph", "#e7f3e7"),
             (580, 330, 170, "bundle adjustment", "twenty keyframes", "#e7f3e7"),
             (790, 330, 150, "semantic octree", "no people in it", "#e7f3e7")]
    parts = ['<defs><marker id="a" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
             'orient="auto"><path d="M0 0L10 5L0 10z" fill="#555"/></marker></defs>']
    for x, y, w, title, text, fill in boxes:
        parts += [f'<rect x="{x}" y="{y}" width="{w}" height="62" rx="6" fill="{fill}" stroke="#888"/>',
                  words(x + w / 2, y + 27, title, "middle", 14), words(x + w / 2, y + 47, text, "middle", 11, "#555")]
    for path in ("M160 91H198", "M350 91H388", "M540 91H578", "M750 91H788", "M665 122V198", "M865 122V198",
                 "M865 262V328", "M750 231H788", "M788 245H770V361H752", "M580 361H542", "M90 122V231H198",
                 "M350 231H578"):
        parts.append(f'<path d="{path}" fill="none" stroke="#555" stroke-width="1.5" marker-end="url(#a)"/>')
    parts += [words(20, 36, "a frame", size=15), words(20, 420, "Red: finds what moves. Blue: tracking. "
                                                      "Green: beside the tracker, joined at a fixed frame.", size=12)]
    file = OUT / "pipeline.svg"
    file.write_text(svg(960, 440, parts))
    return file


def troubleshooting():
    """Four ways in which a run goes wrong, on the synthetic office: needs no data."""
    office = WORK / "office"
    if not (office / "synth.json").exists():
        call("synth", office, "--path", "loop", "--scenario", "empty", "--frames", 560, "--seed", 1)
    camera = (office / "camera.txt").read_text()
    size = (360, 270)
    image = cv2.imread(str(colour_images(office)[0][1]))
    dark = (image * 0.04).astype(np.uint8)
    lost = labelled(dark, "lost at start: too dark, few corners", size)

    people = WORK / "people"
    if not (people / "synth.json").exists():
        call("synth", people, "--path", "xyz", "--frames", 60, "--seed", 2)
    stamp, file = colour_images(people)[30]
    covered = WORK / "covered"
    if not covered.exists():
        call("mask-faults", people, covered, "--fault", "cover")
    masked = labelled(with_mask(cv2.imread(str(file)), cv2.imread(str(covered / f"{stamp}.png"), 0)),
                      "all masked: the mask covers the view", size)

    # Half the depth units per metre: everything is twice as far.
    (WORK / "units.txt").write_text(camera.replace("depth_units_per_metre = 5000", "depth_units_per_metre = 2500"))
    (WORK / "focal.txt").write_text(camera.replace("fx = 535.4", "fx = 480").replace("fy = 539.2", "fy = 480"))
    truth = positions(office / "groundtruth.txt")
    wrong, g = aligned(positions(run("units", office, "geometric", "--camera", WORK / "units.txt") / "trajectory.txt"), truth)
    canvas = np.full((540, 720, 3), 255, np.uint8)
    both = np.vstack([wrong, g])[:, [0, 1]]
    low, scale = both.min(axis=0), 460 / np.ptp(both, axis=0).max()
    for points, colour in ((g, (150, 150, 150)), (wrong, (40, 40, 214))):
        xy = (60 + (points[:, [0, 1]] - low) * scale).round().astype(np.int32)
        cv2.polylines(canvas, [xy.reshape(-1, 1, 2)], False, colour, 4, cv2.LINE_AA)
    cv2.putText(canvas, "truth", (560, 60), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (150, 150, 150), 2, cv2.LINE_AA)
    cv2.putText(canvas, "estimate", (560, 100), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (40, 40, 214), 2, cv2.LINE_AA)
    scaled = labelled(canvas, "wrong scale: right shape, wrong size", size)

    doubled, _ = rendered_map(run("focal", office, "geometric", "--no-loops", "--camera", WORK / "focal.txt"))
    twice = labelled(doubled, "doubled map: desks and walls stand twice", size)
    return write("troubleshooting.jpg", sheet([[lost, masked], [scaled, twice]]))


def reliability():
    """Of what is said to move with a probability, how much does: rendered people on a floor, and a board."""
    example = pathlib.Path(os.environ.get("EXAMPLES", "build/release/examples")) / "example_12_reliability"
    if not example.exists():
        raise Absent(f"{example} is missing: DYNSLAM_BUILD_EXAMPLES=ON builds it")
    cells, said, moved = np.zeros(10), np.zeros(10), np.zeros(10)
    for scenario, path in (("crowd", "xyz"), ("walking", "xyz"), ("board", "halfsphere")):
        folder = WORK / f"{scenario}_{path}"
        if not (folder / "groundtruth.txt").exists():
            call("synth", folder, "--scenario", scenario, "--path", path, "--seed", 4, "--frames", 120)
        subprocess.run([example, folder, folder / "reliability"], check=True, stdout=subprocess.DEVNULL)
        n, p, m = np.genfromtxt(folder / "reliability.csv", delimiter=",", skip_header=1).T
        cells, said, moved = cells + n, said + n * p, moved + n * m
    left, top, side = 70, 20, 320
    at = lambda x, y: (left + side * x, top + side * (1 - y))
    parts = [f'<rect x="{left}" y="{top}" width="{side}" height="{side}" fill="none" stroke="#999"/>',
             f'<line x1="{left}" y1="{top + side}" x2="{left + side}" y2="{top}" stroke="#999" stroke-dasharray="4 4"/>']
    for k in range(10):
        if cells[k] == 0:
            continue
        x, y = at(said[k] / cells[k], moved[k] / cells[k])
        share = cells[k] / cells.sum()
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{5 if share >= 0.01 else 3}" '
                  f'fill="{"#1f4fd6" if share >= 0.01 else "#9db4ee"}"/>']
    for value in (0, 0.5, 1):
        parts += [words(*np.add(at(value, 0), (0, 18)), f"{value:g}", "middle"),
                  words(*np.add(at(0, value), (-8, 4)), f"{value:g}", "end")]
    parts += [words(left + side / 2, top + side + 40, "said to move with this probability", "middle"),
              words(left + side + 20, top + 20, "share of the cells that do"),
              '<circle cx="415" cy="70" r="5" fill="#1f4fd6"/>', words(428, 75, "1 % of the cells or more"),
              '<circle cx="415" cy="94" r="3" fill="#9db4ee"/>', words(428, 99, "fewer")]
    file = OUT / "reliability.svg"
    file.write_text(svg(620, top + side + 55, parts))
    return file


PICTURES = {f.__name__: f for f in (overview, masks, weights, maps, trajectory, stages, pipeline, troubleshooting,
                                    reliability)}


def main():
    parser = argparse.ArgumentParser(prog="figures.sh", description="Makes the pictures of docs/figures/")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"all without any: {', '.join(PICTURES)}")
    names = parser.parse_args().names or list(PICTURES)
    unknown = [name for name in names if name not in PICTURES]
    if unknown:
        parser.error(f"no picture '{unknown[0]}' (known: {', '.join(PICTURES)})")
    if not pathlib.Path(PROGRAM).exists():
        sys.exit(f"figures: {PROGRAM} is missing: scripts/demo.sh builds it")
    OUT.mkdir(parents=True, exist_ok=True)
    WORK.mkdir(parents=True, exist_ok=True)
    for name in names:
        try:
            file = PICTURES[name]()
            print(f"{file} {file.stat().st_size / 1000:.0f} kB")
        except Absent as reason:
            print(f"figures: without {name}: {reason}", file=sys.stderr)


if __name__ == "__main__":
    main()
