# SPDX-License-Identifier: Apache-2.0
"""A campaign on the command line: two loads give one coefficient of friction, a third one is predicted, and
its model can be written for any load; a concealed campaign is made, examined and graded."""
import math
import re

from programs import PATIENCE_S, EndToEnd, main, read_json, stickslip

MODEL = """schema = 1
[oscillator]
excitation = "force"
mass_kg = 1.0
stiffness_n_m = {{ value = 158.0, sigma = 5.0 }}
damping_n_s_m = {{ value = 0.5, sigma = 0.2 }}
[friction]
law = "{law}"
{mu}
[sensors.displacement]
noise_std = 2.0e-5
gain = 1.0
delay_s = 0.0
[sensors.drive_force]
gain = 1.0
offset = 0.0
"""
COEFFICIENT = 0.3
RECORDING = """
[[recording]]
name = "{load} N"
file = "{load}.csv"
conditions = {{ load_n = {load} }}
"""
SECONDS = 12


def drive(phase):
    lines = ["time_s,drive_force_n"]
    for i in range(SECONDS * 200 + 1):
        t = i / 200
        force = 1.5 * (1 - math.cos(t * math.pi / 3)) * math.sin(4 * math.pi * t + phase) + math.sin(4.4 * t)
        lines.append(f"{t:.3f},{force:.9f}")
    return "\n".join(lines) + "\n"


class Campaigns(EndToEnd):
    def record(self, load):
        truth = MODEL.format(law="coulomb", mu=f"mu = {COEFFICIENT * load}\ntransition_speed_m_s = 0.002")
        self.succeed("simulate", "--model", self.write(f"{load}.toml", truth), "--drive",
                     self.write(f"drive-{load}.csv", drive(load)), "--out", self.folder / f"{load}.csv",
                     "--seed", int(10 * load))
        text = (self.folder / f"{load}.csv").read_text().splitlines()
        wanted = [text[0].split(",").index(name) for name in ("time_s", "displacement_m", "drive_force_n")]
        rows = [",".join(row.split(",")[i] for i in wanted) for row in text]
        (self.folder / f"{load}.csv").write_text("\n".join(rows) + "\n")

    def campaign(self, more=""):
        self.write("model.toml", MODEL.format(law="none", mu=""))
        text = 'schema = 1\nmodel = "model.toml"\n' + more
        return self.write("campaign.toml", text + "".join(RECORDING.format(load=x) for x in (1.0, 2.0, 1.5)))

    def test_two_loads_give_the_coefficient_and_predict_a_third(self):
        for load in (1.0, 2.0, 1.5):
            self.record(load)
        campaign = self.campaign()
        report, page, model = (self.folder / name for name in ("r.json", "r.html", "at.toml"))
        text = self.succeed("diagnose", "--campaign", campaign, "--hold-out", "1.5 N", "--json", report, "--html",
                            page, "--write-model", model, "--at", "load_n=4", timeout=PATIENCE_S).stdout
        json = read_json(report)
        self.assertEqual([each["id"] for each in json["findings"]], ["dry_friction"], text)
        found = [each for each in json["campaign"]["comparisons"] if each["finding"] == 0][0]
        self.assertEqual((found["sharing"], found["condition"]), ("proportional", "load_n"), text)
        self.assertAlmostEqual(found["trend"]["value"], COEFFICIENT, delta=0.015)
        self.assertTrue(found["heterogeneity"]["tenable"])
        self.assertEqual([each["name"] for each in found["recordings"]], ["1.0 N", "2.0 N"])
        held_out = json["campaign"]["held_out"][0]
        self.assertEqual(held_out["name"], "1.5 N")
        self.assertLess(held_out["augmented"]["rmse"]["displacement_m"],
                        0.3 * held_out["baseline"]["rmse"]["displacement_m"])
        self.assertIn("Recordings compared", page.read_text())
        self.assertRegex(text, r"held out, 1\.5 N: RMS error .* ahead; displacement")
        force = float(re.search(r"friction_force_n = \{ value = ([0-9.e-]+)", model.read_text())[1])
        self.assertAlmostEqual(force, 4 * COEFFICIENT, delta=0.08)

    def test_errors_name_file_line_and_cure(self):
        campaign = self.campaign('[[number]]\npath = "oscillator.stifness_n_m"\nsharing = "own"\n')
        result = stickslip("diagnose", "--campaign", campaign)
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, r"campaign\.toml:4:\d+: .*did you mean oscillator\.stiffness_n_m\?")
        campaign = self.campaign()
        result = stickslip("diagnose", "--campaign", campaign, "--hold-out", "3 N")
        self.assertEqual(result.returncode, 2)
        self.assertIn('"3 N" is no recording of', result.stderr)
        for arguments in (["diagnose"], ["diagnose", "a.csv"], ["diagnose", "a.csv", "--campaign", campaign],
                          ["diagnose", "--hold-out", "1.0 N"]):
            self.assertEqual(stickslip(*arguments).returncode, 2, arguments)
        self.assertIn("1.5 N", self.succeed("check", campaign).stdout)

    def test_concealed_campaign_is_made_examined_and_graded(self):
        folder = self.folder / "set"
        self.succeed("conceal", "--out", folder, "--campaign", "--effect", "faulty_channel", "--count", 1,
                     "--duration", 10, "--seed", 2)
        self.assertTrue((folder / "case-001" / "run-4" / "recording.csv").exists())
        grades = self.folder / "grades.json"
        self.succeed("examine", folder, "--json", grades)
        cases = read_json(grades)["cases"]
        self.assertEqual([case["problem"] for case in cases], [""])
        jobs = self.succeed("examine", folder, "--alone", "--job-list", "-").stdout.splitlines()
        self.assertEqual(len(jobs), 4)


if __name__ == "__main__":
    main()
