# SPDX-License-Identifier: Apache-2.0
"""The programs as installed under a prefix, run from another folder: everything shipped is found."""
import os
import pathlib
import shutil
import tempfile
import unittest

from programs import STICKSLIP, EndToEnd, main, run, stickslip

BUILD = pathlib.Path(STICKSLIP).resolve().parents[1]
DRIVE = "time_s,base_displacement_m\n" + "".join(
    f"{i / 200},{1e-3 * (i % 7)}\n" for i in range(200))


class Installed(EndToEnd):
    @classmethod
    def setUpClass(cls):
        cls.keep = tempfile.TemporaryDirectory(prefix="stickslip-")
        cls.prefix = pathlib.Path(cls.keep.name) / "usr"
        cls.installing = run("cmake", "--install", BUILD, "--prefix", cls.prefix)

    @classmethod
    def tearDownClass(cls):
        cls.keep.cleanup()

    def setUp(self):
        super().setUp()
        self.assertEqual(self.installing.returncode, 0, self.installing.stderr)

    def installed(self, *arguments):
        """`stickslip ...` of the installation, in the root folder."""
        result = run(self.prefix / "bin/stickslip", *arguments, cwd="/")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return result.stdout

    def test_every_shipped_file_is_valid_where_it_is_installed(self):
        shipped = sorted((self.prefix / "share/stickslip").rglob("*.toml"))
        self.assertGreater(len(shipped), 30)
        self.assertEqual(self.installed("check", *shipped).count(": valid"), len(shipped))

    def test_shipped_files_are_found_by_name(self):
        self.assertIn("share/stickslip/simulated.toml: valid", self.installed("check", "simulated"))
        self.assertIn("share/stickslip/faults/clock_jump.toml: valid",
                      self.installed("check", "clock_jump"))
        self.assertIn("rig.name", self.installed("config", "beam-1"))
        drive = self.write("drive.csv", DRIVE)
        out = self.folder / "run.csv"
        self.installed("simulate", "--model", "simulated", "--drive", drive, "--out", out)
        self.assertEqual(len(out.read_text().splitlines()), 201)

    @unittest.skipIf(os.environ.get("STICKSLIP_PYTHON_PROBLEM"), "the Python module is not built")
    def test_the_python_module_finds_them_too(self):
        folder = next(self.prefix.glob("lib/python3*/dist-packages"))
        result = run("/usr/bin/python3", "-c", "import stickslip; print(stickslip.Model.read('beam-1').source)",
                     env={"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}, cwd="/")
        self.assertEqual(result.stdout.strip(), str(self.prefix / "share/stickslip/models/beam-1.toml"), result.stderr)

    def test_figures_need_no_option_for_their_presets(self):
        out = self.folder / "figures"
        self.installed("figures", "--only", "2", "--out", out)
        self.assertIn("figure-2", (out / "index.html").read_text())

    def test_the_daemon_finds_them_too(self):
        result = run(self.prefix / "bin/stickslipd", "--config", "simulated", "--duration", "0.2",
                     "--no-lcm", "--control", self.folder / "socket", "--record",
                     self.folder / "run.log", cwd=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_nothing_installed_names_the_build(self):
        for page in (self.prefix / "share/man/man1").iterdir():
            self.assertNotIn(str(BUILD), page.read_text(), page.name)

    def test_a_program_without_them_names_the_remedy(self):
        lonely = self.folder / "bin"
        lonely.mkdir()
        shutil.copy2(self.prefix / "bin/stickslip", lonely / "stickslip")
        result = run(lonely / "stickslip", "figures", "--out", self.folder / "figures", cwd="/")
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertIn("expected --presets DIR", result.stderr)


class FromTheBuild(EndToEnd):
    def test_the_build_finds_those_of_the_source(self):
        result = stickslip("check", "beam-1", cwd="/")
        self.assertEqual(result.returncode, 0, result.stderr)


if __name__ == "__main__":
    main()
