# SPDX-License-Identifier: Apache-2.0
"""`stickslip config`: every key of a rig with its value and origin."""
import json

from programs import SOURCE, EndToEnd, main, stickslip

RIG = SOURCE / "config/simulated.toml"


class RigExplained(EndToEnd):
    def explained(self, *arguments):
        return self.succeed("config", *arguments).stdout

    def test_output_is_an_equivalent_rig(self):
        text = self.explained(RIG)
        again = self.write("again.toml", text)
        self.succeed("check", again)
        values = self.keys(RIG)
        for path, key in self.keys(again).items():
            self.assertEqual(key["toml"], values[path]["toml"], path)

    def keys(self, rig):
        report = json.loads(self.explained(rig, "--json"))
        self.assertEqual(report["schema"], 1)
        return {key["key"]: key for key in report["keys"]}

    def test_each_value_has_its_origin(self):
        keys = self.keys(RIG)
        lines = RIG.read_text().splitlines()
        stated = [key for key in keys.values() if key["stated"]]
        self.assertGreater(len(stated), 10)
        for key in stated:
            self.assertIn(key["key"].split(".")[-1], lines[key["line"] - 1])
        self.assertFalse(keys["lcm.url"]["stated"])
        self.assertIsNone(keys["lcm.url"]["line"])

    def test_explanation_of_one_key(self):
        text = self.explained(RIG, "--explain", "excitation.carrier_hz")
        self.assertTrue(text.startswith("excitation.carrier_hz = 3.2\n"), text)
        for part in ("simulated.toml:", "number [Hz], above 0 to 1000", "Frequency of the drive", "2.5",
                     "SIGHUP"):
            self.assertIn(part, text)
        self.assertIn("needs a restart", self.explained(RIG, "--explain", "loop.rate_hz"))

    def test_explanation_of_a_table_and_of_everything(self):
        table = self.explained(RIG, "--explain", "loop")
        self.assertEqual(table.count("\n  meaning "), 7)
        self.assertIn(table.strip(), self.explained(RIG, "--explain"))

    def test_unknown_key_is_an_error_with_a_suggestion(self):
        result = stickslip("config", RIG, "--explain", "excitation.carier_hz")
        self.assertEqual(result.returncode, 2)
        self.assertEqual(result.stderr.strip(), 'stickslip: config: there is no key '
                         '"excitation.carier_hz": did you mean excitation.carrier_hz?')

    def test_invalid_rig_is_refused_with_its_line(self):
        rig = self.write("rig.toml", RIG.read_text().replace("carrier_hz = 3.2", "carrier_hz = -1"))
        for name in ("simulated", "simulated-truth"):
            (self.folder / "models").mkdir(exist_ok=True)
            self.write(f"models/{name}.toml", (SOURCE / f"config/models/{name}.toml").read_text())
        result = stickslip("config", rig)
        self.assertEqual(result.returncode, 2)
        self.assertIn("rig.toml:33:", result.stderr)
        self.assertEqual(result.stdout, "")


if __name__ == "__main__":
    main()
