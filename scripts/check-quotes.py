#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check-quotes.py [--update] [ROOT]

Every measured number in README.md and docs/ is a quote of docs/results.md, which scripts/results.sh writes:

- each line between `<!-- results -->` and `<!-- /results -->` stands verbatim in docs/results.md;
- outside of such blocks, of code and of blocks that say where numbers were published (`<!-- published: SOURCE -->` to
  `<!-- /published -->`), no line has what looks like a measurement: an error in metres or centimetres, frames per
  second, or a number behind ATE, RMSE, IoU or recall.

docs/results.md, docs/benchmarks.md (by scripts/bench.sh) and CHANGELOG.md (history) are not searched. Prints a line for
each fault and exits with 1 where there is one.

--update  first replaces quoted rows of tables by the rows of docs/results.md that begin with the same two cells
"""
import pathlib
import re
import sys

GENERATED = {"results.md", "benchmarks.md"}
MEASURED = re.compile(r"(?<![\w.])0\.0\d{2,}(?!\d*[\w/])|\d\.\d+ (cm|mm)\b|\d frames/s|\b(ATE|RMSE|IoU|[Rr]ecall)\b[^|.;`]{0,24}\d\.\d")
BLOCK = re.compile(r"<!-- (/?)(results|published)(: [^>]+)? -->")


def faults_of(name, lines, quotable):
    inside, fenced = None, False
    for number, line in enumerate(lines, 1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        if fenced:
            continue
        mark = BLOCK.fullmatch(line.strip())
        if mark:
            closes, kind, source = mark.group(1) == "/", mark.group(2), mark.group(3)
            if closes != (inside is not None) or (closes and kind != inside):
                yield f"{name}:{number}: {line.strip()} does not match the mark before it"
            if not closes and kind == "published" and not source:
                yield f"{name}:{number}: say where it was published"
            inside = None if closes else kind
        elif inside == "results":
            if line.strip() and not re.fullmatch(r"[|:\- ]+", line) and line not in quotable:
                yield f"{name}:{number}: not a line of docs/results.md: {line.strip()[:90]}"
        elif inside is None and not line.startswith("    "):
            found = MEASURED.search(re.sub(r"`[^`]*`", "", line))
            if found:
                yield f"{name}:{number}: '{found.group(0)}' looks measured, and quotes nothing (<!-- results -->)"
    if inside:
        yield f"{name}: <!-- {inside} --> is not closed"


def update(page, quotable):
    rows = {}
    for line in quotable:
        cells = line.split("|")
        if len(cells) > 4:
            rows.setdefault((cells[1], cells[2], len(cells)), []).append(line)
    inside, lines = False, []
    for line in page.read_text(encoding="utf-8").splitlines():
        mark = BLOCK.fullmatch(line.strip())
        inside = (not mark.group(1) and mark.group(2) == "results") if mark else inside
        cells = line.split("|")
        if inside and len(cells) > 4:
            same = rows.get((cells[1], cells[2], len(cells)), [])
            if len(same) == 1:
                line = same[0]
        lines.append(line)
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main():
    arguments = [argument for argument in sys.argv[1:] if argument != "--update"]
    root = pathlib.Path(arguments[0] if arguments else pathlib.Path(__file__).parent.parent)
    results = root / "docs/results.md"
    if not results.exists():
        print(f"{results} is missing: scripts/results.sh writes it")
        return 1
    quotable = set(results.read_text(encoding="utf-8").splitlines())
    found = []
    for page in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        if page.name not in GENERATED and page.exists():
            if "--update" in sys.argv:
                update(page, quotable)
            found += faults_of(page.relative_to(root), page.read_text(encoding="utf-8").splitlines(), quotable)
    print("\n".join(found) if found else "every number is a quote of docs/results.md")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
