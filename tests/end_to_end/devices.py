# SPDX-License-Identifier: Apache-2.0
"""`stickslip devices` and `check --live` on this host, with any attached devices: valid output, and
messages about absent devices. Output for present devices is tested in tests/vm."""
import json

from programs import EndToEnd, SOURCE, main, run, STICKSLIP


class Devices(EndToEnd):
    def test_attached_devices_are_listed_as_text_and_json(self):
        listed = run(STICKSLIP, "devices", "--json")
        devices = json.loads(listed.stdout)["devices"]
        for device in devices:
            self.assertEqual(set(device), {"kind", "name", "serial", "where", "speaks", "trouble"})
            self.assertEqual(device["speaks"], not device["trouble"])
        self.assertEqual(listed.returncode, 0 if all(device["speaks"] for device in devices) else 1)
        text = run(STICKSLIP, "devices").stdout
        for device in devices:
            self.assertIn(device["name"], text)
        self.assertTrue(devices or "No board" in text)

    def test_an_absent_bench_fails_for_each_device(self):
        rig = self.write("rig.toml", (SOURCE / "config/bench-u6.toml").read_text()
                         .replace('"models/', f'"{SOURCE}/config/models/')
                         .replace('"modbus/', f'"{SOURCE}/config/modbus/')
                         .replace("/dev/ttyUSB0", str(self.folder / "no-such-line")))
        result = run(STICKSLIP, "check", "--live", rig)
        self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
        self.assertEqual(result.stdout.count("FAILS: "), 3, result.stdout)
        self.assertIn("no-such-line", result.stdout)

    def test_a_rig_without_devices_cannot_be_probed(self):
        result = run(STICKSLIP, "check", "--live", SOURCE / "config/simulated.toml")
        self.assertEqual(result.returncode, 2)
        self.assertIn('driver.kind = "bench"', result.stderr)


if __name__ == "__main__":
    main()
