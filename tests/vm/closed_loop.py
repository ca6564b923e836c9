# SPDX-License-Identifier: Apache-2.0
"""The whole daemon on all devices of a bench, in the machine of tests/vm/run: the drivers, the
libraries and the kernel are real, the devices are tests/vm/bench_devices. The loop is closed from
the board's output through the rig of equations to the five channels.

Usage: closed_loop.py SOURCE_FOLDER BUILD_FOLDER [SECONDS]
"""
import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time
import unittest

SOURCE, BUILD = map(pathlib.Path, sys.argv[1:3])
SECONDS = float(sys.argv[3]) if len(sys.argv) > 3 else 60.0
STICKSLIP, STICKSLIPD = BUILD / "bin/stickslip", BUILD / "bin/stickslipd"
CARRIER_HZ, AMPLITUDE_M = 3.2, 0.006
# Residual error of each input by resolution and noise, SI, and uncertainty of the time of a reading:
# scans of the board by its crystal on the host's clock, others by the arrival of their replies.
NOISE = {"displacement": (1.2e-6, 0.1e-3), "velocity": (2.5e-5, 0.1e-3), "friction_force": (1.5e-4, 0.5e-3),
         "normal_load": (1.5e-4, 0.5e-3), "base_displacement": (2.0e-6, 0.5e-3)}

RIG = """
schema = 1
[rig]
name = "a bench of emulated devices"
model = "{source}/config/models/simulated.toml"
[driver]
kind = "bench"
[driver.bench]
board = "labjack_u6"
[inputs.displacement]
from = "labjack_u6/AIN0"
[inputs.velocity]
from = "labjack_u6/AIN1"
[inputs.friction_force]
from = "phidget_bridge/0"
gain = 128
[inputs.normal_load]
from = "phidget_bridge/1"
gain = 128
[inputs.base_displacement]
from = "lvdt/position"
[labjack_u6]
enable_line = 0
watchdog_s = 1
[[modbus]]
name = "lvdt"
transport = "rtu"
port = "{serial}"
map = "{source}/config/modbus/orbit-acs-sample.toml"
poll_period_s = 0.02
timeout_s = 0.1
[[modbus]]
name = "amplifier"
transport = "tcp"
port = "{tcp}"
unit = 2
map = "amplifier.toml"
poll_period_s = 0.1
timeout_s = 0.1
[amplifier]
chip = "cp2112_gpio"
heartbeat_period_s = 0.2
[amplifier.enable]
line = "0"
[amplifier.heartbeat]
line = "3"
[amplifier.fault]
line = "1"
active_low = true
[amplifier.emergency_stop]
line = "2"
active_low = true
[shaker]
volts_per_unit = 150.0
low_v = 0.05
high_v = 4.95
[calibration.displacement]
offset = 0.0
gain = 2.5e-3
[calibration.velocity]
offset = 0.0
gain = 0.05
[calibration.friction_force]
offset = 2.0e-4
gain = 1.0e3
[calibration.normal_load]
offset = -1.0e-4
gain = 1.0e3
[calibration.base_displacement]
offset = 0.0
gain = 1.0e-3
[loop]
rate_hz = 1000.0
[observer]
enabled = false
[safety]
stale_after_s = 0.5
longest_silence_s = 0.5
[excitation]
enabled = true
carrier_hz = {carrier}
amplitude = {amplitude}
ramp_s = 0.5
[recording]
enabled = true
file = "run.log"
[control]
socket = "control.sock"
"""

AMPLIFIER = """
schema = 1
name = "an amplifier"
[[register]]
name = "limit"
role = "setting"
address = 10
set_to = 25
[[register]]
name = "alarm"
role = "alarm"
address = 11
ok = [0]
"""


def idle_s():
    """Idle time of the processor [s]."""
    return float(pathlib.Path("/proc/uptime").read_text().split()[1])


def kernel_is_sound():
    """False once the kernel has printed a warning (bit 9) or lost a thread to an error (bit 7)."""
    return int(pathlib.Path("/proc/sys/kernel/tainted").read_text()) & (1 << 9 | 1 << 7) == 0


def log(words):
    print(f"{time.monotonic():8.2f}  {words}", flush=True)


class ClosedLoop(unittest.TestCase):
    def setUp(self):
        log("started")
        folder = tempfile.TemporaryDirectory(prefix="closed-loop-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.daemon_log = self.folder / "daemon.log"
        self.devices = self.start([BUILD / "tests/vm/bench_devices", SOURCE / "config/simulated.toml",
                                   self.folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.assertEqual(self.devices.stdout.readline(), "ready\n")
        ports = json.loads((self.folder / "ports.json").read_text())
        (self.folder / "amplifier.toml").write_text(AMPLIFIER)
        self.rig = self.folder / "rig.toml"
        self.rig.write_text(RIG.format(source=SOURCE, carrier=CARRIER_HZ, amplitude=AMPLITUDE_M, **ports))

    def start(self, command, **more):
        process = subprocess.Popen([str(word) for word in command], cwd=self.folder, **more)
        self.addCleanup(self.end, process)
        return process

    @staticmethod
    def end(process):
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe:
                pipe.close()

    def command(self, words):
        """Sends a command to bench_devices and returns its reply."""
        self.devices.stdin.write(words + "\n")
        self.devices.stdin.flush()
        return json.loads(self.devices.stdout.readline())

    def stickslip(self, *words, status=0):
        result = subprocess.run([STICKSLIP, *map(str, words)], capture_output=True, text=True, cwd=self.folder)
        if status is not None:
            self.assertEqual(result.returncode, status, result.stdout + result.stderr)
        return result.stdout

    def connect(self):
        control = socket.socket(socket.AF_UNIX)
        self.addCleanup(control.close)
        control.connect(str(self.folder / "control.sock"))
        self.control = control.makefile("rw")
        self.addCleanup(self.control.close)

    def request(self, command):
        """Sends a request to the daemon, without `stickslip ctl`, which takes half a second to start here."""
        self.control.write(json.dumps({"v": 1, "id": 1, "do": command}) + "\n")
        self.control.flush()
        return json.loads(self.control.readline())

    def status(self):
        return self.request("status")["status"]

    def until(self, what, holds, seconds=15.0):
        end = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > end:
                self.fail(f"{what}: not within {seconds} s; {self.status()}\n{self.daemon_log.read_text()}")
            time.sleep(0.1)

    def set_moving(self):
        # A fault can be cleared only after its cause has disappeared. An accepted request takes effect
        # a moment later, when it may have been repeated and refused.
        # The kernel waits up to five seconds for each transfer that a device had not answered.
        self.until("cleared", lambda: self.request("clear") and self.status()["state"] == "idle", 60.0)
        self.until("armed", lambda: self.request("arm") and self.status()["state"] == "armed")
        self.assertTrue(self.request("start")["ok"])
        self.until("moving", lambda: self.command("state")["enabled"], 5.0)

    def devices_are_found(self):
        wanted = ("labjack_u6", "phidget_bridge", "gpio")
        # The kernel needs time to enumerate devices.
        for _ in range(20):
            found = json.loads(self.stickslip("devices", "--json", status=None))["devices"]
            kinds = {device["kind"]: device for device in found}
            if all(kind in kinds and kinds[kind]["speaks"] for kind in wanted):
                break
            time.sleep(0.5)
        for kind in wanted:
            self.assertIn(kind, kinds)
            self.assertTrue(kinds[kind]["speaks"], kinds[kind])
        tried = self.stickslip("check", "--live", self.rig)
        log("check --live:\n" + tried)
        self.assertNotIn("FAILS", tried)
        self.assertEqual(tried.count("responds"), 5)
        self.assertFalse(self.command("state")["enabled"], "check --live enabled the amplifier")

    def inject(self, words, remedy, interlocks, names):
        """An event while the rig moves: it switches off, names the cause, and recovers without a restart."""
        before = time.monotonic_ns()
        self.command(words)
        self.until("off", lambda: not self.command("state")["enabled"], 5.0)
        off_after_ms = (self.command("state")["enabled_since_ns"] - before) * 1e-6
        self.until("faulted", lambda: self.status()["state"] == "faulted", 5.0)
        status = self.status()
        log(f"{words}: off after {off_after_ms:.0f} ms, {status['interlock']}: {status['cause']}")
        self.assertIn(status["interlock"], interlocks, status)
        self.assertRegex(status["cause"], names)
        time.sleep(1.0)  # the rig comes to rest
        self.command(remedy)
        self.set_moving()
        self.assertTrue(kernel_is_sound(), f"a kernel error after \"{words}\": dmesg")
        return off_after_ms

    def test_a_minute_of_rig_time(self):
        self.devices_are_found()
        # Into a file: an unread pipe would block the daemon once it is full.
        with open(self.daemon_log, "w") as errors:
            daemon = self.start([STICKSLIPD, "--config", self.rig], stderr=errors)
        self.until("a socket", (self.folder / "control.sock").exists)
        started = time.monotonic()
        self.connect()
        self.assertEqual(self.status()["state"], "faulted")
        self.set_moving()
        self.assertEqual(self.command("state")["limit"], 25)
        time.sleep(2.0)
        drives = self.command("state")["drives"]
        steady_from, idle = time.monotonic_ns(), idle_s()
        time.sleep(max(10.0, SECONDS / 3))
        steady_to = time.monotonic_ns()
        idle = (idle_s() - idle) / (steady_to - steady_from) * 1e9
        log(f"idle for {idle:.0%} of the time")
        drives = (self.command("state")["drives"] - drives) / (steady_to - steady_from) * 1e9
        beats = self.command("state")["heartbeats"]

        off_ms = {words: self.inject(words, remedy, interlocks, names) for words, remedy, interlocks, names in (
            ("unplug bridge", "plug bridge", {"part_lost", "stale_channel"}, "PhidgetBridge|friction_force|normal_load"),
            ("unplug lvdt", "plug lvdt", {"part_lost", "stale_channel"}, "lvdt|base_displacement"),
            ("press", "release", {"emergency_stop"}, "emergency stop"),
            ("fault", "repair", {"amplifier_fault"}, "amplifier"),
            ("unplug gpio", "plug gpio", {"device_lost", "device_silent", "emergency_stop"}, "GPIO|gpio|chip|emergency"),
            ("pull gpio", "plug gpio", {"device_lost", "device_silent", "emergency_stop"}, "GPIO|gpio|chip|emergency"),
            # The kernel waits five seconds for each of its transfers, the loop does not.
            ("hang gpio", "plug gpio", {"device_lost", "emergency_stop"}, "GPIO|gpio|chip|emergency"),
            ("unplug u6", "plug u6", {"device_lost", "device_silent"}, "U6"))}
        self.assertGreater(self.command("state")["heartbeats"], beats)
        for words in ("press", "fault"):
            self.assertLess(off_ms[words], 200.0, words)
        self.assertLess(off_ms["hang gpio"], 1000.0)

        time.sleep(max(0.0, SECONDS - (time.monotonic() - started)))
        self.stickslip("ctl", "--socket", "control.sock", "stop")
        self.until("at rest", lambda: self.status()["state"] == "idle")
        self.assertFalse(self.command("state")["enabled"])
        lost = self.command("state")["scans_lost"]
        daemon.terminate()
        self.assertEqual(daemon.wait(), 0, self.daemon_log.read_text())
        time.sleep(0.3)
        self.devices.stdin.write("quit\n")
        self.devices.stdin.flush()
        self.devices.wait()

        log(self.stickslip("log", "check", "run.log"))
        found = json.loads(subprocess.run([BUILD / "tests/vm/compare_truth", "run.log", "truth", str(CARRIER_HZ),
                                           str(steady_from), str(steady_to)], capture_output=True, text=True,
                                          check=True, cwd=self.folder).stdout)
        log(json.dumps(found, indent=1))
        log(f"amplitude {found['amplitude_m'] * 1e3:.4f} mm of {AMPLITUDE_M * 1e3:.4f}; "
            f"{drives:.0f} drives a second; the board lost {lost} scans")
        # An absent board or chip costs seconds, of which each is one gap.
        self.assertGreater(found["frames"], 0.5 * SECONDS * 1000.0)
        # Only the absences of the board and of the amplifier's chip leave gaps.
        self.assertLessEqual(found["gaps"], 4)
        self.assertAlmostEqual(found["amplitude_m"], AMPLITUDE_M, delta=0.01 * AMPLITUDE_M)
        for channel, (noise, moment_s) in NOISE.items():
            each = found[channel]
            self.assertLess(each["rms"], noise + moment_s * each["slope_per_s"], channel)
            if moment_s * each["slope_per_s"] > noise:  # otherwise its delay is not observable
                self.assertLess(abs(each["late_ms"]), 5.0, channel)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
