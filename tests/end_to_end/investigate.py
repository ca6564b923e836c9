# SPDX-License-Identifier: Apache-2.0
"""`stickslip investigate` with a daemon whose rig has a hardening spring that its model lacks: nothing moves
before a person has armed it, an interruption switches the amplifier off, the same command takes the study up
again and names the spring, no run exceeds a limit, and the recordings give the same numbers again."""
import csv
import json
import signal
import subprocess
import time

from programs import PATIENCE_S, STICKSLIP, STICKSLIPD, EndToEnd, main, read_json, run

# A mass on a spring that a force drives: its diagnosis takes seconds. The force counts as exact: what its noise
# adds to the velocity (2 um/s in a window) is far below the noise of the velocity.
MODEL = """schema = 1
[oscillator]
excitation = "force"
mass_kg = 1.0
stiffness_n_m = {stiffness}
damping_n_s_m = {damping}
[sensors.displacement]
noise_std = 1.0e-3
gain = 1.0
offset = 0.0
delay_s = 0.0
[sensors.velocity]
noise_std = 2.0e-5
gain = 1.0
offset = 0.0
delay_s = 0.0
[sensors.drive_force]
noise_std = 1.0e-4
gain = 1.0
offset = 0.0
delay_s = 0.0
"""
BELIEVED = MODEL.format(stiffness="{ value = 158.0, sigma = 5.0 }", damping="{ value = 0.5, sigma = 0.2 }")
TRUTH = MODEL.format(stiffness="161.0", damping="0.55") + """
[[physics]]
id = "cubic_stiffness"
k3_n_m3 = 800.0
"""
FORCE_N = 1.5
DISPLACEMENT_M = 0.06


class Investigate(EndToEnd):
    def start_daemon(self):
        self.socket = self.folder / "control.sock"
        self.model = self.write("believed.toml", BELIEVED)
        config = self.write("rig.toml", f"""
            schema = 1
            [rig]
            name = "hardening"
            model = "{self.model}"
            [driver]
            kind = "simulated"
            simulated.truth = "{self.write("truth.toml", TRUTH)}"
            [loop]
            rate_hz = 250.0
            [excitation]
            enabled = true
            carrier_hz = 2.0
            amplitude = 0.2
            [limits]
            force_n = {FORCE_N}
            force_slew_n_s = 60.0
            [safety]
            longest_overrun_s = 0.0
            dead_man_s = 10.0
            range.displacement.low = {-DISPLACEMENT_M}
            range.displacement.high = {DISPLACEMENT_M}
            """)
        output = open(self.folder / "daemon.txt", "w+")
        self.addCleanup(output.close)
        self.daemon = subprocess.Popen([STICKSLIPD, "--config", config, "--control", self.socket],
                                       stdout=output, stderr=subprocess.STDOUT)
        self.addCleanup(lambda: self.daemon.poll() is None and self.daemon.kill())
        self.wait_until(lambda: run(STICKSLIP, "ctl", "--socket", self.socket, "status").returncode == 0)

    def wait_until(self, holds, seconds=PATIENCE_S):
        until = time.monotonic() + seconds
        while not holds():
            self.assertLess(time.monotonic(), until, self.log())
            time.sleep(0.05)

    def log(self):
        return "\n".join((self.folder / name).read_text()
                         for name in ("daemon.txt", "study.txt") if (self.folder / name).exists())

    def ctl(self, *arguments):
        return json.loads(self.succeed("ctl", "--socket", self.socket, "--json", *arguments).stdout)

    def state(self):
        return self.ctl("status")["state"]

    def investigate(self):
        """The command, in the background; its output is in study.txt."""
        output = open(self.folder / "study.txt", "a+")
        self.addCleanup(output.close)
        command = [STICKSLIP, "investigate", "--socket", self.socket, "--model", self.model, "--out", self.folder / "study",
                   "--yes", "--budget-s", "20", "--certain", "0.99999999", "--shortest-s", "6", "--longest-s", "6",
                   "--evaluations", "10"]
        found = subprocess.Popen([str(part) for part in command], stdout=output, stderr=subprocess.STDOUT)
        self.addCleanup(lambda: found.poll() is None and found.kill())
        return found

    def wait_for_arming(self):
        self.wait_until(lambda: "waiting for a person" in self.log())
        answer = self.ctl("status")
        self.assertEqual((answer["amplifier_on"], answer["drive"]["value"]), (False, 0.0))

    def test_a_study_that_was_interrupted_names_the_spring(self):
        self.start_daemon()
        study = self.investigate()
        self.wait_for_arming()
        self.ctl("clear")
        self.ctl("arm")
        self.wait_until(lambda: self.state() == "running")
        study.send_signal(signal.SIGINT)
        self.assertEqual(study.wait(timeout=PATIENCE_S), 1, self.log())
        self.assertIn("the amplifier is off", self.log())
        self.assertFalse(self.ctl("status")["amplifier_on"])
        self.assertEqual(read_json(self.folder / "study/study.json")["runs"], [])
        self.wait_until(lambda: "the drive is the configured one again" in self.log())

        (self.folder / "study.txt").unlink()
        study = self.investigate()
        self.wait_for_arming()
        self.ctl("arm")
        self.assertEqual(study.wait(timeout=PATIENCE_S), 0, self.log())
        self.expect_the_spring(read_json(self.folder / "study/study.json"))
        self.expect_limits(read_json(self.folder / "study/study.json"))
        self.assertFalse(self.ctl("status")["amplifier_on"])
        self.expect_pages()
        self.daemon.terminate()
        self.assertEqual(self.daemon.wait(timeout=PATIENCE_S), 0, self.log())

    def expect_the_spring(self, study):
        # So certain that a second run is made, after which either that or the budget ends the study.
        self.assertIn(study["ending"], ("named", "no_gain", "budget"), study["ending_words"] + self.log())
        self.assertEqual(study["runs"][-1]["findings"], ["cubic_stiffness"])
        self.assertGreaterEqual(study["runs"][-1]["least_probability"], 0.9)
        self.assertLessEqual(study["rig_time_s"], 20.0)

    def expect_limits(self, study):
        """Of the readings; their noise is far below the reserve."""
        for made in study["runs"]:
            with open(self.folder / "study" / made["name"] / "recording.csv") as file:
                rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
            self.assertGreater(len(rows), 1300)
            for column, limit in (("displacement_m", DISPLACEMENT_M), ("drive_force_n", FORCE_N)):
                largest = max(abs(float(row[column])) for row in rows if row[column])
                self.assertLess(largest, limit, made["question"]["words"])
                self.assertGreater(largest, 0.05 * limit, made["question"]["words"])

    def expect_pages(self):
        page = (self.folder / "study/study.html").read_text()
        for text in ("cubic_stiffness", "run-01", "force of the drive", "1.5 N"):
            self.assertIn(text, page)
        self.assertNotRegex(page, r"(src|href)=\"(http|//)")
        self.assertTrue((self.folder / "study/run-01/report.html").exists())
        self.assertRegex((self.folder / "study/campaign.toml").read_text(), r"run-01/recording\.csv")
        self.assertIn("every number is that of study.json",
                      self.succeed("investigate", "--repeat", self.folder / "study").stdout)


if __name__ == "__main__":
    main()
