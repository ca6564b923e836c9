"""Real rigs that others measured, each with a model from which a physics was left out. The
recordings state no licence and are not part of this project: STICKSLIP_SHARED names the folder that
holds recordings/emps and the others, or ../shared does; without them these tests are skipped."""
import unittest

from contract import faults_of_diagnosis, faults_of_evaluation
from programs import EndToEnd, main, read_json, shared_folder

SHARED = shared_folder()
CONFIDENT = 0.9


@unittest.skipUnless(SHARED, "no recordings of others here: set STICKSLIP_SHARED")
class RealRecordings(EndToEnd):
    diagnoses = {}  # by recording: the report and the mended model, so that each is made once

    def diagnose(self, name):
        """The report, and the mended model's text."""
        if name in self.diagnoses:
            return self.diagnoses[name]
        folder = SHARED / "recordings" / name
        if not (folder / "recording.csv").is_file():
            self.skipTest(f"no {name} in {SHARED / 'recordings'}")
        out = self.folder / f"{name}.json"
        result = self.succeed("diagnose", folder / "recording.csv", "--model", folder / "model.toml",
                              "--json", out, "--write-model", self.folder / f"{name}.toml",
                              timeout=300)
        report = read_json(out)
        self.assertEqual(faults_of_diagnosis(report), [])
        print(result.stdout)
        mended = self.folder / f"{name}.toml"
        self.diagnoses[name] = report, mended.read_text()
        return self.diagnoses[name]

    def test_emps_dry_friction_first_within_a_tenth_of_its_published_force(self):
        report, _ = self.diagnose("emps")
        self.assertEqual(report["verdict"], "missing_physics")
        first = report["findings"][0]
        self.assertEqual(first["id"], "dry_friction")
        self.assertAlmostEqual(first["parameters"]["friction_force_n"]["value"], 20.4, delta=2.04)
        before, after = (report["fit"]["heldout"][side]["nrmse"]["displacement"]
                         for side in ("baseline", "augmented"))
        self.assertLessEqual(after, 0.5 * before)

    def test_emps_second_effect_is_the_published_constant_force(self):
        """3.165 N; where it is not sure, the report says what else it may be and which run would
        tell."""
        report, _ = self.diagnose("emps")
        second = report["findings"][1]
        self.assertEqual(second["id"], "bias_force")
        self.assertAlmostEqual(abs(second["parameters"]["force_n"]["value"]), 3.165, delta=0.32)
        if second["probability"] < 0.95:
            self.assertTrue(second["alternatives"])
            self.assertTrue(second["separating_experiment"])

    def test_emps_mended_model_is_accepted_by_the_other_tools(self):
        _, text = self.diagnose("emps")
        mended = self.write("emps-mended.toml", text)
        self.succeed("check", mended)
        out = self.folder / "evaluation.json"
        self.succeed("evaluate", SHARED / "recordings/emps/recording.csv", "--model", mended,
                     "--json", out, "--horizon", 1.0, timeout=300)
        evaluation = read_json(out)
        self.assertEqual(faults_of_evaluation(evaluation), [])
        # Published models reach about 2.0 mm one second ahead, without dry friction 5.6 mm.
        self.assertLess(evaluation["fit"]["rmse"]["displacement_m"], 2.8e-3)

    def test_air_track_has_no_dry_friction(self):
        report, _ = self.diagnose("air-track")
        self.assertNotIn("dry_friction", [finding["id"] for finding in report["findings"]])

    def test_bouc_wen_mismatch_is_located_and_nothing_false_is_claimed(self):
        report, _ = self.diagnose("bouc-wen")
        self.assertIn(report["verdict"], ("missing_physics", "unexplained"))
        self.assertIn(report["location"]["relation"], ("force_balance", "friction_law"))
        claimed = {finding["id"] for finding in report["findings"]
                   if finding["probability"] >= CONFIDENT}
        self.assertLessEqual(claimed, {"hysteresis", "contact_compliance", "unlisted"})

    def test_friction_frame_rubs(self):
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
