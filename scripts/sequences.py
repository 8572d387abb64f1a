#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The sequences that results.sh and worth.sh measure, and what a run of one comes to.

Runs are made by `dynslam sweep`, so what is done is not done again as long as program, commit and options are the same.
"""
import json
import os
import pathlib
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("DYNSLAM", str(ROOT / "build/release/bin/dynslam"))
DATA = pathlib.Path(os.environ["DYNSLAM_DATA"]).resolve() if os.environ.get("DYNSLAM_DATA") else None
WORK = pathlib.Path(os.environ.get("WORK", ROOT / "results/tables")).resolve()
JOBS = os.environ.get("JOBS", "1")
# What a mask may reach beyond the truth before it counts as spill: the rim of a silhouette is not known better.
WIDEN_PX = 15


class Sequence:
    """name: of the tables' rows. truth: a folder of true masks, or None where nothing moves (or nothing is known).
    people: truth is a network's masks, so that recall and spill mean people, IoU nothing.
    truth_labels: what the values of the true masks mean, where they do not say so themselves."""

    def __init__(self, name, path, truth=None, still=False, people=False, model=None):
        self.name, self.path, self.truth, self.still = name, pathlib.Path(path), truth, still
        self.people, self.model = people, model
        self.truth_labels = None

    @property
    def key(self):
        return self.path.name if self.path.name != "sequence" else self.path.parent.name


def fail(text):
    print(f"results: {text}", file=sys.stderr)
    sys.exit(1)


def call(command, **options):
    return subprocess.run([str(part) for part in command], check=True, text=True, capture_output=True, **options).stdout


def commit():
    """The commit at hand, and whether sources differ from it."""
    changed = call(["git", "status", "--porcelain", "--", "include", "runtime", "tools", "CMakeLists.txt", "cmake"], cwd=ROOT).strip()
    return call(["git", "rev-parse", "--short=8", "HEAD"], cwd=ROOT).strip() + (" with changes" if changed else "")


def network(small=True):
    """The network of the recorded sequences."""
    return DATA / "models" / f"yolo11n-seg_{'416x320' if small else '640x480'}_full.onnx" if DATA else None


BONN = '"bonn": (542.822841, 542.576870, 315.593520, 237.756098, [0.039903, -0.099343, -0.00073, -0.000144, 0])'

# Folder below DYNSLAM_DATA/tum, name in tables, what is true of it.
RECORDED = [
    ("rgbd_dataset_freiburg1_xyz_first200", "fr1_xyz, first 200", "still"),
    ("rgbd_dataset_freiburg1_rpy_500_649", "fr1_rpy, 500 to 649", "still"),
    ("fr1_rpy_215_249", "fr1_rpy, 215 to 249", "still"),
    ("fr3_teddy_first12", "fr3_teddy, first 12", "still"),
    ("rgbd_dataset_freiburg3_walking_halfsphere_first50", "fr3_walking_halfsphere, first 50", "person_masks"),
    ("fr1_xyz_people_200", "fr1_xyz with two people, 200", "dynamic_mask"),
    ("rgbd_bonn_crowd_380_479", "Bonn crowd, 380 to 479", "people"),
]


def recorded():
    """Those that DYNSLAM_DATA has."""
    found = []
    for folder, name, kind in RECORDED:
        path = DATA / "tum" / folder if DATA else pathlib.Path("/nonexistent")
        if not (path / "rgb.txt").exists():
            print(f"results: without {name}: DYNSLAM_DATA names no folder that has it", file=sys.stderr)
            continue
        sequence = Sequence(name, path, still=kind == "still", people=kind == "people", model=network())
        if kind == "dynamic_mask":
            sequence.truth = path / "dynamic_mask"
        elif kind == "person_masks":
            sequence.truth, sequence.truth_labels = DATA / "compose/person_masks", "instances"
        elif kind == "people":
            sequence.truth = people_of(sequence)
        found.append(sequence)
    return found


def people_of(sequence):
    """Masks of the people by a larger network than the runs use."""
    out = WORK / "people" / sequence.key
    if not (out / "summary.json").exists():
        call([PROGRAM, "run", sequence.path, "--out", out, "--dynamics", "semantic", "--model", network(False),
              "--save-masks", "--map", "false"])
    return out / "masks"


def composed(actors, base, seeds, prefix, camera="fr1"):
    """Boards (one large textured thing of no class) and people composed into a static sequence; [] where the tool or
    what it needs is missing."""
    tool = DATA / "compose/compose.py" if DATA else None
    if tool is None or not tool.exists():
        return []
    if subprocess.run(["/usr/bin/python3", "-c", "import numpy, cv2"], capture_output=True).returncode:
        print("results: without composed sequences: python3-opencv and python3-numpy are missing", file=sys.stderr)
        return []
    environment = dict(os.environ, WALKING50=str(DATA / "tum" / RECORDED[4][0]),
                       WALKING50_MASKS=str(DATA / "compose/person_masks"))
    found = []
    for seed in seeds:
        # The camera is chosen by the folder's name.
        name = f"{prefix.replace(' ', '_')}_{seed}"
        folder = WORK / "composed" / (f"rgbd_bonn_{name}" if camera == "bonn" else f"{camera}_{name}")
        if not (folder / "groundtruth.txt").exists():
            # The tool knows the cameras of TUM.
            script = f"text = open({str(tool)!r}).read(); exec(text.replace('CAM = {{', 'CAM = {{{BONN}, ', 1))"
            call(["/usr/bin/python3", "-c", script, DATA / "tum" / base, folder, "--actors", actors, "--seed", seed,
                  "--camera", camera, "--scale", "0.45", "--near", "0.52", "--far", "0.64", "--jpeg"], env=environment)
        found.append(Sequence(f"{prefix} {seed}", folder, truth=folder / "dynamic_mask", model=network()))
    return found


def rendered(name, *arguments):
    """A sequence of the synthetic office."""
    folder = WORK / "rendered" / name.replace(" ", "_").replace(",", "") / "sequence"
    if not (folder / "synth.json").exists():
        call([PROGRAM, "synth", folder, *arguments])
    return Sequence(name, folder, truth=folder / "dynamic_mask", model=ROOT / "models/demo_segmenter.onnx")


def config(name, text=""):
    """A configuration file that saves masks and sets what text says. @return its path"""
    file = WORK / "configs" / f"{name}.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    content = f"[general]\nsave_masks = true\n{text}"
    if not file.exists() or file.read_text() != content:
        file.write_text(content)
    return file


def quoted(value):
    return json.dumps(str(value)) if not isinstance(value, bool) else str(value).lower()


def sweep(sequence, modes, seeds, options=None, variants=None, group="runs"):
    """Runs modes x seeds (x variants: name -> options) of a sequence. @return folder of a run by (variant, mode, seed)"""
    folder = WORK / group / sequence.key
    folder.mkdir(parents=True, exist_ok=True)
    common = {"map": False, "config": config("masks"), **(options or {})}
    given = any("masks" in own for own in (variants or {}).values())
    if sequence.model and not given and any(mode in ("semantic", "both") for mode in modes):
        common["model"] = sequence.model
        common["cache-masks"] = WORK / "networks" / sequence.key
    lines = [f"sequences = [{quoted(sequence.path)}]", f"modes = [{', '.join(map(quoted, modes))}]",
             f"seeds = [{', '.join(map(str, seeds))}]", f"out = {quoted(folder)}", "[options]"]
    lines += [f"{key} = {quoted(value)}" for key, value in common.items()]
    for name, own in (variants or {}).items():
        lines += [f"[variants.{name}]"] + [f"{key} = {quoted(value)}" for key, value in own.items()]
    file = folder / "sweep.toml"
    file.write_text("\n".join(lines) + "\n")
    done = subprocess.run([PROGRAM, "sweep", file, "--jobs", JOBS], text=True, capture_output=True)
    if not (folder / "sweep.json").exists():
        fail(f"{file}: {done.stderr.strip()}")
    runs = {}
    for variant in variants or {"": {}}:
        for mode in modes:
            for seed in seeds:
                runs[variant, mode, seed] = job_folder(folder, sequence, variant, mode, seed)
    return runs


def job_folder(folder, sequence, variant, mode, seed):
    parts = [sequence.key if sequence.path.name != "sequence" else "sequence", variant, mode, f"seed-{seed}"]
    candidates = [folder.joinpath(*[p for p in parts if p])]
    candidates += [folder.joinpath(*[p for p in parts[1:] if p])]
    for candidate in candidates:
        if (candidate / "job.json").exists():
            return candidate
    fail(f"no run {candidates[0]}")


def figures(sequence, folder):
    """ATE [cm], as tracked at once and in the end, frames tracked, and what the masks are like, of one run."""
    cache = folder / "figures.json"
    if cache.exists() and cache.stat().st_mtime > (folder / "job.json").stat().st_mtime:
        return json.loads(cache.read_text())
    result = {}
    summary = folder / "summary.json"
    if summary.exists():
        facts = json.loads(summary.read_text())
        result.update({key: facts.get(key) for key in ("frames", "tracked", "fps")})
    for name in ("trajectory", "trajectory_live"):
        file = folder / f"{name}.txt"
        if file.exists():
            done = subprocess.run([PROGRAM, "eval", file, sequence.path, "--json"], text=True, capture_output=True)
            if done.returncode == 0:
                result[name] = 100 * json.loads(done.stdout)["ate_m"]["rmse"]
    masks = folder / "masks"
    if masks.is_dir():
        command = [PROGRAM, "eval-masks", masks, "--moving"]
        if not sequence.still and sequence.truth:
            command += [sequence.truth, "--widen", WIDEN_PX]
            if sequence.truth_labels:
                command += ["--truth-labels", sequence.truth_labels]
        done = subprocess.run([str(c) for c in command] + ["--json"], text=True, capture_output=True)
        if done.returncode == 0:
            found = json.loads(done.stdout)
            spill = found if sequence.still else found.get("spill", {})
            result.update(recall=found.get("recall"), iou=None if sequence.people else found.get("iou"),
                          spill=spill.get("mean"), spill_worst=spill.get("worst"))
    cache.write_text(json.dumps(result))
    return result


def median_of(rows, key):
    values = [row[key] for row in rows if row.get(key) is not None]
    return statistics.median_low(values) if values else None


def worst_of(rows, key):
    values = [row[key] for row in rows if row.get(key) is not None]
    return max(values) if values else None


def text(value, decimals, factor=1.0):
    return "" if value is None else f"{factor * value:.{decimals}f}"
