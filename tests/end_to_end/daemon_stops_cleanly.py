# SPDX-License-Identifier: Apache-2.0
"""However the daemon ends, nothing is lost: the recording holds every frame produced, the ledger
balances, and the last command to the shaker is "off"."""
import collections
import hashlib
import os
import random
import re
import signal
import socket
import subprocess
import time
import unittest

import frames
from programs import PATIENCE_S, SOURCE, STICKSLIPD, EndToEnd, main

CONFIG = SOURCE / "config/simulated.toml"
LEDGER = re.compile(r"(publishing|recording): (\d+) produced = (\d+) (?:published|recorded)"
                    r"((?: \+ \d+ lost \([a-z ]+\))+)")

Drive = collections.namedtuple("Drive", "sequence drive amplitude amplifier_on")


class DaemonStopsCleanly(EndToEnd):
    def setUp(self):
        super().setUp()
        self.types = frames.generate_types(self.folder)

    def start(self, *arguments, config=CONFIG, **environment):
        log = self.folder / f"{len(list(self.folder.glob('*.log')))}.log"
        daemon = subprocess.Popen([STICKSLIPD, "--config", str(config), "--record", str(log),
                                   *map(str, arguments)], stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True, env={**os.environ, **environment})
        self.addCleanup(daemon.wait)
        self.addCleanup(daemon.kill)
        return daemon, log

    def end(self, daemon, status=0):
        output, _ = daemon.communicate(timeout=PATIENCE_S)
        self.assertEqual(daemon.returncode, status, output)
        return output

    def wait_for_recording(self, log, size=20000):
        until = time.monotonic() + PATIENCE_S
        while not log.exists() or log.stat().st_size < size:
            self.assertLess(time.monotonic(), until, "the recording does not grow")
            time.sleep(0.01)

    def ledger(self, output):
        """{consumer: (produced, delivered, lost)} as the daemon printed it."""
        found = {}
        for name, produced, delivered, losses in LEDGER.findall(output):
            lost = sum(int(n) for n in re.findall(r"\+ (\d+) lost", losses))
            found[name] = (int(produced), int(delivered), lost)
        return found

    def check(self, output, log, published=True):
        ledger = self.ledger(output)
        self.assertEqual(set(ledger), {"publishing", "recording"} if published else {"recording"}, output)
        for name, (produced, delivered, lost) in ledger.items():
            self.assertGreater(produced, 0, name)
            self.assertEqual(produced, delivered + lost, output)
        produced, recorded, lost = ledger["recording"]
        self.assertEqual(lost, 0, output)

        recording = frames.frames(log, self.types)
        self.assertEqual(len(recording), recorded)
        first = recording[0].sequence
        self.assertEqual([frame.sequence for frame in recording],
                         list(range(first, first + produced)))

        events = list(frames.events(log))
        self.assertEqual(events[0][0], "STICKSLIP_RECORDING")
        info = self.types.recording_info_t.decode(events[0][1])
        self.assertEqual(info.schema, 3)
        self.assertEqual(info.configuration_sha256,
                         hashlib.sha256(info.configuration.encode()).hexdigest())
        self.assertIn("[rig]", info.configuration)
        self.assertIn("[oscillator]", info.model)

        self.assertEqual(events[-1][0], "STICKSLIP_STATUS")
        status = self.types.status_t.decode(events[-1][1])
        self.assertEqual(status.produced, produced)
        self.assertEqual(status.recorded, recorded)
        self.assertEqual(status.produced, status.recorded + sum(status.record_loss))
        if published:
            self.assertEqual(status.produced, status.published + sum(status.publish_loss))
        return recording

    def excitations(self, log):
        """The drive during each frame."""
        out = []
        for payload in frames.payloads(log, "STICKSLIP_EXCITATION"):
            latest = self.types.excitation_t.decode(payload)
            out += [Drive(latest.sequence - by, drive, amplitude, state >= 0x80)
                    for by, drive, amplitude, state in
                    zip(latest.earlier_by, latest.earlier_drive, latest.earlier_amplitude,
                        latest.earlier_state)]
            out.append(Drive(latest.sequence, latest.drive, latest.amplitude,
                             bool(latest.amplifier_on)))
        return out

    def test_sigterm_ramps_down_and_loses_nothing(self):
        daemon, log = self.start()
        self.wait_for_recording(log, 200_000)
        daemon.send_signal(signal.SIGTERM)
        output = self.end(daemon)
        recording = self.check(output, log)
        drives = self.excitations(log)
        self.assertEqual([drive.sequence for drive in drives],
                         [frame.sequence for frame in recording])
        self.assertGreater(max(drive.amplitude for drive in drives), 1e-3)
        self.assertEqual((drives[-1].drive, drives[-1].amplitude), (0.0, 0.0))
        # Half a second of ramp: the amplitude falls over many frames, without a jump.
        ramp = [drive.amplitude for drive in drives[-450::10]]
        self.assertLess(max(abs(a - b) for a, b in zip(ramp, ramp[1:])), 0.08 * max(ramp))

    def test_the_watchdog_is_off_while_the_queues_drain(self):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
            manager.bind(str(self.folder / "notify"))
            manager.settimeout(PATIENCE_S)
            daemon, _ = self.start("--no-lcm", NOTIFY_SOCKET=str(self.folder / "notify"))
            received = []
            while received.count("WATCHDOG=1") < 3:
                received += manager.recv(4096).decode().split("\n")
            daemon.send_signal(signal.SIGTERM)
            while "STATUS=draining" not in received:
                received += manager.recv(4096).decode().split("\n")
            manager.shutdown(socket.SHUT_RD)  # the daemon does not wait for a reader
            self.end(daemon)
        # Whatever the service manager made of the notifications during the ramp.
        self.assertGreater(received.count("WATCHDOG=1"), 3)
        self.assertEqual([word for word in received if word.startswith("WATCHDOG")][-1], "WATCHDOG_USEC=0")

    def test_a_stop_at_any_moment_loses_nothing(self):
        rng = random.Random(20240711)
        for _ in range(6):
            number = rng.choice([signal.SIGTERM, signal.SIGINT])
            daemon, log = self.start()
            self.wait_for_recording(log, 200)
            time.sleep(rng.uniform(0.0, 0.7))
            daemon.send_signal(number)
            if rng.random() < 0.5:
                time.sleep(rng.uniform(0.0, 0.3))
                if daemon.poll() is None:
                    daemon.send_signal(number)  # the second one stops immediately
            with self.subTest(signal=number):
                self.check(self.end(daemon), log)

    def test_a_duration_is_exact_to_the_frame(self):
        daemon, log = self.start("--duration", "1.5", "--no-lcm")
        output = self.end(daemon)
        self.assertEqual(len(self.check(output, log, published=False)), 1500)
        self.assertEqual(self.excitations(log)[-1].drive, 0.0)
        self.assertFalse(self.excitations(log)[-1].amplifier_on)

    def test_simulated_time_loses_nothing(self):
        config = SOURCE / "config"
        text = CONFIG.read_text().replace("models/", f"{config}/models/")
        self.assertIn("[driver.simulated]\n", text)
        fast = self.write("fast.toml", text.replace("[driver.simulated]\n",
                                                    "[driver.simulated]\nreal_time = false\n"))
        daemon, log = self.start("--duration", "20", "--no-lcm", config=fast)
        output = self.end(daemon)
        self.assertIn("as fast as possible", output)
        self.assertEqual(len(self.check(output, log, published=False)), 20000)

    def test_network_errors_are_in_the_ledger_and_stop_nothing(self):
        daemon, log = self.start("--duration", "2")
        self.wait_for_recording(log)
        # In this test's own network namespace.
        subprocess.run(["ip", "route", "del", "239.255.76.67/32"], check=True)
        self.addCleanup(subprocess.run, ["ip", "route", "add", "239.255.76.67/32", "dev", "lo"])
        output = self.end(daemon)
        self.check(output, log)
        produced, published, lost = self.ledger(output)["publishing"]
        self.assertGreater(published, 0, output)
        self.assertGreater(lost, 0, output)
        self.assertIn("ip route add", output)

    def test_a_missing_route_is_reported_with_its_remedy(self):
        subprocess.run(["ip", "route", "del", "239.255.76.67/32"], check=True)
        self.addCleanup(subprocess.run, ["ip", "route", "add", "239.255.76.67/32", "dev", "lo"])
        daemon, _ = self.start("--duration", "1")
        self.assertIn("ip route add 239.255.76.67/32 dev lo", self.end(daemon, status=2))

    @unittest.skipUnless(os.path.exists("/dev/full"), "no /dev/full here")
    def test_a_full_disk_is_in_the_ledger_and_stops_nothing(self):
        daemon = subprocess.Popen([STICKSLIPD, "--config", str(CONFIG), "--record", "/dev/full",
                                   "--duration", "1"], stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True)
        output = self.end(daemon, status=1)  # the requested recording is missing
        ledger = self.ledger(output)
        produced, recorded, lost = ledger["recording"]
        self.assertEqual(produced, 1000)
        self.assertEqual(produced, recorded + lost)
        self.assertGreater(lost, 0)
        self.assertEqual(ledger["publishing"], (1000, 1000, 0))
        self.assertIn("No space left", output)

    def test_files_of_the_configuration_are_not_written(self):
        config = self.write("rig.toml", CONFIG.read_text().replace('"models/simulated.toml"', '"model.toml"')
                            .replace('"models/', f'"{CONFIG.parent}/models/'))
        self.write("model.toml", (CONFIG.parent / "models/simulated.toml").read_bytes())
        (self.folder / "link.log").symlink_to("model.toml")
        os.link(config, self.folder / "hard.log")
        before = {path.name: path.read_bytes() for path in self.folder.iterdir() if path.is_file()}
        in_file = self.write("records.toml", config.read_text() +
                             '\n[recording]\nenabled = true\nfile = "link.log"\n')
        for arguments, words in (
                (["--record", self.folder / "hard.log"], ("--record", "this configuration")),
                (["--record", self.folder / "link.log"], ("--record", "read as rig.model")),
                (["--control", self.folder / "model.toml"], ("--control", "read as rig.model")),
                (["--config", in_file], ("records.toml:", "recording.file", "read as rig.model"))):
            with self.subTest(arguments=arguments):
                chosen = [] if "--config" in arguments else ["--config", config]
                result = subprocess.run([STICKSLIPD, *chosen, *arguments, "--duration", "0.1"],
                                        capture_output=True, text=True, timeout=PATIENCE_S)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
                for word in words:
                    self.assertIn(word, result.stderr)
        after = {path.name: path.read_bytes() for path in self.folder.iterdir() if path.is_file()}
        del after["records.toml"]
        self.assertEqual(after, before)

    def test_invalid_arguments_are_reported_in_one_line(self):
        for arguments, words in (
                (["--config", str(self.folder / "none.toml")], "none.toml"),
                (["--config", str(CONFIG), "--record", str(self.folder / "x.csv")], "stickslip convert"),
                (["--config", str(CONFIG), "--record", "/nowhere/x.log"], "/nowhere/x.log"),
                (["--config", str(CONFIG), "--lcm-url", "nonsense://"], "nonsense://"),
                (["--config", str(CONFIG), "--lcm-url", "udpm://239.255.76.67:7667?tll=0"],
                 "did you mean ttl?"),
                (["--config", str(CONFIG), "--duration", "-1"], "--duration")):
            with self.subTest(arguments=arguments):
                result = subprocess.run([STICKSLIPD, *arguments], capture_output=True, text=True,
                                        timeout=PATIENCE_S)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn(words, result.stderr)
                self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)


if __name__ == "__main__":
    main()
