# SPDX-License-Identifier: Apache-2.0
"""`stickslip commission` on a bench without devices: its files, taking up again, and the comparison
by `check`. The steps themselves are tested in tests/emulated/commissioning."""
import signal
import subprocess
import time

from programs import PATIENCE_S, EndToEnd, SOURCE, STICKSLIP, main, read_json, stickslip

STEPS = ["identities", "noise", "shunt", "polarity", "delays", "emergency_stop", "amplifier_fault",
         "plugs", "timing", "watchdog", "drive"]


class Commission(EndToEnd):
    def setUp(self):
        super().setUp()
        self.rig = self.write("rig.toml", (SOURCE / "config/bench-u6.toml").read_text()
                              .replace('"models/', f'"{SOURCE}/config/models/')
                              .replace('"modbus/', f'"{SOURCE}/config/modbus/')
                              .replace("/dev/ttyUSB0", str(self.folder / "no-such-line")))
        self.record = self.folder / "rig.commissioned/commissioned.json"

    def commission(self, *lines, options=()):
        answers = self.write("answers.txt", "".join(line + "\n" for line in lines))
        return stickslip("commission", self.rig, "--answers", answers, *options)

    def verdicts(self):
        return {step["step"]: step["verdict"] for step in read_json(self.record)["steps"]}

    def test_what_was_found_is_kept_taken_up_again_and_compared(self):
        first = self.commission("# the devices are absent", "s", "s", "", "q")
        self.assertEqual(first.returncode, 1, first.stdout + first.stderr)
        self.assertIn("A device cannot be used", first.stdout)
        self.assertIn("what to do:", first.stdout)
        self.assertEqual(self.verdicts(), {"identities": "not done", "noise": "not done",
                                           "shunt": "failed"})
        page = self.record.with_name("report.html").read_text()
        self.assertIn("Not accepted yet", page)

        again = self.commission(*["s"] * len(STEPS))
        self.assertEqual(again.returncode, 1, again.stdout + again.stderr)
        self.assertIn("taking up the acceptance", again.stdout)
        self.assertEqual(self.verdicts(), {step: "not done" for step in STEPS})

        checked = stickslip("check", self.rig)
        self.assertEqual(checked.returncode, 0, checked.stderr)
        self.assertIn("acceptance", checked.stdout)
        self.assertIn("steps that are not done: " + ", ".join(STEPS), checked.stderr.replace("\n", " "))

    def test_a_changed_bench_is_named_and_the_earlier_acceptance_stays(self):
        self.commission("s", "q")
        self.rig.write_text(self.rig.read_text().replace("labjack_u6/AIN1", "labjack_u6/AIN3"))
        checked = stickslip("check", self.rig)
        self.assertIn('inputs.velocity.from is "labjack_u6/AIN3" and was "labjack_u6/AIN1"',
                      checked.stderr.replace("\n", " "))
        anew = self.commission("", "q")
        self.assertIn("was changed since", anew.stdout)
        self.assertTrue(self.record.with_name("commissioned-1.json").exists())
        self.assertEqual(read_json(self.record)["settings"]["inputs.velocity.from"],
                         '"labjack_u6/AIN3"')
        self.rig.write_text(self.rig.read_text().replace("labjack_u6/AIN3", "labjack_u6/AIN4"))
        kept = self.commission("k", "q")
        self.assertEqual(kept.returncode, 1, kept.stdout + kept.stderr)
        self.assertEqual(len(read_json(self.record)["changes"]), 1)
        self.assertFalse(self.record.with_name("commissioned-2.json").exists())

    def test_files_of_others_are_not_replaced(self):
        self.commission("s", "q")
        report = self.record.with_name("report.html")
        report.write_text(report.read_text() + "<!-- a remark by hand -->")
        refused = self.commission("s", "q")
        self.assertEqual(refused.returncode, 2, refused.stdout)
        self.assertIn("report.html", refused.stderr)
        self.assertIn("a remark by hand", report.read_text())
        report.unlink()
        self.record.write_text("{}")
        refused = self.commission("s", "q")
        self.assertEqual(refused.returncode, 2, refused.stdout)
        self.assertEqual(self.record.read_text(), "{}")

    def test_ctrl_c_keeps_what_was_found(self):
        with subprocess.Popen([STICKSLIP, "commission", self.rig], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
            program.stdin.write("s\n")
            program.stdin.flush()
            deadline = time.monotonic() + PATIENCE_S
            while not self.record.exists() and time.monotonic() < deadline:
                time.sleep(0.05)
            program.send_signal(signal.SIGINT)
            program.wait(timeout=PATIENCE_S)  # with its input open: an end of it would be an answer
            _, errors = program.communicate(timeout=PATIENCE_S)
        self.assertEqual(program.returncode, 1, errors)
        self.assertIn("the amplifier is off", errors)
        self.assertEqual(self.verdicts(), {"identities": "not done"})

    def test_a_rig_without_devices_is_refused(self):
        refused = stickslip("commission", SOURCE / "config/simulated.toml", "--out", self.folder / "out")
        self.assertEqual(refused.returncode, 2)
        self.assertIn('driver.kind = "bench"', refused.stderr)


if __name__ == "__main__":
    main()
