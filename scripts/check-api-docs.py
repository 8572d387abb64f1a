#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What Doxygen does not say of the API reference, one line each:

- what of the public headers has no documentation: types, concepts and whatever else stands in a namespace. Members
  may be without: width() of an image needs no sentence. So may deduction guides and specialisations, which are their
  template's.
- names in docs/api/ (dynslam::...) that no header has

  check-api-docs.py XML DOCS    the folder that Doxygen writes with GENERATE_XML, and docs/api

Exits with 1 where there is any.
"""
import pathlib
import re
import sys
import xml.etree.ElementTree as ElementTree

TYPES = ("class", "struct", "union", "concept")


def documented(element):
    return any("".join(text.itertext()).strip()
               for tag in ("briefdescription", "detaileddescription") for text in element.findall(tag))


def place(element):
    location = element.find("location")
    return f"{location.get('file')}:{location.get('line')}"


def undocumented(compounds, types):
    unqualified = {name.rpartition("::")[2] for name in types}
    for compound in compounds:
        name = compound.findtext("compoundname")
        if compound.get("kind") in TYPES:
            is_nested = name.rpartition("::")[0] in types
            if not (documented(compound) or is_nested or "<" in name):
                yield f"{place(compound)}: {name} is not documented"
        elif compound.get("kind") == "namespace":
            for member in compound.iter("memberdef"):
                own = member.findtext("name")
                is_guide = own in unqualified
                if not (documented(member) or is_guide or "<" in own):
                    yield f"{place(member)}: {name}::{own} is not documented"


def unknown(folder, compounds):
    known = {compound.findtext("compoundname") for compound in compounds}
    for compound in compounds:
        for member in compound.iter("memberdef"):
            known.add(compound.findtext("compoundname") + "::" + member.findtext("name"))
    for path in sorted([*folder.glob("*.md"), *folder.glob("*.dox")]):
        text = re.sub(r"```.*?```|`[^`]*`", lambda code: "\n" * code.group().count("\n"),
                      path.read_text(encoding="utf-8"), flags=re.S)
        for number, line in enumerate(text.splitlines(), 1):
            for name in re.findall(r"\bdynslam(?:::\w+)+", line):
                if name not in known:
                    yield f"{path}:{number}: no header has {name}"


def main():
    if len(sys.argv) != 3 or not any(pathlib.Path(sys.argv[1]).glob("*.xml")):
        sys.exit(__doc__)
    compounds = [compound for path in sorted(pathlib.Path(sys.argv[1]).glob("*.xml"))
                 for compound in ElementTree.parse(path).getroot().findall("compounddef")]
    types = {c.findtext("compoundname") for c in compounds if c.get("kind") in TYPES}
    found = sorted({*undocumented(compounds, types), *unknown(pathlib.Path(sys.argv[2]), compounds)})
    for line in found:
        print(line, file=sys.stderr)
    sys.exit(1 if found else 0)


main()
