"""`stickslip devices` and `check --live` on this machine, whatever is attached to it: what they say is
sound, and what is not there is told in words. What they say of devices is seen in tests/vm."""
import json

from programs import EndToEnd, SOURCE, main, run, STICKSLIP


class Devices(EndToEnd):
    def test_what_is_attached_is_listed_for_people_and_programs(self):
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

    def test_a_bench_that_is_not_there_fails_device_by_device(self):
        rig = self.write("rig.toml", (SOURCE / "config/bench-u6.toml").read_text()
                         .replace('"models/', f'"{SOURCE}/config/models/')
                         .replace('"modbus/', f'"{SOURCE}/config/modbus/')
                         .replace("/dev/ttyUSB0", str(self.folder / "no-such-line")))
        result = run(STICKSLIP, "check", "--live", rig)
        self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
        self.assertEqual(result.stdout.count("FAILS: "), 3, result.stdout)
        self.assertIn("no-such-line", result.stdout)

    def test_a_rig_without_devices_has_nothing_to_try(self):
        result = run(STICKSLIP, "check", "--live", SOURCE / "config/simulated.toml")
        self.assertEqual(result.returncode, 2)
        self.assertIn('driver.kind = "bench"', result.stderr)


if __name__ == "__main__":
    main()
