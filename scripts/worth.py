#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What each part of the method is worth; scripts/worth.sh says how."""
import argparse
import math
import statistics
import sys

import sequences as sq

# Name of a part -> what of the configuration leaves it out.
PARTS = {
    "keypoints": "[tracker.geometry.belief.surfaces]\nkeypoints = 1000000\n",
    "outlines": "[tracker.geometry.belief.surfaces]\noutline = 1000000\n",
    "pooling": "[tracker.geometry.belief.pooling]\ncoupling = 0.0\n",
    "background_motion": "[tracker.search]\nyoung_frames = 0\n",
    "unmeasured_pixels": "[tracker.geometry.unmeasured]\nreach = 0.0\n",
    "margin": "[tracker.geometry]\nmargin = 0.0\n",
    "revise": "[tracker.search]\nrevise = false\n",
    "smoothing": "[trajectory]\nsmooth = false\n",
    "rest_lag": "[tracker.geometry.belief.free_space]\nrest_lag = 10\n",
    "memory": "[tracker.geometry.belief.free_space]\nmemory = 0.001\n",
    "surface_weights": "[tracker.search]\nsurface_weights = false\n",
    "motion_prior": "[tracker.search]\nprior_share = 0.0\n",
    "strict_local_map": "[tracker.search]\nstrict_local_map = false\n",
    "aligned_starts": "[tracker.search]\naligned_starts = false\n",
}


def sequences():
    """Recorded, composed (seeds that nothing was tuned on) and rendered ones."""
    found = sq.recorded()
    rpy, xyz, bonn = (sq.RECORDED[k][0] for k in (1, 0, 6))
    found += sq.composed("board", rpy, (51, 52), "rpy board") + sq.composed("p1,p2", rpy, (51, 52), "rpy people")
    found += sq.composed("board", xyz, (53,), "xyz board") + sq.composed("p1,p2", xyz, (53,), "xyz people")
    for sequence in sq.composed("board", bonn, (54,), "crowd board", camera="bonn"):
        sequence.truth = None  # of the board alone, and people walk there, too
        found.append(sequence)
    for scenario, path in (("crowd", "xyz"), ("walking", "xyz"), ("sitting", "halfsphere"), ("board", "halfsphere"), ("empty", "rpy")):
        found.append(sq.rendered(f"{scenario} {path} 4", "--path", path, "--scenario", scenario, "--seed", 4,
                                 "--frames", 120))
    return found


def geometric_mean(values):
    return math.exp(statistics.fmean(math.log(max(value, 1e-3)) for value in values))


def ratios(of, base, seeds):
    """Geometric mean over the sequences of ATE through the median seed's of the whole method, by seed. A sequence counts
    as twice as good or bad at most: one that fails by metres, or is saved, is one of many."""
    usual = [statistics.median(ates) if (ates := [run["trajectory"] for run in one if run.get("trajectory")]) else None
             for one in base]
    result = []
    for k in range(len(seeds)):
        pairs = [(one[k].get("trajectory"), ate) for one, ate in zip(of, usual)]
        result.append(geometric_mean([min(max(a / b, 0.5), 2.0) for a, b in pairs if a and b]))
    return result


def mean_of(runs, key):
    values = [run[key] for one in runs for run in one if run.get(key) is not None]
    return statistics.fmean(values) if values else None


def spread(base, seeds):
    """By how much the seeds of the whole method differ (S.D., as a ratio)."""
    means = ratios(base, base, seeds)
    return statistics.stdev(means) if len(means) > 1 else 0.0


def table(chosen, parts, seeds, modes):
    """One line per part left out: ratios() of its ATE, the median of the seeds and each of them (of the whole method: the
    spread), frames lost, and what the masks are like."""
    # Fields of the configuration that are set to nothing else than what leaves the part out.
    variants = {"whole": {"config": sq.config("masks")},
                **{part: {"config": sq.config(part, PARTS[part])} for part in parts}}
    found = {}
    for sequence in chosen:
        print(f"worth: {sequence.name}", file=sys.stderr, flush=True)
        runs = sq.sweep(sequence, modes, seeds, variants=variants, group="worth")
        for variant in variants:
            for mode in modes:
                found.setdefault((variant, mode), []).append(
                    [sq.figures(sequence, runs[variant, mode, seed]) for seed in seeds])
    lines = ["| left out | mode | ATE, ratio | seeds | lost frames | recall | IoU | spill | worst frame |",
             "|---|---|---:|---:|---:|---:|---:|---:|---:|"]
    for mode in modes:
        base = found["whole", mode]
        for variant in variants:
            of = found[variant, mode]
            lost = sum((run.get("frames") or 0) - (run.get("tracked") or 0) for one in of for run in one)
            by_seed = ratios(of, base, seeds)
            numbers = [sq.text(mean_of(of, key), 3, factor) for key, factor in
                       (("recall", 1), ("iou", 1), ("spill", 100), ("spill_worst", 100))]
            lines.append("| " + " | ".join([
                "nothing" if variant == "whole" else variant, f"`{mode}`", f"{statistics.median(by_seed):.3f}",
                f"± {spread(base, seeds):.3f}" if variant == "whole" else " ".join(f"{r:.3f}" for r in by_seed),
                str(lost), *numbers]) + " |")
    return lines


def main():
    parser = argparse.ArgumentParser(prog="worth.sh", description="What each part of the method is worth")
    parser.add_argument("parts", nargs="*", help=f"all without any: {', '.join(PARTS)}")
    parser.add_argument("--only", default="", help="sequences whose name contains this")
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--modes", default="geometric,both")
    arguments = parser.parse_args()
    for name in arguments.parts:
        if name not in PARTS:
            parser.error(f"no part '{name}'")
    chosen = [s for s in sequences() if arguments.only in s.name]
    if not chosen:
        parser.error(f"no sequence's name contains '{arguments.only}'")
    lines = table(chosen, arguments.parts or list(PARTS), [int(seed) for seed in arguments.seeds.split(",")],
                  arguments.modes.split(","))
    page = sq.WORK / "worth.md"
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))
    print(page, file=sys.stderr)


if __name__ == "__main__":
    main()
