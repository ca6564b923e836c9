# SPDX-License-Identifier: Apache-2.0
"""Stock lcm-logplayer plays our logs, stock lcm-logger records our daemon; `stickslip record` and an
independent subscriber receive what `stickslip replay` publishes; each tool ends with the right status."""
import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest

import frames
from programs import PATIENCE_S, SOURCE, STICKSLIP, STICKSLIPD, EndToEnd, main, run, stickslip

FRAME_COUNT = 1500
BLOCKS = 150
CSV = "time_s,displacement_m,friction_force_n,base_displacement_m\n" + "".join(
    f"{1.7 + i / 1000:.3f},{1e-3 * ((i * 7919) % 1009) / 3.0!r},{'' if i % 50 == 3 else 0.1 * (i % 3)},{2e-3 * (i % 5)}\n"
    for i in range(FRAME_COUNT))


class RecordingsOnLcm(EndToEnd):
    def setUp(self):
        super().setUp()
        self.csv = self.write("in.csv", CSV)
        self.log = self.folder / "in.log"
        self.succeed("convert", self.csv, self.log)

    def start(self, *command, **options):
        process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, **options)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    def recorder(self, *arguments):
        """`stickslip record`, when it is ready."""
        recorder = self.start(STICKSLIP, "record", *arguments)
        self.assertIn("recording", recorder.stdout.readline())
        return recorder

    def independent_listener(self, seconds, *options):
        """The independent subscriber, when it is ready."""
        listener = self.start(sys.executable, SOURCE / "tests/end_to_end/lcm_subscriber.py",
                              "--duration", seconds, *options)
        self.assertEqual(listener.stderr.readline(), "listening\n")
        return listener

    def test_a_log_plays_in_stock_logplayer(self):
        player = shutil.which("lcm-logplayer")
        if player is None:
            self.skipTest("lcm-logplayer is not installed")
        listener = self.independent_listener(4)
        began = time.monotonic()
        played = subprocess.run([player, "--lcm-url=udpm://239.255.76.67:7667?ttl=0", str(self.log)],
                                capture_output=True, text=True, timeout=PATIENCE_S)
        took = time.monotonic() - began
        self.assertEqual(played.returncode, 0, played.stderr)
        self.assertGreater(took, 1.3, "the player did not keep the recording's pace")
        heard = json.loads(listener.communicate(timeout=PATIENCE_S)[0])
        self.assertEqual(heard["messages"], {"STICKSLIP_FRAMES": BLOCKS, "STICKSLIP_RECORDING": 1})
        self.assertEqual((heard["frames"], heard["lost"]), (FRAME_COUNT, 0))

    def stock_logger(self, log):
        """Stock lcm-logger, once it receives."""
        program = shutil.which("lcm-logger")
        if program is None:
            self.skipTest("lcm-logger is not installed")
        url = "udpm://239.255.76.67:7667?ttl=0"
        logger = self.start(program, "--flush-interval=50", f"--lcm-url={url}", log)
        deadline = time.monotonic() + PATIENCE_S
        # It says nothing when it is ready: other messages are sent until it has recorded one.
        while not log.exists() or log.stat().st_size == 0:
            self.assertLess(time.monotonic(), deadline, "lcm-logger recorded nothing")
            self.assertIsNone(logger.poll(), "lcm-logger ended")
            self.announce()
            time.sleep(0.05)
        return logger

    def announce(self):
        """A message of another program, on a channel of its own."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            sender.sendto(struct.pack(">II", 0x4C433032, 0) + b"OTHER\0hello", ("239.255.76.67", 7667))

    def test_the_stock_logger_records_a_daemon_and_its_losses_are_gaps(self):
        config = self.write("rig.toml", f"""
            schema = 1
            [rig]
            name = "stock"
            model = "{SOURCE}/config/models/simulated.toml"
            [driver]
            kind = "simulated"
            """)
        log = self.folder / "stock.log"
        logger = self.stock_logger(log)
        # It records too, so that its status has a ledger, which the received log is compared with.
        daemon = run(STICKSLIPD, "--config", config, "--duration", 2, "--record", self.folder / "own.log",
                     "--control", self.folder / "control.sock")
        self.assertEqual(daemon.returncode, 0, daemon.stdout + daemon.stderr)
        self.assert_growth_ends(log)
        logger.send_signal(signal.SIGINT)
        logger.communicate(timeout=PATIENCE_S)
        text = self.succeed("log", "check", log).stdout
        self.assertNotIn("damaged", text)
        info = json.loads(self.succeed("log", "info", log, "--json").stdout)
        self.assertGreater(info["frames"]["count"], 1000)
        if info["frames"]["missing"] == 0:  # a stalled machine may lose datagrams
            self.assertIn("stock.log: intact", text)
        self.assert_holes_are_gaps(log, info["frames"]["count"])

    def assert_growth_ends(self, log):
        """Waits until the logger has written what it received: its size is the same for a second."""
        size, since = -1, time.monotonic()
        while time.monotonic() - since < 1:
            if log.stat().st_size != size:
                size, since = log.stat().st_size, time.monotonic()
            time.sleep(0.05)

    def assert_holes_are_gaps(self, log, frame_count):
        """The same log without every seventh block of frames, as if those had been lost."""
        whole, at, kept, number = log.read_bytes(), 0, b"", 0
        blocks = 0
        for channel, payload in frames.events(log):
            length = 28 + len(channel) + len(payload)
            block = channel == "STICKSLIP_FRAMES"
            blocks += block
            if not (block and blocks % 7 == 3):
                # The logger numbers what it receives.
                kept += whole[at:at + 4] + struct.pack(">q", number) + whole[at + 12:at + length]
                number += 1
            at += length
        holes = self.write("holes.log", kept)
        text = self.succeed("log", "check", holes).stdout
        self.assertRegex(text, r"holes.log: with gaps\n +\d+ frames missing in \d+ gaps")
        self.assertNotIn("damaged", text)
        info = json.loads(self.succeed("log", "info", holes, "--json").stdout)
        self.assertLess(info["frames"]["count"], frame_count)
        self.assertAlmostEqual(info["rate_hz"], 1000, delta=1)

    def test_replay_record_and_an_independent_subscriber_agree(self):
        rows = [line.split(",") for line in CSV.splitlines()[1:]]
        for block in (10, 1500):  # one packet, and a message in fragments
            with self.subTest(block=block):
                listener = self.independent_listener(4, "--frames")
                out = {kind: self.folder / f"out-{block}.{kind}" for kind in ("log", "csv")}
                recorders = [self.recorder(file, "--duration", 3) for file in out.values()]
                replay = self.succeed("replay", self.log, "--speed", 2, "--block", block)
                self.assertIn(f"published {FRAME_COUNT} of {FRAME_COUNT} frames", replay.stdout)
                for recorder in recorders:
                    output = recorder.communicate(timeout=PATIENCE_S)[0]
                    self.assertEqual(recorder.returncode, 0, output)
                    self.assertIn(f"{FRAME_COUNT} frames", output)
                    self.assertIn("lost 0 frames in 0 gaps", output)
                heard = [json.loads(line) for line in listener.communicate(timeout=PATIENCE_S)[0].splitlines()]
                self.assertEqual(len(heard), FRAME_COUNT)
                for row, frame in zip(rows, heard):
                    self.assertEqual(frame["time_ns"], round(float(row[0]) * 1000) * 1000000)
                    self.assertEqual(frame["displacement_m"], float(row[1]))
                    self.assertEqual(frame["friction_force_n"], float(row[2]) if row[2] else None)
                    self.assertIsNone(frame["velocity_m_s"])
                types = frames.generate_types(self.folder)
                self.assertEqual(frames.frames(out["log"], types), frames.frames(self.log, types))
                self.succeed("convert", self.csv, self.folder / "again.csv")
                self.assertEqual(out["csv"].read_bytes(), (self.folder / "again.csv").read_bytes())

    def test_replay_publishes_everything_in_its_order_and_pace(self):
        """Events, estimates, status and whatever else a log holds, unaltered, not only its frames."""
        source = [(channel, payload) for channel, payload in frames.events(self.log)]
        mixed, number = b"", 0
        for i, (channel, payload) in enumerate(source):
            extra = [(name, f"{name} {i}".encode()) for name in ("STICKSLIP_EVENT", "STICKSLIP_STATUS",
                     "STICKSLIP_ESTIMATE", "STICKSLIP_EXCITATION")] if i % 30 == 5 else []
            for name, data in ((channel, payload), *extra):
                name = name.encode() if isinstance(name, str) else name
                mixed += struct.pack(">IqqII", 0xEDA1DA01, number, 1_000_000 + 10_000 * i, len(name),
                                     len(data)) + name + data
                number += 1
        log, out = self.write("mixed.log", mixed), self.folder / "out.log"
        recorder = self.recorder(out, "--frames", FRAME_COUNT)
        began = time.monotonic()
        text = self.succeed("replay", log, "--speed", 2).stdout
        self.assertGreater(time.monotonic() - began, 0.7)
        self.assertIn(f"published {FRAME_COUNT} of {FRAME_COUNT} frames in {BLOCKS} blocks and 21 other "
                      "messages", text)
        recorder.communicate(timeout=PATIENCE_S)
        received = list(frames.events(out))[1:]  # without the recorder's own description
        self.assertEqual(received, list(frames.events(log)))

    def test_record_counts_what_is_missing(self):
        log = self.folder / "holes.log"
        # A CSV counts from 0, so blocks are removed from a complete log.
        events = list(frames.events(self.log))
        self.assertEqual(len(events), BLOCKS + 1)
        whole = self.log.read_bytes()
        at, kept = 0, b""
        for i, (channel, payload) in enumerate(events):
            length = 28 + len(channel) + len(payload)
            if i not in (40, 41, 90):
                kept += whole[at:at + length]
            at += length
        log.write_bytes(kept)
        out = self.folder / "out.log"
        recorder = self.recorder(out, "--duration", 2)
        self.succeed("replay", log, "--speed", 3)
        output = recorder.communicate(timeout=PATIENCE_S)[0]
        self.assertIn("1470 frames", output)
        self.assertIn("lost 30 frames in 2 gaps", output)

    def test_record_stops_at_its_count_and_at_signals(self):
        for name, arguments, stop, expected in (
                ("count", ("--frames", 333), None, "333 frames"),
                ("interrupt", (), signal.SIGINT, f"{FRAME_COUNT} frames"),
                ("terminate", (), signal.SIGTERM, f"{FRAME_COUNT} frames")):
            with self.subTest(name):
                out = self.folder / f"{name}.log"
                recorder = self.recorder(out, *arguments)
                self.succeed("replay", self.log, "--speed", 4)
                if stop is not None:
                    recorder.send_signal(stop)
                output, errors = recorder.communicate(timeout=PATIENCE_S)
                self.assertEqual(recorder.returncode, 0, errors)
                self.assertIn(expected, output)
                self.succeed("convert", out, self.folder / f"{name}.csv")

    def test_record_refuses_two_sources_in_one(self):
        out = self.folder / "out.log"
        recorder = self.recorder(out)
        self.succeed("replay", self.log, "--speed", 10)
        self.succeed("replay", self.log, "--speed", 10)
        output, errors = recorder.communicate(timeout=PATIENCE_S)
        self.assertEqual(recorder.returncode, 1, output + errors)
        self.assertIn("jumped back", errors)
        types = frames.generate_types(self.folder)
        self.assertEqual(frames.frames(out, types), frames.frames(self.log, types))

    def test_replay_stops_at_a_signal(self):
        replay = self.start(STICKSLIP, "replay", self.log, "--speed", 0.1)
        time.sleep(1)
        replay.send_signal(signal.SIGTERM)
        output, errors = replay.communicate(timeout=PATIENCE_S)
        self.assertEqual(replay.returncode, 0, errors)
        self.assertIn("(stopped)", output)

    def test_spy_shows_rates_and_values(self):
        spy = self.start(STICKSLIP, "spy", "--once")
        replay = self.start(STICKSLIP, "replay", self.log, "--speed", 0.5)
        output, errors = spy.communicate(timeout=PATIENCE_S)
        replay.kill()
        self.assertEqual(spy.returncode, 0, errors)
        line = next(line for line in output.splitlines() if line.startswith("STICKSLIP_FRAMES"))
        self.assertRegex(line, r"lost 0 in 0 gaps.*displacement .* m, friction_force .* N")
        self.assertNotIn("velocity", line)

    def test_no_traffic(self):
        for command in (("record", self.folder / "none.log", "--duration", 0.5),
                        ("spy", "--duration", 0.5)):
            with self.subTest(command[0]):
                result = stickslip(*command)
                self.assertEqual(result.returncode, 1, result.stdout + result.stderr)

    def test_a_port_in_use_is_reported_in_one_line(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as greedy:
            greedy.bind(("0.0.0.0", 7667))  # without SO_REUSEADDR: exclusively
            for command in (["spy", "--duration", 1], ["record", self.folder / "none.log", "--duration", 1],
                            ["scope", "--listen", "127.0.0.1:0"]):
                with self.subTest(command=command[0]):
                    result = stickslip(*command)
                    self.assertEqual(result.returncode, 2, result.stderr)
                    self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
                    self.assertIn("does not receive its own messages", result.stderr)
                    self.assertIn("7667", result.stderr)

    def test_urls_are_judged_as_by_check(self):
        cases = {"udpm:/239.255.76.67:7667": "expected udpm://ADDRESS:PORT",
                 "udpm://239.255.76.67:7667?tll=0": "did you mean ttl?",
                 "udpm://239.255.76.67:7667?ttl=300": "from 0 to 255"}
        config = (SOURCE / "config/simulated.toml").read_text().replace(
            '"models/', f'"{SOURCE}/config/models/')
        for url, words in cases.items():
            judged = stickslip("check", self.write("rig.toml", config + f'\n[lcm]\nurl = "{url}"\n'))
            sentence = judged.stderr[judged.stderr.index("lcm.url: ") + len("lcm.url: "):].splitlines()[0]
            self.assertIn(words, sentence)
            for command in (("spy", "--once"), ("record", self.folder / "out.log"), ("replay", self.log),
                            ("scope", "--listen", "127.0.0.1:0")):
                for given in (("--url", url), ()):
                    environment = {**os.environ, **({} if given else {"LCM_DEFAULT_URL": url})}
                    with self.subTest(url=url, command=command[0], given=given):
                        result = stickslip(*command, *given, env=environment)
                        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                        self.assertIn(sentence, result.stderr)
                        self.assertFalse((self.folder / "out.log").exists())
            environment = {**os.environ, "LCM_DEFAULT_URL": url}
            self.assertEqual(stickslip("spy", "--help", env=environment).returncode, 0)

    def test_bad_urls_are_refused_in_one_line(self):
        cases = ("nonsense", "foo://x", "udpm://239.255.76.67:99999", "udpm://10.0.0.1:7667",
                 "udpm://224.1.1.1:7667")  # the last: a group without a route
        for url in cases:
            for command in (("spy", "--once"), ("record", self.folder / "out.log"),
                            ("replay", self.log)):
                with self.subTest(url=url, command=command[0]):
                    result = stickslip(*command, "--url", url)
                    self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                    self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                    self.assertIn(url, result.stderr)
        for out in ("/nowhere/at/all.log", "/nowhere/at/all.csv", self.folder / "out.txt"):
            with self.subTest(out=out):
                result = stickslip("record", out)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                self.assertIn(str(out), result.stderr)


if __name__ == "__main__":
    main()
