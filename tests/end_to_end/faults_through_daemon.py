# SPDX-License-Identifier: Apache-2.0
"""Injected faults in recordings: lost frames leave gaps, channels that are not finite are invalid, a
disconnected device ends the run with its reason. The same script gives the same recording, to the bit."""
import csv
import hashlib
import json
import re
import unittest

import frames
from programs import SOURCE, STICKSLIPD, EndToEnd, main, run

FRICTION_FORCE = 2


class FaultsThroughTheDaemon(EndToEnd):
    def setUp(self):
        super().setUp()
        self.types = frames.generate_types(self.folder)

    def daemon(self, faults, name):
        """The daemon on the simulated rig, five seconds as fast as possible: (result, frames)."""
        self.write("script.toml", "schema = 1\nseed = 3\n" + faults)
        config = self.write("rig.toml", f"""
            schema = 1
            [rig]
            name = "faulty"
            model = "{SOURCE}/config/models/simulated.toml"
            [driver]
            kind = "simulated"
            faults = "script.toml"
            [driver.simulated]
            real_time = false
            """)
        log = self.folder / f"{name}.log"
        result = run(STICKSLIPD, "--config", config, "--no-lcm", "--record", log, "--duration", 5)
        return result, frames.frames(log, self.types)

    def test_a_clock_that_jumps_is_found_and_does_not_change_the_rate(self):
        shipped = (SOURCE / "config/faults/clock_jump.toml").read_text().split("schema = 1", 1)[1]
        result, _ = self.daemon(shipped, "jump")
        log = self.folder / "jump.log"
        self.assertIn("jump.log: with gaps\n  ", self.succeed("log", "check", log).stdout)
        text = self.succeed("log", "info", log).stdout
        self.assertRegex(text, r"gap +the time steps by 5\.\d+ s after 1\.99\d s")
        info = json.loads(self.succeed("log", "info", log, "--json").stdout)
        self.assertAlmostEqual(info["rate_hz"], 1000.0, delta=1.0)
        self.assertEqual(len(info["time_steps"]), 1, result.stderr)
        exported = self.folder / "jump.csv"
        self.succeed("log", "export", log, exported)
        lines = exported.read_text().splitlines()
        self.assertRegex("\n".join(lines), r"\n# time_steps: the time steps by 5\.\d+ s after 1\.99")
        rows = csv.DictReader(line for line in lines if not line.startswith("#"))
        after = info["time_steps"][0]["after_sequence"]
        self.assertEqual([int(row["sequence"]) for row in rows if row["gap"] == "1"], [after + 1])

    def test_lost_frames_leave_gaps_and_the_ledger_balances(self):
        script = '[[fault]]\nkind = "drop"\nat_s = 1.0\nduration_s = 2.0\nprobability = 0.1\n'
        result, recording = self.daemon(script, "drop")
        self.assertEqual(result.returncode, 0, result.stderr)  # else the ledger does not balance
        self.assertEqual(len(recording), 5000)
        sequences = [frame.sequence for frame in recording]
        self.assertEqual(sequences, sorted(set(sequences)))
        lost = sorted(set(range(sequences[-1] + 1)) - set(sequences))
        self.assertTrue(all(1000 <= sequence < 3000 for sequence in lost), lost)
        # Five standard deviations of a binomial distribution.
        self.assertLess(abs(len(lost) - 200), 5 * (2000 * 0.1 * 0.9) ** 0.5)
        # Two hundred gaps, reported at most once a second.
        self.assertLess((result.stdout + result.stderr).count("the source lost"), 10)
        _, again = self.daemon(script, "again")
        self.assertEqual(recording, again)

    def test_the_recording_contains_its_fault_script(self):
        self.daemon('[[fault]]\nkind = "drop"\nat_s = 1.0\nduration_s = 0.1\n', "injected")
        log = self.folder / "injected.log"
        script = (self.folder / "script.toml").read_text()
        output = self.succeed("log", "info", log).stdout
        digest = hashlib.sha256(script.encode()).hexdigest()
        self.assertRegex(output, rf"(?m)^  fault script +SHA-256 {digest}, verified$")
        info = json.loads(self.succeed("log", "info", log, "--json").stdout)
        self.assertEqual(info["texts"]["fault_script"]["sha256"], digest)

    def test_values_that_are_not_finite_are_invalid(self):
        result, recording = self.daemon('[[fault]]\nkind = "nan"\nchannel = "friction_force"\n'
                                        'at_s = 2.0\nduration_s = 0.5\n', "nan")
        self.assertEqual(result.returncode, 0, result.stderr)
        for frame in recording:
            valid = frame.valid >> FRICTION_FORCE & 1 == 1
            self.assertEqual(valid, not 2000 <= frame.sequence < 2500, frame.sequence)

    def test_a_fault_that_repeats_is_a_few_lines_with_its_count(self):
        """The shipped scripts, with hundreds of failures each."""
        for name, words in (("nan", "friction_force is not a finite number"),
                            ("read_error", "reading the device failed"),
                            ("write_error", "writing the drive to the device failed")):
            with self.subTest(script=name):
                script = (SOURCE / f"config/faults/{name}.toml").read_text()
                self.assertIn("schema = 1\nseed = 1\n", script)
                result, _ = self.daemon(script.replace("schema = 1\nseed = 1\n", ""), name)
                lines = [line for line in result.stderr.splitlines() if words in line]
                self.assertIn(len(lines), (2, 3), result.stderr)
                self.assertRegex(lines[-1], r", \d+ more times")

    def test_a_clock_that_jumps_is_an_event(self):
        result, _ = self.daemon('[[fault]]\nkind = "clock_jump"\nat_s = 2.0\nduration_s = 1.0\n'
                                'amount = 5.0\n', "clock")
        self.assertIn("the source's clock jumped ahead by 5000.000 ms with no frame missing",
                      result.stderr)
        self.assertIn("the source's clock was set back by 5000.000 ms", result.stderr)
        codes = [self.types.event_t.decode(content).code
                 for channel, content in frames.events(self.folder / "clock.log")
                 if channel == "STICKSLIP_EVENT"]
        self.assertIn("clock_jumped", codes)

    def test_a_disconnected_device_is_reported(self):
        result, recording = self.daemon('[[fault]]\nkind = "unplug"\nat_s = 2.0\n', "unplug")
        self.assertEqual([frame.sequence for frame in recording][:2000], list(range(2000)))
        self.assertIn("fault 1 of script.toml: the device is unplugged", result.stderr)

    def test_a_delayed_channel_is_found_by_the_model_check(self):
        self.write("script.toml", """
            schema = 1
            [[fault]]
            kind = "delay"
            channel = "friction_force"
            at_s = 25.0
            duration_s = 60.0
            amount = 0.006
            """)
        config = self.write("rig.toml", f"""
            schema = 1
            rig = {{ name = "late", model = "{SOURCE}/config/models/simulated.toml" }}
            driver.kind = "simulated"
            driver.faults = "script.toml"
            driver.simulated.real_time = false
            control.start_at_once = true
            [excitation]
            enabled = true
            carrier_hz = 3.2
            amplitude = 0.012
            modulation_hz = 0.2
            modulation_depth = 0.5
            """)
        result = run(STICKSLIPD, "--config", config, "--no-lcm", "--duration", 45)
        self.assertEqual(result.returncode, 0, result.stderr)
        output = result.stdout + result.stderr
        broken = output.find(" the rig does not follow its model: ")
        late = re.search("cause of the model mismatch(?: is not certain yet)?: "
                         r"The friction_force channel is delayed by ([0-9.]+) ms "
                         r"\(sensor of friction_force, above 99 %\)", output)
        self.assertGreater(broken, 0, output)
        self.assertTrue(late, output)
        self.assertGreater(late.start(), broken, output)
        self.assertAlmostEqual(float(late.group(1)), 6.0, delta=0.6)

    def test_a_malformed_script_is_refused_with_its_line(self):
        self.write("script.toml", 'schema = 1\n[[fault]]\nkind = "noise"\nat_s = 1.0\n')
        config = self.write("rig.toml", f"""
            schema = 1
            rig = {{ name = "faulty", model = "{SOURCE}/config/models/simulated.toml" }}
            driver = {{ kind = "simulated", faults = "script.toml" }}
            """)
        result = run(STICKSLIPD, "--config", config, "--no-lcm")
        self.assertEqual(result.returncode, 2)
        self.assertIn("script.toml:2:1: fault.noise.amount is missing", result.stderr)


if __name__ == "__main__":
    main()
