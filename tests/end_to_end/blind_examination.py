# SPDX-License-Identifier: Apache-2.0
"""`stickslip conceal` and `stickslip examine`: a set is made, diagnosed, graded, and resumed after an
interruption."""
import hashlib
import json
import os
import re
import unittest

from programs import EndToEnd, main, read_json, stickslip


class BlindExamination(EndToEnd):
    def conceal(self, name, *more):
        folder = self.folder / name
        self.succeed("conceal", "--out", folder, "--seed", 3, "--duration", 10, *more)
        return folder

    def fail_with(self, status, *arguments, **options):
        result = stickslip(*arguments, **options)
        self.assertEqual(result.returncode, status, result.stderr)
        return result

    def test_set_is_made_sealed_examined_and_resumed(self):
        folder = self.conceal("set", "--count", 2, "--effect", "quadratic_drag", "--effect",
                              "dry_friction")
        for name in ("case-001", "case-002"):
            truth = (folder / "truth" / f"{name}.json").read_bytes()
            self.assertIn(hashlib.sha256(truth).hexdigest(),
                          (folder / name / "seal.txt").read_text())
            self.assertNotIn("physics", (folder / name / "model.toml").read_text())

        jobs = self.succeed("examine", folder, "--job-list", "-").stdout.splitlines()
        self.assertEqual(len(jobs), 2)
        self.assertTrue(all(re.match(r"stickslip examine .* --jobs 1$", job) for job in jobs))

        grades = self.folder / "grades.json"
        first = self.succeed("examine", folder, "--json", grades).stdout
        self.assertIn("Hidden -> reported", first)
        cases = read_json(grades)["cases"]
        self.assertEqual([case["name"] for case in cases], ["case-001", "case-002"])
        for case in cases:
            self.assertEqual(case["problem"], "")
            self.assertGreater(case["chi2_before"], case["chi2_after"])

        # Reports are reused.
        self.assertEqual(self.succeed("examine", folder, "--job-list", "-").stdout, "")
        report = folder / "reports" / "case-001.json"
        made = report.stat().st_mtime_ns
        self.assertEqual(self.succeed("examine", folder).stdout, first)
        self.assertEqual(report.stat().st_mtime_ns, made)
        narrow = self.succeed("examine", folder, env={**os.environ, "COLUMNS": "60"}).stdout
        self.expect_to_fit(narrow, ("examine",))

        # A report of another origin is not reused.
        content = json.loads(report.read_text())
        content["origin"] = "elsewhere"
        report.write_text(json.dumps(content))
        self.assertEqual(len(self.succeed("examine", folder, "--job-list", "-").stdout
                             .splitlines()), 1)

        # A modified truth file is refused.
        truth = folder / "truth" / "case-002.json"
        truth.write_text(truth.read_text().replace("missing_physics", "consistent"))
        result = self.fail_with(2, "examine", folder)
        self.assertIn("sealed", result.stderr)

    def test_imperfect_instruments_have_a_model_of_their_own(self):
        folder = self.conceal("bench", "--kind", "null", "--nuisance", "gain,gaps")
        case = folder / "case-001"
        self.assertEqual(list(read_json(folder / "truth" / "case-001.json")["nuisances"]),
                         ["gain", "gaps"])
        self.assertNotIn("gain", (case / "model.toml").read_text())
        self.assertIn("gain", (case / "model-instruments.toml").read_text())

        grades = self.folder / "instruments.json"
        shown = self.succeed("examine", folder, "--json", grades).stdout
        self.assertIn("nulls accused", shown)
        rows = [row["nuisance"] for row in read_json(grades)["by_nuisance"]]
        self.assertEqual(rows, ["gain", "gaps", "(one alone)", "(several)", "(ideal)"])
        # The report of one model is not that of the other.
        self.assertEqual(self.succeed("examine", folder, "--job-list", "-").stdout, "")
        jobs = self.succeed("examine", folder, "--job-list", "-", "--model-name",
                            "model-instruments.toml").stdout
        self.assertIn("--model-name 'model-instruments.toml'", jobs)

    def test_a_sealed_rig_is_studied(self):
        folder = self.conceal("rigs", "--rig", "--effect", "dry_friction")
        grades = self.folder / "rigs.json"
        shown = self.succeed("examine", folder, "--rig-time-s", 17, "--json", grades).stdout
        self.assertIn("sealed rigs", shown)
        (case,) = read_json(grades)["cases"]
        self.assertEqual(case["problem"], "")
        self.assertEqual(case["study"]["runs"], 1)
        self.assertEqual(case["study"]["rig_time_s"], 17)
        self.assertLess(case["study"]["used_share"], 1)
        self.assertTrue((folder / "reports" / "case-001" / "study.html").exists())
        # The report of one run is not that of another sequence of runs.
        same = self.succeed("examine", folder, "--rig-time-s", 17, "--job-list", "-").stdout
        self.assertEqual(same, "")
        jobs = self.succeed("examine", folder, "--rig-time-s", 17, "--runs", "usual", "--job-list", "-")
        self.assertIn("--runs usual --rig-time-s 17", jobs.stdout)
        # A folder that is no study is not replaced by one.
        notes = self.folder / "mine" / "case-001" / "notes.txt"
        notes.parent.mkdir(parents=True)
        notes.write_text("")
        shown = self.succeed("examine", folder, "--rig-time-s", 17, "--reports", self.folder / "mine").stdout
        self.assertIn("is no study and not empty", " ".join(shown.split()))
        self.assertTrue(notes.exists())

    def test_set_depends_on_the_seed(self):
        one = self.conceal("one", "--effect", "gain_error")
        two = self.conceal("two", "--effect", "gain_error")
        recording = "case-001/recording.csv"
        self.assertEqual((one / recording).read_bytes(), (two / recording).read_bytes())
        three = self.folder / "three"
        self.succeed("conceal", "--out", three, "--duration", 10, "--effect", "gain_error")
        self.assertNotEqual((one / recording).read_bytes(), (three / recording).read_bytes())

    def test_invalid_arguments_are_refused(self):
        result = self.fail_with(2, "conceal", "--out", self.folder / "x", "--effect", "gravity")
        self.assertIn("gravity", result.stderr)
        self.assertIn("cubic_stiffness", result.stderr)
        (self.folder / "full").mkdir()
        (self.folder / "full" / "a").write_text("")
        self.assertIn("not empty", self.fail_with(2, "conceal", "--out", self.folder / "full").stderr)
        self.assertIn("not empty", self.fail_with(2, "conceal", "--out", self.folder / "y", "--truth",
                                                  self.folder / "full").stderr)
        self.assertIn("no case", self.fail_with(2, "examine", self.folder / "full").stderr)


if __name__ == "__main__":
    main()
