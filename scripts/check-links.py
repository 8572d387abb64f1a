#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check-links.py [ROOT]

Every link of the Markdown pages that names a file or a heading of this repository leads there. Prints a line for each
that does not, and exits with 1 where there is one.
"""
import pathlib
import re
import sys

LINK = re.compile(r"\]\(([^)#\s]*)(#[^)\s]*)?\)")


def anchors(page):
    """As GitHub makes them of headings."""
    found = set()
    for line in page.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", line.lstrip("#").strip().lower().replace("`", ""))
            found.add(re.sub(r"[^\w\- ]", "", heading).replace(" ", "-"))
    return found


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent).resolve()
    pages = [page for pattern in ("*.md", "docs/**/*.md", "bench/*.md", "models/*.md", "examples/*.md")
             for page in sorted(root.glob(pattern))]
    faults = 0
    for page in pages:
        text = re.sub(r"(?ms)^```.*?^```", lambda fence: "\n" * fence.group(0).count("\n"), page.read_text(encoding="utf-8"))
        for number, line in enumerate(text.splitlines(), 1):
            for path, anchor in LINK.findall(line):
                if re.match(r"[a-z]+:", path):
                    continue
                target = (page.parent / path).resolve() if path else page
                if not target.exists():
                    fault = f"{path} does not exist"
                elif anchor and target.suffix == ".md" and anchor[1:] not in anchors(target):
                    fault = f"{path or page.name} has no heading {anchor}"
                else:
                    continue
                faults += 1
                print(f"{page.relative_to(root)}:{number}: {fault}")
    if not faults:
        print(f"{len(pages)} pages, every link leads somewhere")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
