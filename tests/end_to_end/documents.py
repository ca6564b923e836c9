# SPDX-License-Identifier: Apache-2.0
"""The examples of docs/python.md: those with the module print what the page shows, and every reader of a
recording the same statistics."""
import os
import re
import shutil
import subprocess
import sys
import unittest

from programs import PATIENCE_S, SOURCE, STICKSLIP, EndToEnd, main, run

WITH_MODULE, WITHOUT = (SOURCE / "docs/python.md").read_text().split("\n## Without the module\n")
ROWS = [(i / 100, None if i % 7 == 3 else 1e-3 * ((i * 7919) % 101) / 3.0, 0.1 * (i % 3)) for i in range(500)]


def blocks(language):
    """Pairs of heading and code, of the part of the page that does without the module."""
    heading, found = "", []
    for part in re.finditer(r"^### ([^\n]*)$|^```(\w+)\n(.*?)^```$", WITHOUT, re.MULTILINE | re.DOTALL):
        heading = part[1] or heading
        if part[2] == language:
            found.append((heading, part[3]))
    return found


def python_with(packages):
    """A Python with these packages: this one, or that of Debian; None if neither has them."""
    for python in (sys.executable, "/usr/bin/python3"):
        if shutil.which(python) and run(python, "-c", "".join(f"import {each}\n" for each in packages)).returncode == 0:
            return python
    return None


class Python(EndToEnd):
    def setUp(self):
        super().setUp()
        csv = "time_s,displacement_m,friction_force_n\n" + "".join(
            f"{t!r},{'' if x is None else repr(x)},{f!r}\n" for t, x, f in ROWS)
        self.succeed("convert", self.write("in.csv", csv), self.folder / "run.log")
        (self.folder / "protocol").symlink_to(SOURCE / "protocol")
        tools = [os.path.dirname(STICKSLIP), os.path.dirname(os.environ.get("LCM_GEN", ""))]
        path = os.pathsep.join([*filter(None, tools), os.environ["PATH"]])
        for _, code in blocks("sh"):
            done = subprocess.run(["sh", "-e", "-c", code], cwd=self.folder, capture_output=True, text=True,
                                  env={**os.environ, "PATH": path}, timeout=PATIENCE_S)
            self.assertEqual(done.returncode, 0, done.stderr)
        x = [x for _, x, _ in ROWS if x is not None]
        self.expected = (f"{len(ROWS)} frames, {ROWS[-1][0] - ROWS[0][0]:.3f} s, "
                     f"displacement {min(x):.6g} to {max(x):.6g} m\n")

    @unittest.skipIf(os.environ.get("STICKSLIP_PYTHON_PROBLEM"), "the Python module is not built")
    def test_the_module_prints_what_the_page_shows(self):
        listings = re.findall(r"^```(python|text)\n(.*?)^```$", WITH_MODULE, re.MULTILINE | re.DOTALL)
        code, shown = ("".join(text for each, text in listings if each == language) for language in ("python", "text"))
        done = run(sys.executable, "-c", code, cwd=self.folder)
        self.assertEqual(done.stderr, "")
        self.assertEqual(done.stdout, self.expected + shown)

    def test_all_readers_print_the_same(self):
        readers = blocks("python")
        self.assertEqual(len(readers), 4, "four readers are expected")
        for heading, code in readers:
            with self.subTest(heading):
                packages = sorted(set(re.findall(r"^(?:import|from) (h5py|scipy|numpy)", code, re.MULTILINE)))
                python = python_with(packages)
                if python is None:
                    self.assertTrue(packages)
                    print(f"not tested: {heading}: no Python has {', '.join(packages)}", flush=True)
                    continue
                done = run(python, "-c", code, cwd=self.folder)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                self.assertEqual(done.stdout, self.expected)

    def test_an_export_without_comments_is_a_table(self):
        """As in docs/other-programs.md, for programs that take the first line for the header."""
        self.succeed("log", "export", self.folder / "run.log", self.folder / "all.csv")
        lines = [line for line in (self.folder / "all.csv").read_text().splitlines() if line[:1] != "#"]
        self.assertTrue(lines[0].startswith("time_s,"))
        self.assertEqual({line.count(",") for line in lines}, {lines[0].count(",")})
        self.assertEqual(len(lines), len(ROWS) + 1)

    @unittest.skipUnless(shutil.which("octave-cli"), "octave is not installed")
    def test_octave_reads_the_mat_file(self):
        done = run("octave-cli", "--eval", "load run.mat; printf('%d frames, %.3f s, displacement %.6g to %.6g m\\n', "
                   "numel(frames.time_s), frames.time_s(end) - frames.time_s(1), min(frames.displacement_m), "
                   "max(frames.displacement_m))", cwd=self.folder)
        self.assertEqual(done.stdout, self.expected, done.stderr)


if __name__ == "__main__":
    main()
