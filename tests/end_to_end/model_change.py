# SPDX-License-Identifier: Apache-2.0
"""`stickslip ctl model`: a rig whose spring hardens, which its model lacks, until the mended model is sent."""
import hashlib
import json
import subprocess
import time

from programs import PATIENCE_S, SOURCE, STICKSLIP, STICKSLIPD, EndToEnd, main, run

BELIEVED = (SOURCE / "config/models/simulated.toml").read_text()
MENDED = BELIEVED + '\n[[physics]]\nid = "cubic_stiffness"\nk3_n_m3 = { value = 7000.0, sigma = 300.0 }\n'


class ModelChange(EndToEnd):
    def start(self):
        self.socket = self.folder / "control.sock"
        self.recording = self.folder / "run.log"
        self.mended = self.write("mended.toml", MENDED)
        config = self.write("rig.toml", f"""
            schema = 1
            [rig]
            name = "hardening"
            model = "{SOURCE}/config/models/simulated.toml"
            [driver]
            kind = "simulated"
            simulated.truth = "{SOURCE}/config/models/simulated-truth.toml"
            [loop]
            rate_hz = 500.0
            [excitation]
            enabled = true
            carrier_hz = 3.2
            amplitude = 0.008
            ramp_s = 0.2
            [safety]
            longest_overrun_s = 0.0
            """)
        self.output = open(self.folder / "daemon.txt", "w+")
        self.daemon = subprocess.Popen([STICKSLIPD, "--config", config, "--control", self.socket, "--record",
                                        self.recording, "--no-lcm"], stdout=self.output, stderr=subprocess.STDOUT)
        self.addCleanup(self.output.close)
        self.addCleanup(lambda: self.daemon.poll() is None and self.daemon.kill())
        until = time.monotonic() + PATIENCE_S
        while run(STICKSLIP, "ctl", "--socket", self.socket, "status").returncode != 0:
            self.assertLess(time.monotonic(), until, self.log())
            time.sleep(0.05)

    def log(self):
        return (self.folder / "daemon.txt").read_text()

    def ctl(self, *arguments, status=0):
        result = run(STICKSLIP, "ctl", "--socket", self.socket, "--json", *arguments)
        self.assertEqual(result.returncode, status, f"{arguments}: {result.stdout}{result.stderr}\n{self.log()}")
        return json.loads(result.stdout) if result.stdout else result.stderr

    def wait_for_standing(self, standing):
        until = time.monotonic() + PATIENCE_S
        while (found := self.ctl("status")["status"])["model"]["standing"] != standing:
            self.assertLess(time.monotonic(), until, f"{found['model']}, expected {standing}\n{self.log()}")
            time.sleep(0.05)
        return found

    def test_the_rig_follows_the_mended_model(self):
        self.start()
        self.assertIn("the rig is faulted", self.ctl("model", self.mended, status=1)["error"])
        for command in ("clear", "arm", "start"):
            self.ctl(command)
        self.wait_for_standing("broken")

        # Wrong models, and those of other rigs, change nothing.
        wrong = self.write("wrong.toml", MENDED.replace("order = 4", "order = 40", 1))
        self.assertRegex(self.ctl("model", wrong, status=2), r"wrong\.toml:\d+:\d+: .*40")
        other = self.write("other.toml", MENDED.replace('excitation = "base"', 'excitation = "force"'))
        self.assertRegex(self.ctl("model", other, status=1)["error"],
                         r'/other\.toml:\d+:\d+: oscillator\.excitation: is "force", in the running configuration "base"')
        self.assertNotIn("the model is now", self.log())

        answer = self.ctl("model", self.mended)
        digest = hashlib.sha256(MENDED.encode()).hexdigest()
        self.assertIn(f"{self.mended} (SHA-256 {digest})", answer["message"])
        self.assertEqual((answer["state"], answer["observer"]["anew"]), ("running", 0))
        found = self.wait_for_standing("follows")
        self.assertEqual(found["model"]["alarms"], 1)
        self.daemon.terminate()
        self.assertEqual(self.daemon.wait(timeout=PATIENCE_S), 0, self.log())

        # The event, in the recording too; no frame is lost.
        log = self.log()
        order = [log.index(text) for text in ("does not follow its model", answer["message"],
                                              "the rig follows its new model")]
        self.assertEqual(order, sorted(order))
        self.succeed("log", "check", self.recording)
        info = json.loads(self.succeed("log", "info", self.recording, "--json").stdout)
        self.assertEqual(info["model_changes"], [{"time_ns": answer["time_ns"], "message": answer["message"]}])
        self.assertEqual((info["frames"]["missing"], info["faults"]), (0, []))
        self.assertEqual(info["events"]["STICKSLIP_RECORDING"], 2)
        self.assertEqual(info["texts"]["model"]["sha256"], hashlib.sha256(BELIEVED.encode()).hexdigest())
        estimate = self.succeed("estimate", self.recording, "--model", self.mended)
        self.assertIn(f"{answer['time_ns'] * 1e-9:.3f} s, {answer['message']}", estimate.stderr)


if __name__ == "__main__":
    main()
