# SPDX-License-Identifier: Apache-2.0
"""`stickslip laws` on the command line: a recording of a LuGre contact, whose numbers the model does not
know, is distinguished from Coulomb's law, and the page and the model of the preferred law are written."""
import unittest
import xml.etree.ElementTree

from drives import modulated_sweep
from programs import PATIENCE_S, EndToEnd, main, read_json

RIG = """schema = 1
[oscillator]
excitation = "force"
mass_kg = 1.0
natural_frequency_hz = 2.5
damping_ratio = 0.01
[friction]
{friction}
[sensors.displacement]
noise_std = 4.0e-5
gain = 1.0
offset = 0.0
delay_s = 0.0
[sensors.velocity]
noise_std = 4.0e-3
gain = 1.0
offset = 0.0
delay_s = 0.0
[sensors.friction_force]
noise_std = 3.0e-2
gain = 1.0
offset = 0.0
delay_s = 0.0
[sensors.drive_force]
gain = 1.0
offset = 0.0
delay_s = 0.0
"""
TRUTH = {"mu": 0.8, "mu_static": 1.1, "stribeck_speed_m_s": 0.02, "stiffness_n_m": 4000.0,
         "damping_n_s_m": 20.0, "viscosity_n_s_m": 0.5}
LUGRE = 'law = "lugre"\n' + "".join(f"{name} = {value}\n" for name, value in TRUTH.items())
GUESS = 'law = "coulomb"\nmu = { value = 0.6, sigma = 0.3 }\ntransition_speed_m_s = 0.002\n'
DRIVE = modulated_sweep(20, 1.6, 1.1, 1.6)


class Laws(EndToEnd):
    def test_a_lugre_contact_is_recognised_with_its_numbers(self):
        truth = self.write("truth.toml", RIG.format(friction=LUGRE))
        model = self.write("model.toml", RIG.format(friction=GUESS))
        recording, result = self.folder / "run.csv", self.folder / "laws.json"
        page, preferred = self.folder / "laws.html", self.folder / "preferred.toml"
        self.succeed("simulate", "--model", truth, "--drive", self.write("drive.csv", DRIVE),
                     "--out", recording)
        text = self.succeed("laws", recording, "--model", model, "--json", result, "--html", page,
                            "--write-model", preferred, timeout=PATIENCE_S).stdout
        laws = {each["law"]: each for each in read_json(result)["laws"]}
        self.assertEqual(len(laws), 10)
        first = read_json(result)["laws"][0]
        alike = [name for name, each in laws.items() if not each["distinguished"]]
        self.assertIn("lugre", alike, text)
        self.assertTrue(laws["coulomb"]["distinguished"], text)
        self.assertTrue(laws["none"]["distinguished"], text)
        self.assertLess(laws["coulomb"]["score"]["value"], -10.0)
        for name in alike[1:]:
            self.assertTrue(laws[name]["separating_experiment"], name)
        fitted = laws["lugre"]["parameters"]
        for name in ("mu", "mu_static", "stribeck_speed_m_s", "stiffness_n_m"):
            low, high = fitted[name]["ci95"]
            # Three standard deviations: of four intervals of 95 %, one in five recordings has a miss.
            with self.subTest(parameter=name):
                self.assertLess(abs(fitted[name]["value"] - TRUTH[name]), 1.5 * (high - low) / 2)
                self.assertLess(high - low, 0.1 * TRUTH[name])
        self.assertIn(first["law"], text.splitlines()[0])
        root = xml.etree.ElementTree.fromstring(page.read_text().split("\n", 1)[1])
        self.assertEqual(len([each for each in root.iter() if each.tag.endswith("svg")]), 4)
        self.assertIn(f'law = "{first["law"]}"', preferred.read_text())
        self.succeed("evaluate", recording, "--model", preferred)
        self.succeed("estimate", recording, "--model", preferred, "--out", self.folder / "estimate.csv")


if __name__ == "__main__":
    main()
