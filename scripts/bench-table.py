#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""bench-table.py BUILD.TXT RUN.JSON... > docs/benchmarks.md

Makes a table of ratios from runs of Google Benchmark. A case is named family/case/scalar/who; whoever has all but the
last part in common is compared with `dynslam`, by the CPU time of the medians. `dynslam_...` are further ways of ours,
among which a loss is none.
"""
import json
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


def table(groups):
    counted = any("INSTRUCTIONS" in b for members in groups.values() for b in members.values())
    head = ["case", "scalar", OURS, "rival", "its time", "ratio"] + (["instructions per element"] if counted else [])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    losses = 0
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
                losses += lost
                row += [who, time_text(members[who]["ns"]), f"**{ratio:.2f}**" if lost else f"{ratio:.2f}"]
            if counted:
                row.append(per_item(ours))
            lines.append("| " + " | ".join(row) + " |")
    return lines, losses


def memory_table(groups):
    copies = [(members["memcpy"]["bytes_per_second"], group) for group, members in groups.items()
              if "memcpy" in members and "bytes_per_second" in members["memcpy"]]
    if not copies:
        return []
    lines = ["", "## Bytes per second", "",
             "Read and written, of kernels that memory may bound, beside copies (memcpy) of three sizes.", "",
             "| case | scalar | who | GB/s |", "|---|---|---|---|"]
    for group in sorted(groups, key=lambda g: (not g.startswith("copy/"), g)):
        parts = group.split("/")
        for who, b in sorted(groups[group].items()):
            if "bytes_per_second" in b and (who == OURS or group.startswith("copy/")):
                lines.append(f"| {'/'.join(parts[:-1])} | {parts[-1]} | {who} | {b['bytes_per_second'] / 1e9:.2f} |")
    return lines


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as f:
        build = [line.rstrip() for line in f]
    runs, context = read_runs(sys.argv[2:])
    groups = {}
    for name, b in runs.items():
        group, who = name.rsplit("/", 1)
        groups.setdefault(group, {})[who] = b
    lines, losses = table({g: m for g, m in groups.items() if not g.startswith("copy/")})
    print("# Benchmarks\n")
    print("Written by `scripts/bench.sh`; [bench/README.md](../bench/README.md) says how to run one and how to add one.")
    print("Times are CPU times of one thread, medians of repetitions. A ratio is the rival's time through ours: above 1")
    print(f"dynslam is faster; losses (in bold, {losses} of them) stay here. `dynslam_...` are other ways of its own to the same")
    print("answer. Every answer was checked before it was timed.\n")
    print(f"- CPU: {cpu_name()}, {context.get('num_cpus', '?')} cores at {context.get('mhz_per_cpu', '?')} MHz")
    for line in build:
        print(f"- {line}")
    if not any("INSTRUCTIONS" in b for b in runs.values()):
        print("- Instructions per element: this machine counts none (`perf stat -e instructions`)")
    print()
    print("\n".join(lines + memory_table(groups)))


main()
