#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""bench-table.py [--keep TABLE.MD] BUILD.TXT RUN.JSON... > docs/benchmarks.md

Makes a table of ratios from runs of Google Benchmark. A case is named family/case/scalar/who; whoever has all but the
last part in common is compared with `dynslam`, by the CPU time of the medians. `dynslam_...` are further ways of ours,
among which a loss is none.

--keep TABLE.MD  the rows of an earlier table stay where none of the runs has a case of their family; only if it was
                 made on the same processor, by the same compiler and with the same libraries
"""
import argparse
import json
import os
import platform
import re
import sys

OURS = "dynslam"


def time_text(ns):
    for unit, size in (("s", 1e9), ("ms", 1e6), ("us", 1e3)):
        if ns >= size:
            return f"{ns / size:.3g} {unit}"
    return f"{ns:.3g} ns"


def cpu_name():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as f:
            for line in f:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.machine()


def read_runs(paths):
    """name -> benchmark as JSON, with its time in ns; the context of the last file."""
    runs, context = {}, {}
    factor = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}
    for path in paths:
        with open(path, encoding="utf-8") as f:
            try:
                data = json.load(f)
            except json.JSONDecodeError as error:
                sys.exit(f"{path}: {error}")
        context = data["context"]
        for b in data["benchmarks"]:
            if b.get("run_type") == "aggregate" and b.get("aggregate_name") != "median":
                continue
            if b.get("error_occurred"):
                sys.exit(f"{path}: {b['name']}: {b['error_message']}")
            name = re.sub(r"_median$", "", b["name"])
            runs[name] = dict(b, ns=b["cpu_time"] * factor[b["time_unit"]])
    return runs, context


def per_item(b):
    """Instructions per element, where both were counted."""
    if "INSTRUCTIONS" not in b or not b.get("items_per_second"):
        return ""
    items = b["items_per_second"] * b["ns"] * 1e-9
    return f"{b['INSTRUCTIONS'] / items:.3g}"


HEAD = ["case", "scalar", OURS, "rival", "its time", "ratio"]
COUNTED = "instructions per element"
# Tables behind that of times.
MEMORY_HEAD = ["case", "scalar", "who", "GB/s"]
HEAP_HEAD = ["case", "scalar", "who", "heap, MB"]
ERROR_HEAD = ["case", "scalar", "who", "error, median", "error, 95 %", "right ones found", "wrong ones among these"]


def table(groups):
    """Rows of HEAD and COUNTED."""
    rows = []
    for group in sorted(groups):
        members = groups[group]
        parts = group.split("/")
        case, scalar = "/".join(parts[:-1]), parts[-1]
        ours = members.get(OURS)
        rivals = sorted(who for who in members if who != OURS) if ours else []
        own = time_text(ours["ns"]) if ours else "-"
        if ours and not rivals:
            rivals = [None]
        for who in rivals:
            row = [case, scalar, own]
            if who is None:
                row += ["-", "-", "-"]
            else:
                ratio = members[who]["ns"] / ours["ns"]
                lost = ratio < 1 and not who.startswith(OURS + "_")
                row += [who, time_text(members[who]["ns"]), f"**{ratio:.2f}**" if lost else f"{ratio:.2f}"]
            rows.append(row + [per_item(ours)])
    return rows


def memory_table(groups):
    """Rows of MEMORY_HEAD."""
    rows = []
    for group, members in groups.items():
        parts = group.split("/")
        for who, b in members.items():
            if "bytes_per_second" in b and (who == OURS or group.startswith("copy/")):
                rows.append(["/".join(parts[:-1]), parts[-1], who, f"{b['bytes_per_second'] / 1e9:.2f}"])
    return rows


def error_table(groups):
    """Rows of ERROR_HEAD: what benchmarks say of their answers' errors."""
    rows = []
    for group, members in groups.items():
        parts = group.split("/")
        for who, b in members.items():
            for unit in ("px", "mm"):
                if f"error_{unit}" in b:
                    errors = [f"{b[key]:.3f} {unit}" if key in b else "-" for key in (f"error_{unit}", f"error_{unit}_95")]
                    found = [f"{100 * b[key]:.1f} %" if key in b else "-" for key in ("right", "wrong")]
                    rows.append(["/".join(parts[:-1]), parts[-1], who, *errors, *found])
    return rows


def heap_table(groups):
    """Rows of HEAP_HEAD."""
    return [[*group.rsplit("/", 1), who, f"{b['heap_MB']:.2f}"] for group, members in groups.items()
            for who, b in members.items() if "heap_MB" in b]


def family(row):
    return row[0].split("/")[0]


def read_table(path):
    """What an earlier page says of its machine and build, and the rows of its tables by their heads."""
    made_with, tables, rows = [], {}, None
    with open(path, encoding="utf-8") as f:
        for line in f:
            if line.startswith("- "):
                made_with.append(line[2:].rstrip())
            if not line.startswith("|"):
                rows = None
                continue
            row = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if rows is None:
                rows = tables.setdefault(tuple(row[:len(HEAD)]) if row[:len(HEAD)] == HEAD else tuple(row), [])
            elif not line.startswith("|--"):
                rows.append(row)
    return made_with, tables


def same_machine(made_with, header):
    """Whether figures may stand in one table. How fast the cores run and what is counted may differ."""
    def known(lines):
        return [line.split(",")[0] if line.startswith("CPU:") else line for line in lines
                if not line.startswith("Instructions")]
    return known(made_with) == known(header)


def markdown(head, rows):
    return ["| " + " | ".join(row) + " |" for row in [head]] + ["|" + "---|" * len(head)] + \
        ["| " + " | ".join(row) + " |" for row in rows]


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--keep")
    parser.add_argument("build")
    parser.add_argument("runs", nargs="+")
    options = parser.parse_args()
    with open(options.build, encoding="utf-8") as f:
        build = [line.rstrip() for line in f]
    runs, context = read_runs(options.runs)
    groups = {}
    for name, b in runs.items():
        group, who = name.rsplit("/", 1)
        groups.setdefault(group, {})[who] = b
    rows = table({g: m for g, m in groups.items() if not g.startswith("copy/")})
    memory, heap, errors = memory_table(groups), heap_table(groups), error_table(groups)
    header = [f"CPU: {cpu_name()}, {context.get('num_cpus', '?')} cores at {context.get('mhz_per_cpu', '?')} MHz"] + build
    if options.keep:
        made_with, old = read_table(options.keep)
        if not same_machine(made_with, header):
            sys.exit(f"{options.keep}: made on another machine or with another compiler or library than these runs; "
                     "measure all anew")
        anew = {group.split("/")[0] for group in groups}

        def kept(head):
            return [row for row in old.get(tuple(head), []) if family(row) not in anew]

        rows += [(row + [""])[:len(HEAD) + 1] for row in kept(HEAD)]
        memory += kept(MEMORY_HEAD)
        heap += kept(HEAP_HEAD)
        errors += kept(ERROR_HEAD)
    rows.sort(key=lambda row: (row[0] + "/" + row[1], row[3]))
    memory.sort(key=lambda row: (family(row) != "copy", row[0] + "/" + row[1], row[2]))
    for others in (heap, errors):
        others.sort(key=lambda row: (row[0] + "/" + row[1], row[2]))
    losses = sum("**" in row[5] for row in rows)
    counted = any(row[6] for row in rows)
    print("# Benchmarks\n")
    print("Written by `scripts/bench.sh`; [bench/README.md](../bench/README.md) says how to run one and how to add one.")
    print("Times are CPU times of one thread, medians of repetitions. A ratio is the rival's time through ours: above 1")
    print(f"dynslam is faster; losses (in bold, {losses} of them) stay here. `dynslam_...` are other ways of its own to the same")
    print("answer. Every answer was checked before it was timed.\n")
    for line in header:
        print(f"- {line}")
    if not counted:
        print("- Instructions per element: this machine counts none (`perf stat -e instructions`)")
    print()
    print("\n".join(markdown(HEAD + [COUNTED], rows) if counted else markdown(HEAD, [row[:6] for row in rows])))
    if errors:
        print("\n## Errors\n")
        print("Of the answers that were timed: F and E, Sampson's distance, H, the transfer error, RMS over the matches that")
        print("are right, without their noise, of 40 or 1000 scenes; of poses the camera's centre over 40 problems (noise of 1 px,")
        print("depth as of a structured-light camera). The last two columns are of all inliers.\n")
        print("\n".join(markdown(ERROR_HEAD, errors)))
    if heap:
        print("\n## Memory of maps\n")
        print("Heap of a map when all scans are in it; `octomap` has colour, ours colour and labels.\n")
        print("\n".join(markdown(HEAP_HEAD, heap)))
    if any(family(row) == "copy" for row in memory):
        print("\n## Bytes per second\n")
        print("Read and written, of kernels that memory may bound, beside copies (memcpy) of three sizes.\n")
        print("\n".join(markdown(MEMORY_HEAD, memory)))
    with open(os.path.join(os.path.dirname(__file__), "..", "bench", "peers.md"), encoding="utf-8") as f:
        print(f"\n{f.read()}", end="")


main()
