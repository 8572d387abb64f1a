# SPDX-License-Identifier: BSD-3-Clause
"""What docs/python.md shows runs, and the stub names what the module has."""
import ast
import os
import pathlib
import re
import tempfile
import unittest

import dynslam
import scene

ROOT = pathlib.Path(__file__).parents[2]


class Page(unittest.TestCase):
    def test_snippets_run(self):
        text = (ROOT / "docs/python.md").read_text(encoding="utf-8")
        blocks = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
        self.assertEqual(len(blocks), 4)
        before = os.getcwd()
        with tempfile.TemporaryDirectory() as work:
            os.symlink(scene.office()[0], pathlib.Path(work) / "walking")
            os.chdir(work)
            try:
                for block in blocks:
                    exec(compile(block, "docs/python.md", "exec"), {})
            finally:
                os.chdir(before)
            self.assertEqual((pathlib.Path(work) / "trajectory.txt").read_bytes(), (scene.office_run() / "trajectory.txt").read_bytes())


class Stub(unittest.TestCase):
    def test_it_names_what_there_is(self):
        tree = ast.parse((pathlib.Path(dynslam.__file__).parent / "__init__.pyi").read_text(encoding="utf-8"))
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        classes = {node.name: {f.name for f in node.body if isinstance(f, ast.FunctionDef) and not f.name.startswith("__")}
                   for node in tree.body if isinstance(node, ast.ClassDef)}
        self.assertEqual(functions | set(classes), set(dynslam.__all__))
        for name, members in classes.items():
            if not name.endswith("Error"):
                self.assertEqual(members, {m for m in vars(getattr(dynslam, name)) if not m.startswith("_")}, name)

    def test_everything_has_a_docstring(self):
        for name in dynslam.__all__:
            self.assertTrue(getattr(dynslam, name).__doc__, name)


if __name__ == "__main__":
    unittest.main()
