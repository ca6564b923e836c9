# SPDX-License-Identifier: Apache-2.0
"""`stickslip estimate` on a simulated recording with known parameters: output, files and refusals."""

import csv
import json
import math
import re

from programs import SOURCE, EndToEnd, main, stickslip

TRUTH = SOURCE / "config/models/simulated-truth.toml"
DECLARED = SOURCE / "config/models/simulated.toml"


def drive(t):
    """Base motion of 3.2 Hz with a slow envelope."""
    return 0.009 * (0.55 - 0.45 * math.cos(0.7 * t)) * math.sin(2 * math.pi * 3.2 * t)


DIMENSIONLESS = """schema = 1
dimensionless = true
[oscillator]
excitation = "base"
mass_kg = 1.0
stiffness_n_m = { value = 1.0, sigma = 0.01 }
damping_n_s_m = 0.05
[normal_load]
law = "constant"
load_n = 1.0
[friction]
law = "coulomb"
mu = { value = 0.3, sigma = 0.05 }
transition_speed_m_s = 0.02
[sensors.displacement]
noise_std = 0.002
[sensors.velocity]
noise_std = 0.002
"""
UNITS = r"\d[ \u00a0](mm|\u00b5m|m|m/s|mm/s|N|mN|N/m|s|ms|Hz|kg|1/s)\b|\[(mm?|s|ms|Hz|m?N|m?m/s|1/s)\]"


SIGNED_ZERO = r"(?<![\w.+-])-0(\.0*)?(e[+-]?\d+)?(?![\w.])"


class Dimensionless(EndToEnd):
    """Results of a model whose units are all 1 name none."""

    def test_estimates_scores_and_diagnoses_have_no_units(self):
        model = self.write("model.toml", DIMENSIONLESS)
        driven = self.write("drive.csv", "time_s,base_displacement_m\n" + "".join(
            f"{k / 20},{0.9 * math.sin(0.04 * k):.8f}\n" for k in range(500)))
        run = self.folder / "run.csv"
        files = {name: self.folder / name for name in ("e.csv", "e.json", "s.json", "d.json", "d.html")}
        texts = [self.succeed(*command).stdout for command in (
            ("simulate", "--model", model, "--drive", driven, "--out", run),
            ("estimate", run, "--model", model, "--out", files["e.csv"], "--json", files["e.json"]),
            ("evaluate", run, "--model", model, "--free-run", "--json", files["s.json"]),
            ("diagnose", run, "--model", model, "--json", files["d.json"], "--html", files["d.html"]))]
        page = re.sub(r"<style>.*?</style>|<pre>.*?</pre>|<[^>]*>", " ", files["d.html"].read_text(),
                      flags=re.S)
        for text in (*texts, page):
            self.assertNotRegex(text, UNITS)
        self.assertTrue(files["e.csv"].read_text().startswith("time,displacement,displacement_std,velocity,"))
        for name in ("e.json", "s.json", "d.json"):
            self.assertIs(json.loads(files[name].read_text())["dimensionless"], True)
        for file in (run, *files.values()):
            self.assertNotRegex(file.read_text(), SIGNED_ZERO, file)
        # The same model in SI units has them.
        model.write_text(DIMENSIONLESS.replace("dimensionless = true\n", ""))
        self.assertRegex(self.succeed("evaluate", run, "--model", model).stdout, UNITS)


class Estimate(EndToEnd):
    def setUp(self):
        super().setUp()
        driven = self.folder / "drive.csv"
        driven.write_text("time_s,base_displacement_m\n" + "".join(
            f"{k / 1000:.3f},{drive(k / 1000):.9e}\n" for k in range(12000)))
        self.recording = self.folder / "run.csv"
        self.succeed("simulate", "--model", TRUTH, "--drive", driven, "--out", self.recording)

    def test_mu_and_gamma_are_identified(self):
        out = self.folder / "estimates.csv"
        summary = self.folder / "summary.json"
        text = self.succeed("estimate", self.recording, "--model", DECLARED, "--out", out,
                            "--json", summary).stdout
        self.assertIn("mu 0.8", text)
        found = json.loads(summary.read_text())
        # Declared: 0.8 and 150; the tolerance allows for the deliberately wrong spring.
        self.assertAlmostEqual(found["mu"]["mean"], 0.82, delta=0.02)
        self.assertAlmostEqual(found["gamma_per_s"]["mean"], 145.0, delta=25.0)
        self.assertGreater(found["good_frames"], 0.9 * found["frames"])

        with out.open() as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), found["frames"])
        with self.recording.open() as file:
            times = [float(row["time_s"]) for row in csv.DictReader(file)]
        self.assertEqual([float(row["time_s"]) for row in rows], times)
        for row in rows[::100]:
            self.assertLess(abs(float(row["theta"])), 1.2)
            self.assertGreater(float(row["theta_std"]), 0.0)
            self.assertTrue(0.0 <= float(row["sticking"]) <= 1.0)
            friction = float(row["theta"]) * float(row["mu"]) * float(row["normal_load_n"])
            self.assertAlmostEqual(friction, float(row["friction_force_n"]), delta=0.02)

    def test_better_model_has_the_lower_nll(self):
        nll = []
        for model in (TRUTH, DECLARED):
            summary = self.folder / "nll.json"
            self.succeed("estimate", self.recording, "--model", model, "--json", summary)
            nll.append(json.loads(summary.read_text())["nll_per_reading"])
        self.assertLess(nll[0], nll[1])

    def test_diagnosed_sensor_errors_are_corrected(self):
        wrong = self.folder / "wrong.toml"
        wrong.write_text(TRUTH.read_text() + """
[[physics]]
id = "channel_delay"
channel = "friction_force"
delay_s = 0.006

[[physics]]
id = "gain_error"
channel = "velocity"
gain = 0.8

[[physics]]
id = "mains_hum"
channel = "displacement"
frequency_hz = 50.0
amplitude = 0.0005
phase_rad = 1.0
""")
        recording = self.folder / "wrong.csv"
        self.succeed("simulate", "--model", wrong, "--drive", self.folder / "drive.csv",
                     "--out", recording)
        found = {}
        for name, model, run in (("ideal", TRUTH, self.recording), ("corrected", wrong, recording),
                                 ("uncorrected", TRUTH, recording)):
            summary = self.folder / "found.json"
            self.succeed("estimate", run, "--model", model, "--json", summary)
            found[name] = json.loads(summary.read_text())
        self.assertAlmostEqual(found["corrected"]["mu"]["mean"], found["ideal"]["mu"]["mean"],
                               delta=0.002)
        self.assertAlmostEqual(found["corrected"]["nll_per_reading"],
                               found["ideal"]["nll_per_reading"], delta=0.2)
        self.assertGreater(found["uncorrected"]["nll_per_reading"],
                           found["corrected"]["nll_per_reading"] + 10.0)

    def test_table_on_standard_output(self):
        table = self.succeed("estimate", self.recording, "--model", DECLARED, "--out", "-").stdout
        self.assertTrue(table.startswith("time_s,displacement_m,displacement_m_std,"), table[:80])

    def test_unsupported_model_is_refused_with_a_reason(self):
        stiff = self.folder / "stiff.toml"
        stiff.write_text(DECLARED.read_text().replace("natural_frequency_hz = 19.3",
                                                      "natural_frequency_hz = 19.3e3"))
        result = stickslip("estimate", self.recording, "--model", stiff)
        self.assertEqual(result.returncode, 2)
        self.assertIn(f"{stiff}: the sampling period of", result.stderr)
        self.assertIn("sample faster", result.stderr)

    def test_imposed_motion_is_supported(self):
        imposed = self.folder / "imposed.toml"
        imposed.write_text("""schema = 1
[oscillator]
excitation = "imposed"
[friction]
law = "coulomb"
mu = 0.1
transition_speed_m_s = 0.01
""")
        table = self.succeed("estimate", self.recording, "--model", imposed, "--out", "-").stdout
        self.assertIn(",mu,", table.splitlines()[0])
        self.assertGreater(len(table.splitlines()), 1000)


if __name__ == "__main__":
    main()
