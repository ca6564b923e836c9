# SPDX-License-Identifier: Apache-2.0
"""Formulas of a model file on the command line: a simulated rig moves as with the built-in effect, a
diagnosis calibrates a declared formula, names the candidate that a recording needs, and errors have a place."""
import unittest

from drives import modulated_sweep
from programs import EndToEnd, main, read_json, stickslip

RIG = """schema = 1
[oscillator]
excitation = "force"
mass_kg = 1.0
natural_frequency_hz = 2.5
damping_ratio = 0.01
[friction]
law = "coulomb"
mu = 0.2
transition_speed_m_s = 0.002
[sensors.displacement]
noise_std = 2.0e-5
[sensors.velocity]
noise_std = 5.0e-4
[sensors.friction_force]
noise_std = 2.0e-3
[sensors.normal_load]
noise_std = 2.0e-3
"""
DRAG = """
[[physics]]
id = "{id}"
force = "c*v*abs(v)"
parameters = {{ c = {{ value = {value}, sigma = {sigma}, unit = "N s^2/m^2" }} }}
"""
BUILT_IN = """
[[physics]]
id = "quadratic_drag"
drag_n_s2_m2 = 3.0
"""
# Of no effect of the catalogue: drag within a few millimetres of one place of the rail.
JOINT = """
[[{table}]]
id = "rail_joint"
force = "f0*v*exp(-((x - x0)/width)^2)"
parameters.f0 = {{ value = {f0}, unit = "N s/m" }}
parameters.x0 = {{ value = {x0}, unit = "m" }}
parameters.width = {{ value = 0.003, unit = "m" }}
"""
DRIVE = modulated_sweep(16, 1.2, 0.8, 2.1)


class Formulas(EndToEnd):
    def simulate(self, name, model, seed=1):
        recording = self.folder / f"{name}.csv"
        self.succeed("simulate", "--model", self.write(f"{name}.toml", model), "--drive",
                     self.write("drive.csv", DRIVE), "--out", recording, "--seed", seed)
        return recording

    def diagnose(self, recording, model, *more):
        report = self.folder / "report.json"
        report.unlink(missing_ok=True)
        self.succeed("diagnose", recording, "--model", model, "--json", report, *more)
        return read_json(report)

    def test_a_rig_moves_as_with_the_built_in_effect(self):
        formula = self.simulate("formula", RIG + DRAG.format(id="mine", value=3.0, sigma=0.0))
        built_in = self.simulate("built_in", RIG + BUILT_IN)
        ours = [line.split(",") for line in formula.read_text().splitlines() if line[0].isdigit()]
        theirs = [line.split(",") for line in built_in.read_text().splitlines() if line[0].isdigit()]
        self.assertEqual(len(ours), len(theirs))
        self.assertGreater(len(ours), 1000)
        for one, other in zip(ours, theirs):
            for a, b in zip(one, other):
                if a and b:
                    self.assertAlmostEqual(float(a), float(b), delta=1e-9)

    def test_the_coefficient_of_a_declared_formula_is_found(self):
        recording = self.simulate("truth", RIG + BUILT_IN)
        model = self.write("model.toml", RIG + DRAG.format(id="mine", value=2.0, sigma=2.0))
        augmented = self.folder / "augmented.toml"
        report = self.diagnose(recording, model, "--write-model", augmented)
        self.assertEqual(report["verdict"], "consistent")
        found = report["calibration"]["physics.mine.c"]
        self.assertAlmostEqual(found["value"], 3.0, delta=0.15)
        self.assertEqual(found["unit"], "N s^2/m^2")
        text = augmented.read_text()
        self.assertIn('force = "c*v*abs(v)"', text)
        self.assertRegex(text, r'c = \{ value = [23]\.\d+, sigma = 0\.\d+, unit = "N s\^2/m\^2" \}')
        self.succeed("check", augmented)
        evaluation = self.folder / "evaluation.json"
        self.succeed("evaluate", recording, "--model", augmented, "--json", evaluation)
        self.assertLess(read_json(evaluation)["fit"]["chi2_per_sample"], 1.3)
        self.succeed("estimate", recording, "--model", augmented, "--out", self.folder / "estimate.csv")

    def test_a_candidate_that_the_recording_needs_is_named(self):
        recording = self.simulate("truth", RIG + JOINT.format(table="physics", f0=4.0, x0=0.012))
        model = self.write("model.toml", RIG)
        candidates = self.write("candidates.toml", "schema = 1\n" +
                                JOINT.format(table="candidate", f0=1.0, x0=0.01))
        self.succeed("check", candidates)
        augmented = self.folder / "augmented.toml"
        report = self.diagnose(recording, model, "--candidates", candidates, "--write-model", augmented)
        self.assertEqual([finding["id"] for finding in report["findings"]], ["rail_joint"])
        found = report["findings"][0]["parameters"]
        self.assertAlmostEqual(found["f0"]["value"], 4.0, delta=0.4)
        self.assertAlmostEqual(found["x0"]["value"], 0.012, delta=0.001)
        self.assertEqual(found["f0"]["unit"], "N s/m")
        self.assertEqual(report["findings"][0]["relation"], "force_balance")
        self.assertIn("--candidates candidates.toml", report["provenance"]["command"])
        self.assertIn("candidates.toml", report["provenance"]["sha256"])
        self.assertIn("exp(-((x - x0)/width)^2)", augmented.read_text())
        self.succeed("check", augmented)

    def test_an_error_has_a_line_and_a_column(self):
        model = self.write("bad.toml", RIG + '[[physics]]\nid = "a"\nforce = "2*q*v"\n')
        lines = (RIG + '[[physics]]\nid = "a"\nforce').count("\n") + 1
        result = self.run_to_fail("simulate", "--model", model, "--drive", self.write("drive.csv", DRIVE))
        self.assertIn(f"bad.toml:{lines}:12: physics.a.force: unknown symbol q", result)

    def run_to_fail(self, *arguments):
        result = stickslip(*arguments)
        self.assertEqual(result.returncode, 2)
        self.assertEqual(len(result.stderr.splitlines()), 1)
        return result.stderr


if __name__ == "__main__":
    main()
