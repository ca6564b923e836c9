# SPDX-License-Identifier: Apache-2.0
"""docs/tutorial/linear_drive.ipynb: its cells run in order, without Jupyter, and print what the notebook holds,
numbers within the tolerance of the tutorial.

notebook.py --write renews what it holds.
"""
import ast
import contextlib
import io
import json
import os
import pathlib
import shutil
import sys

from programs import SKIPPED, SOURCE, EndToEnd, main
from tutorial import alike

NOTEBOOK = SOURCE / "docs/tutorial/linear_drive.ipynb"


def printed_by(cells):
    """The text that each code cell prints, and its last value if Jupyter would show it."""
    names = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        tree = ast.parse("".join(cell["source"]))
        last = ast.Expression(tree.body.pop().value) if isinstance(tree.body[-1], ast.Expr) else None
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(tree, f"cell {number}", "exec"), names)
            value = eval(compile(last, f"cell {number}", "eval"), names) if last else None
        yield printed.getvalue(), value


def output_of(cell):
    return "".join(text for output in cell["outputs"] for text in output["text"])


class Notebook(EndToEnd):
    def test_every_cell_prints_what_the_notebook_holds(self):
        cells = [each for each in json.loads(NOTEBOOK.read_text())["cells"] if each["cell_type"] == "code"]
        for name in (NOTEBOOK.name, "linear_drive.py"):
            shutil.copy(NOTEBOOK.parent / name, self.folder)
        self.addCleanup(os.chdir, pathlib.Path.cwd())
        os.chdir(self.folder)
        pages = []
        for cell, (printed, value) in zip(cells, printed_by(cells)):
            with self.subTest("".join(cell["source"])):
                shown, found = output_of(cell).split(), printed.split()
                self.assertEqual(len(shown), len(found), printed)
                for a, b in zip(shown, found):
                    self.assertTrue(alike(a, b), f"{a} is shown, {b} printed: {printed}")
            if hasattr(value, "_repr_html_"):
                pages.append(value._repr_html_())
        self.assertEqual(len(pages), 1)
        self.assertIn("<iframe", pages[0])


def write():
    notebook = json.loads(NOTEBOOK.read_text())
    cells = [each for each in notebook["cells"] if each["cell_type"] == "code"]
    os.chdir(NOTEBOOK.parent)
    for cell, (printed, _) in zip(cells, printed_by(cells)):
        lines = printed.splitlines(True)
        cell["outputs"] = [{"name": "stdout", "output_type": "stream", "text": lines}] if lines else []
    NOTEBOOK.write_text(json.dumps(notebook, indent=1) + "\n")


if __name__ == "__main__":
    if os.environ.get("STICKSLIP_PYTHON_PROBLEM"):
        print("skipped: the Python module is not built: " + os.environ["STICKSLIP_PYTHON_PROBLEM"])
        sys.exit(SKIPPED)
    if sys.argv[1:] == ["--write"]:
        write()
    else:
        main()
