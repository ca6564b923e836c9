# SPDX-License-Identifier: Apache-2.0
"""Published recordings of real rigs, each with a model that lacks an effect. They state no licence and
are not part of this project: they are expected in $STICKSLIP_SHARED/recordings or ../shared/recordings;
without them these tests are skipped."""
import unittest

from contract import faults_of_diagnosis, faults_of_evaluation
from programs import PATIENCE_S, EndToEnd, main, read_json, shared_folder

SHARED = shared_folder()
CONFIDENT = 0.9


@unittest.skipUnless(SHARED, "no published recordings: set STICKSLIP_SHARED")
class RealRecordings(EndToEnd):
    diagnoses = {}  # report and augmented model by recording, each made once

    def diagnose(self, name):
        """The report and the text of the augmented model."""
        if name in self.diagnoses:
            return self.diagnoses[name]
        folder = SHARED / "recordings" / name
        if not (folder / "recording.csv").is_file():
            self.skipTest(f"no {name} in {SHARED / 'recordings'}")
        out = self.folder / f"{name}.json"
        result = self.succeed("diagnose", folder / "recording.csv", "--model", folder / "model.toml",
                              "--json", out, "--write-model", self.folder / f"{name}.toml",
                              timeout=PATIENCE_S)
        report = read_json(out)
        self.assertEqual(faults_of_diagnosis(report), [])
        print(result.stdout)
        augmented = self.folder / f"{name}.toml"
        self.diagnoses[name] = report, augmented.read_text()
        return self.diagnoses[name]

    def test_emps_dry_friction_first_within_ten_percent_of_the_published_force(self):
        report, _ = self.diagnose("emps")
        self.assertEqual(report["verdict"], "missing_physics")
        first = report["findings"][0]
        self.assertEqual(first["id"], "dry_friction")
        self.assertAlmostEqual(first["parameters"]["friction_force_n"]["value"], 20.4, delta=2.04)
        before, after = (report["fit"]["heldout"][side]["nrmse"]["displacement"]
                         for side in ("baseline", "augmented"))
        self.assertLessEqual(after, 0.5 * before)

    def test_emps_second_effect_is_the_published_constant_force(self):
        """3.165 N; below 95 %, the report gives alternatives and a separating experiment."""
        report, _ = self.diagnose("emps")
        second = report["findings"][1]
        self.assertEqual(second["id"], "bias_force")
        self.assertAlmostEqual(abs(second["parameters"]["force_n"]["value"]), 3.165, delta=0.32)
        if second["probability"] < 0.95:
            self.assertTrue(second["alternatives"])
            self.assertTrue(second["separating_experiment"])

    def test_emps_augmented_model_is_accepted_by_the_other_tools(self):
        _, text = self.diagnose("emps")
        augmented = self.write("emps-augmented.toml", text)
        self.succeed("check", augmented)
        out = self.folder / "evaluation.json"
        self.succeed("evaluate", SHARED / "recordings/emps/recording.csv", "--model", augmented,
                     "--json", out, "--horizon", 1.0, timeout=PATIENCE_S)
        evaluation = read_json(out)
        self.assertEqual(faults_of_evaluation(evaluation), [])
        # Published models: about 2.0 mm one second ahead, 5.6 mm without dry friction.
        self.assertLess(evaluation["fit"]["rmse"]["displacement_m"], 2.8e-3)

    def test_air_track_has_no_dry_friction(self):
        report, _ = self.diagnose("air-track")
        self.assertNotIn("dry_friction", [finding["id"] for finding in report["findings"]])

    def test_bouc_wen_mismatch_is_located_without_false_claims(self):
        report, _ = self.diagnose("bouc-wen")
        self.assertIn(report["verdict"], ("missing_physics", "unexplained"))
        self.assertIn(report["location"]["relation"], ("force_balance", "friction_law"))
        claimed = {finding["id"] for finding in report["findings"]
                   if finding["probability"] >= CONFIDENT}
        self.assertLessEqual(claimed, {"hysteresis", "contact_compliance", "unlisted"})

    def test_friction_frame_has_the_published_dry_friction(self):
        forces = {}
        for disc in ("250g", "450g"):
            report, _ = self.diagnose(f"friction-frame-{disc}")
            first = report["findings"][0]
            self.assertEqual(first["id"], "dry_friction")
            forces[disc] = first["parameters"]["friction_force_n"]["value"]
        self.assertAlmostEqual(forces["250g"], 0.63, delta=0.13)
        self.assertAlmostEqual(forces["450g"], 1.3, delta=0.26)


if __name__ == "__main__":
    main()
