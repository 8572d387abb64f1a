#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""check-snippets.py [--compiler CXX -I DIR...] [--runtime DIR...] [--program DYNSLAM] [--jobs N] [ROOT]

What README.md and docs/ show can be typed in:

- each ```cpp block compiles (-fsyntax-only). One without main(), types or functions of its own is the body of a function,
  in which the names of tests/support/snippets/ stand for the reader's own. A first line `// NAME.hpp ...` names a file that
  later blocks of the page may include; `C++11` in it is its standard. Without --compiler none is compiled; blocks that
  include the runtime are with --runtime alone;
- commands of the program and their options exist (blocks of shell and `dynslam ...` in the text; with --program);
- scripts and presets exist, and a script's text has the options that it is called with.

Prints a line for each fault and exits with 1 where there is one.
"""
import argparse
import concurrent.futures
import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

OWN = re.compile(r"^(class|struct|namespace|template|int main|[\w:<>]+ \w+\([^)]*\) \{)", re.MULTILINE)


def blocks(text, language):
    """Number of the first line, text."""
    for found in re.finditer(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        yield text.count("\n", 0, found.start(1)) + 1, found.group(1)


def source_of(block):
    """A translation unit."""
    if OWN.search(block):
        return block
    lines = block.splitlines()
    top = [line for line in lines if line.startswith("#")]
    prelude = "runtime" if "dynslam/runtime" in block else "core"
    return "\n".join([*top, f'#include "{prelude}.hpp"', "void snippet() {",
                      *(line for line in lines if not line.startswith("#")), "}", ""])


class Compiler:
    def __init__(self, arguments, root):
        self.command = [arguments.compiler, "-fsyntax-only", "-Wall", "-Wno-unused", "-I",
                        str(root / "tests/support/snippets")]
        self.core = [word for folder in arguments.include for word in ("-isystem", folder)
                     if folder != "/usr/include"]  # the compiler's own, which has a place of its own
        self.runtime = [word for folder in arguments.runtime for word in ("-isystem", folder)
                        if folder != "/usr/include"]

    def faults(self, page, number, block, folder):
        first = block.splitlines()[0]
        named = re.match(r"// ([\w./]+\.[hc]pp)\b", first)
        if "dynslam/runtime" in block and not self.runtime:
            return f"SKIPPED: {page}:{number}: no runtime", False
        file = folder / (named.group(1) if named else f"{number}.cpp")
        file.write_text(source_of(block), encoding="utf-8")
        standard = "c++11" if "C++11" in first else "c++20"
        done = subprocess.run([*self.command, f"-std={standard}", *self.core, *self.runtime, "-x", "c++", str(file)],
                              capture_output=True, text=True)
        if done.returncode == 0:
            return None, False
        error = next((line for line in done.stderr.splitlines() if "error:" in line), done.stderr[-300:])
        return f"{page}:{number}: does not compile: {error.replace(str(folder) + '/', '')}", True


def commands(text):
    """Number and words of each command of shell blocks, and of `dynslam ...` in the text."""
    fenced = None
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("```"):
            fenced = None if fenced is not None else line.strip()[3:]
            continue
        shown = fenced in ("sh", "bash") or (fenced is None and re.match(r" {4,}\S", line))
        pieces = re.split(r"&&|\||;", line) if shown else re.findall(r"`((?:build/release/bin/)?dynslam [^`]*)`", line)
        for piece in pieces:
            try:
                words = shlex.split(re.sub(r"[\[\]()]", " ", piece.replace("\\|", "|")), comments=True)
            except ValueError:
                continue
            while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):
                words.pop(0)
            if words:
                yield number, words


class Program:
    def __init__(self, path):
        self.path, self.helps = path, {}

    def help(self, *words):
        if words not in self.helps:
            done = subprocess.run([self.path, *words, "--help"], capture_output=True, text=True)
            self.helps[words] = done.stdout if done.returncode == 0 else None
        return self.helps[words]

    def fault(self, words):
        command = words[1:2]
        if not command or command[0].startswith("-") or not re.fullmatch(r"[a-z-]+", command[0]):
            return None
        known = self.help(*command)
        if known is None or known == self.help():
            return f"no command 'dynslam {command[0]}'"
        if command[0] == "map" and len(words) > 2 and self.help("map", words[2]):
            known += self.help("map", words[2])
        for word in words[2:]:
            option = word.split("=")[0].rstrip(",.:")
            if re.fullmatch(r"--[a-z-]+|-[a-z]", option) and not re.search(rf"(^|[\s,]){option}\b(?!-)", known):
                return f"'dynslam {command[0]}' has no {option}"
        return None


def script_fault(root, words):
    file = root / words[0].removeprefix("./")
    if not file.exists():
        return f"{words[0]} does not exist"
    text = "".join(path.read_text(encoding="utf-8") for path in (file, file.with_suffix(".py")) if path.exists())
    for word in words[1:]:
        option = word.split("=")[0]
        # What follows a command of the program is for that one.
        if re.fullmatch(r"--[a-z-]+", option) and option not in text and '"$@"' not in text:
            return f"{words[0]} has no {option}"
    return None


def shell_faults(root, page, text, program):
    presets = {preset["name"] for preset in json.loads((root / "CMakePresets.json").read_text())["configurePresets"]}
    for number, words in commands(text):
        fault = None
        if words[0] in ("dynslam", "build/release/bin/dynslam") and program:
            fault = program.fault(words)
        elif re.match(r"(\./)?scripts/", words[0]):
            fault = script_fault(root, words)
        elif words[0] in ("cmake", "ctest") and "--preset" in words[:-1]:
            name = words[words.index("--preset") + 1]
            fault = None if name in presets or name.startswith("<") else f"no preset {name}"
        if fault:
            yield f"{page}:{number}: {fault}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--compiler")
    parser.add_argument("-I", dest="include", action="append", default=[])
    parser.add_argument("--runtime", action="append", default=[])
    parser.add_argument("--program")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("root", nargs="?", default=pathlib.Path(__file__).parent.parent, type=pathlib.Path)
    arguments = parser.parse_args()
    # CMake's lists, of which generator expressions make one word.
    arguments.include = [folder for word in arguments.include for folder in word.split(";") if folder]
    arguments.runtime = [folder for word in arguments.runtime for folder in word.split(";") if folder]
    root = arguments.root.resolve()
    program = Program(arguments.program) if arguments.program else None
    found, compiled = [], 0
    with tempfile.TemporaryDirectory() as work, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        waiting = []
        for page in [root / "README.md", *sorted((root / "docs").glob("**/*.md"))]:
            text, name = page.read_text(encoding="utf-8"), page.relative_to(root)
            found += shell_faults(root, name, text, program)
            folder = pathlib.Path(work) / str(name).replace("/", "_")
            folder.mkdir()
            for number, block in blocks(text, "cpp") if arguments.compiler else ():
                compiler = Compiler(arguments, root)
                waiting.append(pool.submit(compiler.faults, name, number, block, folder))
                if block.startswith("// ") and ".hpp" in block.splitlines()[0]:
                    waiting[-1].result()  # others may include it
        for one in waiting:
            text, wrong = one.result()
            compiled += 1
            if wrong:
                found.append(text)
            elif text:
                print(text)
    print("\n".join(found) if found else f"{compiled} snippets compile, every command exists")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
