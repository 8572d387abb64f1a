#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes docs/results.md; scripts/results.sh says how."""
import argparse
import datetime
import json
import os
import pathlib
import platform
import re
import shutil
import statistics
import subprocess
import sys

import sequences as sq
import worth as parts
from sequences import call, median_of, text, worst_of

MODES = ["none", "semantic", "geometric", "both"]
CM = 2  # decimals of an error in centimetres


def table(header, rows):
    """Text left, numbers right."""
    left = sum(1 for name in header if name in ("sequence", "mode", "masks", "method", "camera", "images", "what"))
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * left + "---:|" * (len(header) - left)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def error(rows, key="trajectory"):
    """Median (worst) in centimetres."""
    if median_of(rows, key) is None:
        return "no pose"
    return f"{text(median_of(rows, key), CM)} ({text(worst_of(rows, key), CM)})"


def mask_numbers(rows):
    """Recall, IoU and spill, medians."""
    return [text(median_of(rows, "recall"), 2), text(median_of(rows, "iou"), 2),
            text(median_of(rows, "spill"), 2, 100) + " %"]


def tracked(rows):
    return f"{min(row.get('tracked') or 0 for row in rows)} of {rows[0].get('frames')}"


def measured(sequence, modes, seeds, **options):
    """Figures of each mode, by seed."""
    runs = sq.sweep(sequence, modes, seeds, **options)
    return {(variant, mode): [sq.figures(sequence, runs[variant, mode, seed]) for seed in seeds]
            for variant, mode, _ in runs}


RECORDED_SEEDS = [1, 2, 3, 4, 5]


def recorded():
    return [(sequence, measured(sequence, MODES, RECORDED_SEEDS)) for sequence in sq.recorded()]


def trajectories():
    """ATE RMSE [cm] after alignment (SE(3)), medians of seeds 1 to 5 and, in brackets, the worst of them. *Live*: each
    frame's pose as `track()` returned it at once (`trajectory_live.txt`); *final*: after the last frame
    (`trajectory.txt`). Tracked: the fewest frames of the five runs. `none` is a plain tracker: beside the masks it
    lacks what [backend.md](backend.md#what-the-modes-of-run-differ-in) lists. Network: yolo11n-seg, 416 x 320.

    dynslam run SEQ --dynamics MODE --seed N [--model yolo11n-seg.onnx]; dynslam eval RESULTS SEQ"""
    rows = []
    for sequence, by in recorded():
        for mode in MODES:
            found = by["", mode]
            rows.append([sequence.name, f"`{mode}`", error(found, "trajectory_live"), error(found), tracked(found)])
    return table(["sequence", "mode", "live", "final", "tracked"], rows)


def masks():
    """Recall and IoU of the masks of dynamic pixels, and *spill*: the share of a frame that is masked farther than 15 px
    beyond what moves, mean over the frames and worst frame. Medians of seeds 1 to 5. Of Bonn's people there is no
    truth: masks of yolo11n-seg at 640 x 480 stand for it, so `semantic` and `both` are measured against a relative of
    themselves, and IoU means nothing.

    dynslam run SEQ --dynamics MODE --save-masks; dynslam eval-masks RESULTS/masks TRUTH --moving --widen 15"""
    rows = []
    for sequence, by in recorded():
        for mode in MODES[1:]:
            found = by["", mode]
            rows.append([sequence.name, f"`{mode}`", *mask_numbers(found),
                         text(median_of(found, "spill_worst"), 1, 100) + " %"])
    return table(["sequence", "mode", "recall", "IoU", "spill", "worst frame"], rows)


def paper():
    """ATE RMSE [cm] of the paper's method alone, `--method paper`, beside dynslam's (`--method full`): medians of seeds 1
    to 3, the worst in brackets. Rolling shutters are modelled in both; *rows at once* is the paper's method with
    `--readout-time 0`, so without what it owes to that.

    dynslam run SEQ --dynamics MODE --method paper [--readout-time 0]"""
    rows = []
    for sequence in sq.recorded():
        if sequence.truth is None or sequence.people:
            continue
        variants = {"rows_at_once": {"method": "paper", "readout-time": 0}, "paper": {"method": "paper"},
                    "full": {"method": "full"}}
        by = measured(sequence, MODES, [1, 2, 3], variants=variants, group="paper")
        names = {"rows_at_once": "paper, rows at once", "paper": "paper", "full": "dynslam"}
        rows += [[sequence.name, names[v], *(error(by[v, mode]) for mode in MODES)] for v in variants]
    return table(["sequence", "method", *(f"`{mode}`" for mode in MODES)], rows)


def readout():
    """What `dynslam readout` says of a sequence's rows, without its ground truth; PrimeSense's cameras are given 24 ms.

    dynslam readout SEQ"""
    rows = []
    for sequence in sq.recorded():
        done = subprocess.run([sq.PROGRAM, "readout", str(sequence.path)], text=True, capture_output=True)
        lines = (done.stdout + done.stderr).strip().splitlines()
        said = next((line for line in lines if "readout" in line), lines[-1] if lines else "")
        rows.append([sequence.name, said.replace("|", "/").replace(str(sequence.path), "SEQ").replace("dynslam: ", "")])
    return table(["sequence", "what"], rows)


def readout_times():
    """ATE RMSE [cm], `geometric`, with other readout times than the camera's; median of seeds 1 to 3 (worst).

    dynslam run SEQ --dynamics geometric --readout-time S"""
    times = [0, 0.016, 0.024, 0.032]
    rows = []
    for sequence in sq.recorded():
        if sequence.key not in (sq.RECORDED[0][0], sq.RECORDED[1][0], sq.RECORDED[4][0]):
            continue
        variants = {f"ms{int(1000 * t)}": {"readout-time": t} for t in times}
        by = measured(sequence, ["geometric"], [1, 2, 3], variants=variants, group="readout")
        rows.append([sequence.name, *(error(by[v, "geometric"]) for v in variants)])
    return table(["sequence", *(f"{int(1000 * t)} ms" for t in times)], rows)


def composed():
    """A board of no class, or two people, composed into the static fr1_rpy, 500 to 649 (the truth stays valid): ATE RMSE
    [cm], median of seeds 1 to 3 (worst), and the masks' recall, IoU and spill of the median.

    dynslam run SEQ --dynamics MODE --save-masks"""
    base = sq.RECORDED[1][0]
    rows = []
    for sequence in sq.composed("board", base, range(1, 6), "board") + sq.composed("p1,p2", base, range(1, 6), "people"):
        by = measured(sequence, ["geometric", "both"], [1, 2, 3])
        for mode in ("geometric", "both"):
            found = by["", mode]
            rows.append([sequence.name, f"`{mode}`", error(found), tracked(found), *mask_numbers(found)])
    return table(["sequence", "mode", "ATE", "tracked", "recall", "IoU", "spill"], rows)


def rendered_runs():
    """Name and runs, by variant and mode, of each rendered scenario's three scenes."""
    for scenario, path in (("crowd", "xyz"), ("walking", "xyz"), ("walking", "halfsphere"), ("sitting", "halfsphere"),
                           ("board", "xyz")):
        scenes = [sq.rendered(f"{scenario} {path} {n}", "--path", path, "--scenario", scenario, "--seed", n, "--frames",
                              90) for n in (1, 2, 3)]
        yield f"{scenario}, {path}", [measured(scene, MODES, [1]) for scene in scenes]


def rendered():
    """The synthetic office with its demo's network, 90 frames at 30 Hz, three scenes each: ATE RMSE [cm], median and, in
    brackets, worst of the scenes.

    dynslam synth SEQ --path PATH --scenario SCENARIO --seed N --frames 90; dynslam run SEQ --dynamics MODE"""
    return table(["sequence", *(f"`{mode}`" for mode in MODES)],
                 [[name, *(error([f["", mode][0] for f in found]) for mode in MODES)] for name, found in rendered_runs()])


def rendered_masks():
    """Masks of the same runs against the renderer's truth, everything that ever moves, also while it stands still: recall,
    IoU and spill as above, medians of the scenes, and the worst frame of all. Who sits does not move at all. The demo's network
    was trained on other scenarios, and calls furniture of the crowd's room people.

    dynslam eval-masks RESULTS/masks SEQ/dynamic_mask --moving --widen 15"""
    rows = []
    for name, found in rendered_runs():
        moves = not name.startswith("sitting")
        for mode in MODES[1:]:
            of = [f["", mode][0] for f in found]
            share = [text(median_of(of, key), 2) if moves else "" for key in ("recall", "iou")]
            rows.append([name, f"`{mode}`", *share,
                         text(median_of(of, "spill"), 2, 100) + " %", text(sq.worst_of(of, "spill_worst"), 1, 100) + " %"])
    return table(["sequence", "mode", "recall", "IoU", "spill", "worst frame"], rows)


def worth():
    """The whole method with one part left out, on every sequence at hand (recorded, composed, rendered; none of the last
    two was tuned on), seeds 1 to 3: geometric mean over the sequences of the ATE through the whole method's, each ratio
    within 0.5 and 2, median of the seeds and each of them (first line: the spread between seeds), frames lost, and means of
    the masks' recall, IoU and spill [% of a frame].

    scripts/worth.sh --modes geometric"""
    return parts.table(parts.sequences(), list(parts.PARTS), [1, 2, 3], ["geometric"])


def demo():
    """What `scripts/demo.sh` runs: ATE RMSE [cm] of each mode, the paper's method and dynslam's, and the IoU of the masks
    of what moves.

    scripts/demo.sh"""
    sequence = sq.rendered("demo", "--path", "xyz", "--seed", 2)
    variants = {"paper": {"method": "paper"}, "full": {"method": "full"}}
    by = measured(sequence, MODES, [0], variants=variants, group="demo")
    names = {"paper": "paper", "full": "dynslam"}
    return table(["method", "mode", "ATE", "tracked", "recall", "IoU", "spill"],
                 [[names[v], f"`{mode}`", text(by[v, mode][0].get("trajectory"), CM), tracked(by[v, mode]),
                   *([text(by[v, mode][0].get("recall"), 2), text(by[v, mode][0].get("iou"), 2),
                      text(by[v, mode][0].get("spill"), 2, 100) + " %"] if mode != "none" else ["", "", ""])]
                  for v in variants for mode in MODES])


def loops():
    """Once round the synthetic office, 600 frames, two scenes: ATE RMSE [cm] with loops closed and without; median and
    worst of the scenes.

    dynslam synth SEQ --path loop --frames 600 --seed N; dynslam run SEQ --dynamics MODE [--loops false]"""
    found = {}
    for n in (1, 2):
        sequence = sq.rendered(f"loop {n}", "--path", "loop", "--seed", n, "--frames", 600)
        by = measured(sequence, ["none", "geometric"], [1], group="loops",
                      variants={"with": {"loops": True}, "without": {"loops": False}})
        for key, value in by.items():
            found.setdefault(key, []).append(value[0])
    return table(["mode", "loops closed", "not closed"],
                 [[f"`{mode}`", error(found["with", mode]), error(found["without", mode])] for mode in ("none", "geometric")])


def rates():
    """Recorded sequences scaled and thinned by `dynslam convert`: ATE RMSE [cm], `none` / `geometric`, seed 1.

    dynslam convert SEQ NEW --size SIZE --every N; dynslam run NEW --dynamics MODE"""
    kept = [s for s in sq.recorded() if s.key in (sq.RECORDED[0][0], sq.RECORDED[1][0], sq.RECORDED[5][0])]
    rows = []
    for label, options in (("as recorded, 30 Hz", []), ("10 Hz", ["--every", 3]), ("5 Hz", ["--every", 6]),
                           ("320x240", ["--size", "320x240"]), ("540x405", ["--size", "540x405"]),
                           ("848x480", ["--size", "848x480"])):
        cells = [label]
        for sequence in kept:
            one = sequence
            if options:
                key = f"{sequence.key}_{label.replace(' ', '')}"
                folder = sq.WORK / "converted" / key
                if not (folder / "associations.txt").exists():
                    call([sq.PROGRAM, "convert", sequence.path, folder, *options])
                one = sq.Sequence(sequence.name, folder, still=True)
            by = measured(one, ["none", "geometric"], [1], group="rates")
            cells.append(" / ".join(text(median_of(by["", mode], "trajectory"), CM) for mode in ("none", "geometric")))
        rows.append(cells)
    return table(["images", *(s.name for s in kept)], rows)


def faults():
    """What wrong masks cost: `both` with ten kinds of wrong masks in all frames (`dynslam mask-faults`), fr1_xyz with two
    people, beside `none` and `geometric`, which use none of them: ATE RMSE [cm], median of seeds 1 to 3 (worst), and
    recall, IoU and spill of the masks of what moves, medians.

    dynslam mask-faults SEQ DIR --fault KIND; dynslam run SEQ --dynamics both --masks DIR --save-masks"""
    kinds = ["object-always", "object-third", "object-first-half", "object-second-half", "cover", "mirrored", "late",
             "shifted", "empty", "blobs"]
    sequence = next((s for s in sq.recorded() if s.key == sq.RECORDED[5][0]), None)
    if sequence is None:
        return []
    variants = {}
    for kind in kinds:
        variants[kind] = {"masks": sq.WORK / "faults" / sequence.key / kind}
        if not variants[kind]["masks"].exists():
            call([sq.PROGRAM, "mask-faults", sequence.path, variants[kind]["masks"], "--fault", kind])
    usual = measured(sequence, ["none", "geometric"], [1, 2, 3])
    wrong = measured(sequence, ["both"], [1, 2, 3], variants=variants, group="faults-runs")
    rows = [["`none`", error(usual["", "none"]), "", "", ""]]
    for name, found in [("`geometric`", usual["", "geometric"]), *((kind, wrong[kind, "both"]) for kind in kinds)]:
        rows.append([name, error(found), *mask_numbers(found)])
    return table(["masks", "ATE", "recall", "IoU", "spill"], rows)


def networks():
    """A network on every frame, and ten times a second (`--segment-every auto`), fr1_xyz with two people: medians of seeds
    1 to 3.

    dynslam run SEQ --dynamics both --model yolo11n-seg.onnx --segment-every N"""
    sequence = next((s for s in sq.recorded() if s.key == sq.RECORDED[5][0]), None)
    if sequence is None:
        return []
    variants = {"every": {"segment-every": "1"}, "auto": {"segment-every": "auto"}}
    by = measured(sequence, ["both"], [1, 2, 3], variants=variants, group="networks")
    names = {"every": "every frame", "auto": "`auto`, every third at 30 Hz"}
    return table(["masks", "ATE [cm]", "recall", "IoU"],
                 [[names[v], error(by[v, "both"]), text(median_of(by[v, "both"], "recall"), 2),
                   text(median_of(by[v, "both"], "iou"), 2)] for v in variants])


def guests():
    """OpenCV's RGB-D odometry, frame to frame, alone and with what moves masked out: by `MotionSegmenter` inside
    (examples/06_rgbd_odometry.cpp), which locates itself or is given the odometry's own pose, by the mask files of
    `dynslam run`, and by true masks where there are any. ATE RMSE [cm]; it drifts by about a centimetre a frame, so that
    what differs by a few pixels differs by centimetres in the end.

    example_06_rgbd_odometry SEQ [--masks FOLDER...]"""
    example = pathlib.Path(os.environ.get("EXAMPLES", sq.ROOT / "build/release/examples")) / "example_06_rgbd_odometry"
    if not example.exists():
        sq.fail(f"{example} is missing (DYNSLAM_BUILD_EXAMPLES=ON builds it)")
    chosen = [s for s in sq.recorded() if s.truth and not s.people]
    chosen += sq.composed("board", sq.RECORDED[1][0], range(1, 4), "board")
    chosen += [sq.rendered("walking xyz 2", "--path", "xyz", "--scenario", "walking", "--seed", 2, "--frames", 90)]
    rows = []
    for sequence in chosen:
        runs = sq.sweep(sequence, ["geometric", "both"], [1])
        folders = [runs["", mode, 1] / "masks" for mode in ("geometric", "both")] + [sequence.truth]
        errors = [re.findall(r"([0-9.]+) cm", call([example, sequence.path, *options]))
                  for options in ([], ["--masks", *folders])]
        rows.append([sequence.name, *errors[0], *errors[1][1:]])
    return table(["sequence", "alone", "`MotionSegmenter`, located", "its host's pose", "`geometric`", "`both`", "true masks"], rows)


def open3d():
    """Open3D's RGB-D odometry, frame to frame (0.16, hybrid term), alone, with what moves masked out by `dynslam masks`, and
    by true masks. ATE RMSE [cm].

    examples/python/open3d_odometry.py SEQ [--masks MASKS]"""
    if subprocess.run(["/usr/bin/python3", "-c", "import open3d"], capture_output=True).returncode:
        print("results: without Open3D: python3-open3d is missing", file=sys.stderr)
        return []
    chosen = [s for s in sq.recorded() if s.truth and not s.people]
    chosen += sq.composed("board", sq.RECORDED[1][0], [1], "board")
    rows = []
    for sequence in chosen:
        work = sq.WORK / "open3d" / sequence.key
        if not (work / "sequence").exists():
            call([sq.PROGRAM, "convert", sequence.path, work / "sequence"])
        call([sq.PROGRAM, "masks", work / "sequence", "--out", work / "masks"])
        errors = []
        for masks in (None, work / "masks", sequence.truth):
            out = work / "trajectory.txt"
            call(["/usr/bin/python3", sq.ROOT / "examples/python/open3d_odometry.py", work / "sequence", "--out", out,
                  *(["--masks", masks] if masks else [])])
            errors.append(json.loads(call([sq.PROGRAM, "eval", out, sequence.path, "--json"]))["ate_m"]["rmse"])
        rows.append([sequence.name, *(f"{100 * e:.2f}" for e in errors)])
    return table(["sequence", "alone", "`dynslam masks`", "true masks"], rows)


def speed():
    """Frames per second of whole runs with mapping on this machine (2 cores, shared with others), and what tracking takes
    a frame [ms]; medians of three runs.

    dynslam run SEQ --dynamics MODE"""
    sequence = next((s for s in sq.recorded() if s.key == sq.RECORDED[0][0]), None)
    if sequence is None:
        return []
    rows = []
    for mode in ("none", "geometric"):
        found = []
        for n in (1, 2, 3):
            out = sq.WORK / "speed" / mode / str(n)
            shutil.rmtree(out, ignore_errors=True)
            call([sq.PROGRAM, "run", sequence.path, "--dynamics", mode, "--seed", n, "--out", out])
            summary = json.loads((out / "summary.json").read_text())
            stage = summary["stages"]["tracking"]
            found.append((summary["fps"], stage["median_ms"], stage["p95_ms"]))
        rows.append([sequence.name, f"`{mode}`",
                     *(f"{statistics.median(column):.{d}f}" for column, d in zip(zip(*found), (0, 1, 1)))])
    return table(["sequence", "mode", "frames/s", "tracking, median", "tracking, p95"], rows)


def live():
    """A recording played at its pace, 30 Hz (`--live`), `geometric` with mapping on this machine: frames dropped because
    they came too late, and what the others waited for their pose [ms].

    dynslam run SEQ --live --dynamics geometric"""
    sequence = next((s for s in sq.recorded() if s.key == sq.RECORDED[0][0]), None)
    if sequence is None:
        return []
    out = sq.WORK / "live"
    call([sq.PROGRAM, "run", sequence.path, "--live", "--dynamics", "geometric", "--out", out])
    said = json.loads((out / "summary.json").read_text())["live"]
    frames = json.loads((out / "summary.json").read_text())["frames"] + said["dropped"]
    return table(["sequence", "dropped", "latency, median", "95 %", "most"],
                 [[sequence.name, f"{said['dropped']} of {frames}",
                   *(f"{said['latency'][key]:.0f}" for key in ("median_ms", "p95_ms", "max_ms"))]])


def compiling():
    """What a file that uses a part of the core costs the compiler, g++ -O2, in seconds of one core of this machine and in
    megabytes of memory: the headers alone; used; used and linked with `dynslam::core_instances`.

    g++ -std=c++20 -O2 -c [-D DYNSLAM_CORE_INSTANCES] FILE"""
    compiler = ["g++", "-std=c++20", "-O2", "-c", "-I", sq.ROOT / "include", "-isystem", "/usr/include/eigen3", "-o", "/dev/null"]
    files = {"`MotionSegmenter`": "tests/consumer/instances.cpp", "`static_weights`": "bench/support/compile_static_weights.cpp"}
    rows = []
    for name, file in files.items():
        used = (sq.ROOT / file).read_text(encoding="utf-8")
        headers = used[:used.index("int main")]
        cells = []
        for source, options in ((headers, []), (used, []), (used, ["-D", "DYNSLAM_CORE_INSTANCES"])):
            path = sq.WORK / "compiled.cpp"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(source, encoding="utf-8")
            _, status, cost = os.wait4(subprocess.Popen([*map(str, compiler), *options, str(path)]).pid, 0)
            if status != 0:
                sq.fail(f"{path} does not compile")
            cells.append(f"{cost.ru_utime:.1f} s, {cost.ru_maxrss // 1024} MB")
        rows.append([name, *cells])
    return table(["what", "headers", "used", "with the library"], rows)


SECTIONS = {"Trajectories": trajectories, "Masks": masks, "The paper's method": paper, "Composed sequences": composed,
            "Rendered sequences": rendered, "Masks of rendered sequences": rendered_masks,
            "What each part is worth": worth, "The demo": demo, "Loops": loops, "Readout measured": readout,
            "Readout times": readout_times, "Sizes and rates": rates, "Wrong masks": faults, "Networks": networks,
            "Guests": guests, "Open3D": open3d, "Speed": speed, "Live": live, "Compiling": compiling}

HEAD = """# Results

Written by `scripts/results.sh`; every other page quotes this one. Each table says the command behind it, the program's
commit, the day and the machine. Recorded sequences are excerpts of TUM RGB-D (Sturm et al. 2012) and Bonn RGB-D Dynamic
(Palazzolo et al. 2019); a row stands here as long as its sequence is at hand. Kernels: [benchmarks.md](benchmarks.md).

"""


def key_of(title):
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def machine():
    cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo", encoding="utf-8")
                if line.startswith("model name")), platform.machine())
    return f"{cpu}, {os.cpu_count()} cores"


def section(title, function):
    lines = function()
    if not lines:
        return None
    said, command = function.__doc__.rsplit("\n\n", 1)
    said = "\n".join(line.strip() for line in said.splitlines())
    return "\n".join([f"## {title}", "", said, "", f"    {command.strip()}", "", *lines, "",
                      f"`scripts/results.sh {key_of(title)}`, commit {sq.commit()}, {datetime.date.today()}, {machine()}.", ""])


def main():
    parser = argparse.ArgumentParser(prog="results.sh", description="Writes docs/results.md")
    parser.add_argument("tables", nargs="*", help=f"all without any: {', '.join(map(key_of, SECTIONS))}")
    parser.add_argument("--page", default=str(sq.ROOT / "docs/results.md"), help="file to write (docs/results.md)")
    arguments = parser.parse_args()
    known = {key_of(title): title for title in SECTIONS}
    unknown = [name for name in arguments.tables if name not in known]
    if unknown:
        parser.error(f"no table '{unknown[0]}'")
    if not pathlib.Path(sq.PROGRAM).exists():
        sq.fail(f"{sq.PROGRAM} is missing: scripts/demo.sh builds it")
    page = pathlib.Path(arguments.page)
    old = {}
    if page.exists():
        for part in re.split(r"(?m)^(?=## )", page.read_text(encoding="utf-8"))[1:]:
            old[part.splitlines()[0][3:]] = part.rstrip("\n") + "\n"
    for name in arguments.tables or known:
        print(f"results: {name}", file=sys.stderr, flush=True)
        made = section(known[name], SECTIONS[known[name]])
        if made:
            old[known[name]] = made
    page.write_text(HEAD + "\n".join(old[title] for title in SECTIONS if title in old), encoding="utf-8")
    print(page)


if __name__ == "__main__":
    main()
