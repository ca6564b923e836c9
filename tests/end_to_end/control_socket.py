# SPDX-License-Identifier: Apache-2.0
"""The control socket: `stickslip ctl` against a running daemon, killed daemons and clients, and hostile
clients."""
import json
import os
import random
import signal
import socket
import subprocess
import threading
import time
import unittest

from frames import generate_types, payloads
from programs import PATIENCE_S, SOURCE, STICKSLIP, STICKSLIPD, EndToEnd, as_other_user, main, run

HOLD_S = 0.15  # time for which the relay stays on without a message


class Relay(threading.Thread):
    """An amplifier behind a watchdog relay: on while messages enable it, off without messages."""

    def __init__(self, path):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(path))
        self.socket.settimeout(HOLD_S)
        self.on = False
        self.went_off = None
        self.ended = False
        self.start()

    def run(self):
        with self.socket:
            self.listen()

    def listen(self):
        while not self.ended:
            try:
                enabled = self.socket.recv(16) == b"1"
            except TimeoutError:
                enabled = False
            if self.on and not enabled:
                self.went_off = time.monotonic()
            self.on = enabled


class ControlSocket(EndToEnd):
    def start(self, more="", rig=""):
        """A daemon on the simulated rig, waiting for commands."""
        self.socket = self.folder / "control.sock"
        config = self.write("rig.toml", f"""
            schema = 1
            [rig]
            name = "controlled"
            model = "{SOURCE}/config/models/simulated.toml"
            [driver]
            kind = "simulated"
            {rig}
            [excitation]
            enabled = true
            carrier_hz = 3.2
            amplitude = 0.004
            ramp_s = 0.2
            {more}
            """)
        self.output = open(self.folder / "daemon.txt", "w+")
        daemon = subprocess.Popen([STICKSLIPD, "--config", str(config), "--control",
                                   str(self.socket), "--no-lcm"],
                                  stdout=self.output, stderr=subprocess.STDOUT)
        self.addCleanup(self.output.close)
        self.addCleanup(lambda: daemon.poll() is None and daemon.kill())
        until = time.monotonic() + PATIENCE_S
        while not self.listens():
            self.assertLess(time.monotonic(), until, self.log())
            time.sleep(0.02)
        return daemon

    def listens(self):
        """A killed daemon leaves its socket behind, without a listener."""
        with socket.socket(socket.AF_UNIX) as client:
            return client.connect_ex(str(self.socket)) == 0

    def log(self):
        return (self.folder / "daemon.txt").read_text()

    def ctl(self, *arguments, status=0):
        result = run(STICKSLIP, "ctl", "--socket", self.socket, "--json", *arguments)
        self.assertEqual(result.returncode, status, f"{arguments}: {result.stdout}{result.stderr}")
        return json.loads(result.stdout.splitlines()[-1]) if result.stdout else {}

    def wait_for(self, state, seconds=PATIENCE_S):
        until = time.monotonic() + seconds
        while (now := self.ctl("status"))["state"] != state:
            self.assertLess(time.monotonic(), until, f"{now} and not {state}\n{self.log()}")
            time.sleep(0.02)
        return now

    def move(self):
        for command in ("clear", "arm", "start"):
            self.ctl(command)

    def end(self, daemon, status=0):
        daemon.terminate()
        self.assertEqual(daemon.wait(timeout=PATIENCE_S), status, self.log())
        self.assertFalse(self.socket.exists())

    def test_an_operator_starts_and_stops_the_rig(self):
        daemon = self.start()
        now = self.ctl("status")
        self.assertEqual((now["state"], now["interlock"]), ("faulted", "just_started"))
        self.assertFalse(now["amplifier_on"])
        self.assertIn("armed", self.ctl("start", status=1)["error"])
        self.move()
        time.sleep(0.5)
        now = self.ctl("status")
        self.assertEqual(now["state"], "running")
        self.assertTrue(now["amplifier_on"])
        page = run(STICKSLIP, "ctl", "--socket", self.socket, "status", env={**os.environ, "COLUMNS": "60"})
        self.assertIn("running", self.expect_to_fit(page.stdout, ("ctl", "status")))
        self.assertEqual(self.ctl("set", "excitation.carrier_hz", "2.8")["ok"], True)
        self.assertIn("limits.acceleration_m_s2",
                      self.ctl("set", "excitation.carrier_hz", "40", status=1)["error"])
        self.assertEqual(self.ctl("stop", "--wait")["state"], "idle")
        self.assertFalse(self.ctl("status")["amplifier_on"])
        self.end(daemon)

    def test_a_killed_daemon_leaves_the_amplifier_off(self):
        relay = Relay(self.folder / "relay.sock")
        self.addCleanup(setattr, relay, "ended", True)
        daemon = self.start(rig='simulated.relay = "relay.sock"')
        self.move()
        time.sleep(0.5)
        self.assertTrue(relay.on)
        daemon.kill()
        killed = time.monotonic()
        daemon.wait()
        time.sleep(HOLD_S + 0.3)
        self.assertFalse(relay.on)
        self.assertLess(relay.went_off - killed, HOLD_S + 0.25)
        # The next daemon starts faulted, like every daemon.
        again = self.start(rig='simulated.relay = "relay.sock"')
        self.assertEqual(self.ctl("status")["state"], "faulted")
        time.sleep(0.2)
        self.assertFalse(relay.on)
        self.end(again)

    def test_releasing_the_dead_mans_handle_stops_the_rig(self):
        daemon = self.start("[safety]\ndead_man_s = 0.3")
        self.ctl("clear")
        self.ctl("arm")
        for how in (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM):
            holder = subprocess.Popen([STICKSLIP, "ctl", "--socket", str(self.socket), "start",
                                       "--dead-man"], stdout=subprocess.DEVNULL)
            self.addCleanup(holder.kill)
            self.wait_for("running")
            time.sleep(1.0)
            self.assertEqual(self.ctl("status")["state"], "running")
            holder.send_signal(how)
            if how == signal.SIGTERM:  # Ctrl-C is not a fault
                self.assertEqual(holder.wait(timeout=PATIENCE_S), 0)
                self.wait_for("idle")
                continue
            now = self.wait_for("faulted", 3)
            self.assertEqual(now["interlock"], "client_gone")
            self.assertFalse(now["amplifier_on"])
            if how == signal.SIGSTOP:
                holder.kill()
            self.ctl("clear")
            self.ctl("arm")
        self.end(daemon)

    def test_an_unplugged_device_is_restored_but_its_fault_stays(self):
        self.write("script.toml", 'schema = 1\n[[fault]]\nkind = "unplug"\nat_s = 2.0\n'
                                  'duration_s = 1.0\n')
        daemon = self.start(rig='faults = "script.toml"')
        self.move()
        self.wait_for("faulted")
        now = self.ctl("status")
        self.assertEqual(now["interlock"], "device_lost")
        self.assertIn("unplugged", now["cause"])
        self.assertFalse(now["amplifier_on"])
        until = time.monotonic() + PATIENCE_S
        while not self.ctl("status")["device_here"]:
            self.assertLess(time.monotonic(), until, self.log())
            time.sleep(0.05)
        self.assertEqual(self.ctl("status")["state"], "faulted")
        time.sleep(0.1)
        self.move()
        self.wait_for("running")
        self.end(daemon)

    def test_a_reload_applies_what_can_change_while_running(self):
        daemon = self.start()
        self.move()
        path = self.folder / "rig.toml"
        path.write_text(path.read_text().replace("carrier_hz = 3.2", "carrier_hz = 2.5")
                        .replace("[excitation]", "[loop]\nrate_hz = 500.0\n[excitation]"))
        changes = self.ctl("reload")["changes"]
        self.assertIn("loop.rate_hz: 1000.0 -> 500.0, needs a restart", changes)
        self.assertIn("excitation.carrier_hz: 3.2 -> 2.5", changes)
        until = time.monotonic() + PATIENCE_S
        while abs(self.ctl("status")["drive"]["carrier_hz"] - 2.5) > 1e-6:
            self.assertLess(time.monotonic(), until)
            time.sleep(0.05)
        # An invalid configuration changes nothing, and SIGHUP is the same as reload.
        path.write_text("nonsense")
        daemon.send_signal(signal.SIGHUP)
        until = time.monotonic() + PATIENCE_S
        while "nothing was changed" not in self.log():
            self.assertLess(time.monotonic(), until, self.log())
            time.sleep(0.05)
        self.assertEqual(self.ctl("status")["state"], "running")
        self.end(daemon)

    def test_a_note_is_in_the_recording_with_its_time(self):
        log = self.folder / "run.log"
        daemon = self.start(more=f"""
            [recording]
            enabled = true
            file = "{log}"
            """)
        before = self.ctl("status")["time_ns"]
        noted = self.ctl("note", "weights", "changed", "to", "450 g")
        after = self.ctl("status")["time_ns"]
        self.assertLessEqual(before, noted["time_ns"])
        self.assertLessEqual(noted["time_ns"], after)
        self.assertIn("characters", self.ctl("note", "two\nlines", status=1)["error"])
        page = run(STICKSLIP, "ctl", "--socket", self.socket, "note", "again")
        self.assertRegex(page.stdout, r"\Anoted at \d+\.\d{3} s of device time\n\Z")
        self.end(daemon)
        event_t = generate_types(self.folder / "types").event_t
        events = [event_t.decode(payload) for payload in payloads(log, "STICKSLIP_EVENT")]
        notes = [(event.message, event.time_ns, event.severity) for event in events if event.code == "note"]
        self.assertEqual([text for text, _, _ in notes], ["weights changed to 450 g", "again"])
        self.assertEqual(notes[0][1:], (noted["time_ns"], 0))

    def test_a_calibration_with_readings_of_the_daemon(self):
        self.write("cal.toml", (SOURCE / "config/calibrations/beam.toml").read_text())
        daemon = self.start()
        result = subprocess.run([STICKSLIP, "ctl", "--socket", str(self.socket), "calibrate",
                                 "friction_force", "--file", str(self.folder / "cal.toml"),
                                 "--seconds", "0.3"], input="weights set 12\nme\n0.1 %\n\nquit\n",
                                capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
        self.assertIn("Point 1: 0 N reads", result.stdout)
        self.assertIn("is unchanged", result.stdout)
        self.assertEqual((self.folder / "cal.toml").read_text(),
                         (SOURCE / "config/calibrations/beam.toml").read_text())
        self.end(daemon)

    def test_thousands_of_hostile_connections_delay_neither_the_loop_nor_an_operator(self):
        daemon = self.start()
        self.move()
        rng = random.Random(7)
        kept = []
        for i in range(3000):
            client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            client.setblocking(False)
            try:
                client.connect(str(self.socket))
                kind = rng.randrange(4)
                if kind == 1:
                    client.send(b'{"v":1,"do":"st')
                elif kind == 2:
                    client.send(rng.randbytes(20_000))
                elif kind == 3:
                    client.send(b'{"v":1,"do":"status"}\n' * 100)
            except (BlockingIOError, BrokenPipeError, ConnectionResetError):
                pass
            kept.append(client)
            if len(kept) > 300:
                kept.pop(0).close()
            if i % 500 == 499:
                self.assertEqual(self.ctl("status")["state"], "running")
        for client in kept:
            client.close()
        now = self.ctl("status")
        self.assertEqual(now["state"], "running")
        self.assertLess(len(self.log()), 200_000, "the log was flooded")
        self.end(daemon)

    def test_without_a_daemon_the_error_names_the_remedy(self):
        result = run(STICKSLIP, "ctl", "--socket", self.folder / "none.sock", "status")
        self.assertEqual(result.returncode, 2)
        self.assertIn("is the daemon running", result.stderr)
        self.assertEqual(len(result.stderr.strip().splitlines()), 1)

    def test_an_unauthorised_user_is_refused(self):
        other_user = as_other_user()
        if not other_user:
            self.skipTest("cannot run as another user here; run it as root")
        daemon = self.start()
        self.folder.chmod(0o755)
        os.chmod(self.socket, 0o666)  # even with these permissions the credentials are checked
        # The daemon may have refused and closed before the request is sent: send() then fails, and the
        # answer is still to be read.
        code = ("import contextlib, socket, sys\n"
                "s = socket.socket(socket.AF_UNIX)\n"
                "s.connect(sys.argv[1])\n"
                "with contextlib.suppress(BrokenPipeError, ConnectionResetError):\n"
                "    s.sendall(b'{\"v\":1,\"do\":\"clear\"}\\n')\n"
                "print(s.recv(1000).decode())\n")
        result = run(*other_user, "python3", "-c", code, self.socket)
        self.assertIn("may not use this socket", result.stdout + result.stderr)
        self.assertEqual(self.ctl("status")["state"], "faulted")
        self.end(daemon)


if __name__ == "__main__":
    main()
