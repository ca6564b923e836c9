# SPDX-License-Identifier: Apache-2.0
"""Calibration files: made from points, renewed, refused, shown and checked."""
import os
import unittest

from programs import EndToEnd, main, stickslip

GOOD = "raw,raw_std,reference_si\n" + "".join(
    f"{2e-5 + force / 2000 + wiggle!r},1e-7,{force}\n"
    for force, wiggle in zip([0.0, 0.5, 1.0, 2.0, 1.0, 0.5, 0.0],
                             [1e-8, -7e-8, 3e-8, 5e-8, -1e-7, 8e-8, -4e-8]))


class Calibration(EndToEnd):
    def setUp(self):
        super().setUp()
        self.file = self.folder / "calibration.toml"
        self.points = self.write("points.csv", GOOD)

    def fit(self, *more, date="2026-03-02"):
        return stickslip("calibration", "fit", self.points, "--channel", "friction_force", "--file",
                         self.file, "--reference", "weights set 12", "--raw-unit", "V/V",
                         "--date", date, *more)

    def test_points_make_a_valid_file_with_history(self):
        first = self.fit("--by", "M. Weber")
        self.assertEqual(first.returncode, 0, first.stderr)
        self.assertIn("gain            1999.9", first.stdout)
        self.succeed("check", self.file)
        os.chmod(self.file, 0o640)
        second = self.fit("--valid-range", "-2", "2", date="2026-03-03")
        self.assertEqual(second.returncode, 0, second.stderr)
        self.assertIn("history", second.stdout)
        self.assertEqual(self.file.stat().st_mode & 0o777, 0o640)
        shown = self.succeed("calibration", "show", self.file, "--history").stdout
        self.assertIn("friction_force", shown)
        self.assertIn("2026-03-03", shown)
        self.assertIn("before: ", shown)
        self.assertIn("by M. Weber", shown)
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()),
                         ["calibration.toml", "points.csv"])

    def test_nothing_is_written_for_points_off_a_line(self):
        self.assertEqual(self.fit().returncode, 0)
        before = self.file.read_bytes()
        self.points = self.write("points.csv", GOOD.replace(",2.0\n", ",2.1\n"))
        refused = self.fit(date="2026-03-04")
        self.assertEqual(refused.returncode, 2)
        self.assertEqual(len(refused.stderr.splitlines()), 1)
        self.assertIn("no calibration", refused.stderr)
        self.assertEqual(self.file.read_bytes(), before)
        self.assertEqual(self.fit("--force", "--dry-run", date="2026-03-04").returncode, 0)
        self.assertEqual(self.file.read_bytes(), before)
        self.assertEqual(self.fit("--force", date="2026-03-04").returncode, 0)
        self.assertIn("despite = [", self.file.read_text())

    def test_a_clock_that_goes_back_is_refused(self):
        self.assertEqual(self.fit().returncode, 0)
        refused = self.fit(date="2026-03-01")
        self.assertEqual(refused.returncode, 2)
        self.assertIn("is the clock right?", refused.stderr)

    def test_bad_points_are_reported_with_their_line(self):
        self.points = self.write("points.csv", "raw,reference_si\n1,2\n1,x\n")
        refused = self.fit()
        self.assertEqual(refused.returncode, 2)
        self.assertIn("points.csv:3: reference_si: expected a number", refused.stderr)
        self.assertFalse(self.file.exists())

    def test_a_file_that_cannot_be_written_is_reported(self):
        self.file = self.folder / "no" / "folder.toml"
        refused = self.fit()
        self.assertEqual(refused.returncode, 2)
        self.assertIn("cannot be written", refused.stderr)

    def test_a_bad_calibration_is_checked(self):
        self.file.write_text("schema = 1\n[channel.velocity]\noffset = 0\ngain = 0\n"
                             "date = \"2026-03-01\"\nreference = \"r\"\n")
        refused = stickslip("check", self.file)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("calibration.toml:4:8: channel.velocity.gain: is 0", refused.stderr)


if __name__ == "__main__":
    main()
