"""`stickslip estimate` on a simulated recording with known parameters: output, files and refusals."""

import csv
import json
import math

from programs import SOURCE, EndToEnd, main, stickslip

TRUTH = SOURCE / "config/models/simulated-truth.toml"
DECLARED = SOURCE / "config/models/simulated.toml"


def drive(t):
    """Base motion of 3.2 Hz with a slow envelope."""
    return 0.009 * (0.55 - 0.45 * math.cos(0.7 * t)) * math.sin(2 * math.pi * 3.2 * t)


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
        imposed = self.folder / "imposed.toml"
        imposed.write_text("""schema = 1
[oscillator]
excitation = "imposed"
[friction]
law = "coulomb"
mu = 1.0
transition_speed_m_s = 0.01
""")
        result = stickslip("estimate", self.recording, "--model", imposed)
        self.assertEqual(result.returncode, 2)
        self.assertIn(f"{imposed}: the observer needs a force balance", result.stderr)


if __name__ == "__main__":
    main()
