# SPDX-License-Identifier: Apache-2.0
"""A recording replayed through the daemon is bit-identical, and so are the observer's estimates of every
replay."""
import unittest

import frames
from programs import SOURCE, STICKSLIPD, EndToEnd, main, run

MODEL = SOURCE / "config/models/simulated.toml"


class ReplayThroughTheDaemon(EndToEnd):
    def setUp(self):
        super().setUp()
        self.types = frames.generate_types(self.folder)

    def daemon(self, config, log, seconds=None):
        command = [STICKSLIPD, "--config", config, "--record", log]
        if seconds:
            command += ["--duration", seconds]
        result = run(*command)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return log

    def replay(self, recording, name, speed):
        config = self.write(f"{name}.toml", f"""
            schema = 1
            [rig]
            name = "replayed"
            model = "{MODEL}"
            [driver]
            kind = "replay"
            [driver.replay]
            recording = "{recording}"
            speed = {speed}
            """)
        return self.daemon(config, self.folder / f"{name}.log")

    def record_simulated(self):
        return self.daemon(SOURCE / "config/simulated.toml", self.folder / "simulated.log", seconds=4)

    def test_frames_are_bit_identical(self):
        original = self.record_simulated()
        before = frames.frames(original, self.types)
        self.assertGreater(len(before), 3000)
        self.assertEqual(len({frame.sequence for frame in before}), len(before))
        for name, speed in (("as_fast_as_it_goes", 0.0), ("four_times", 4.0)):
            with self.subTest(speed=speed):
                after = frames.frames(self.replay(original, name, speed), self.types)
                self.assertEqual(len(after), len(before))
                self.assertEqual(after, before)

    def test_a_csv_is_replayed_like_the_log_it_was_converted_from(self):
        original = self.record_simulated()
        csv = self.folder / "simulated.csv"
        self.succeed("convert", original, csv)
        before = frames.frames(original, self.types)
        after = frames.frames(self.replay(csv, "from_csv", 0.0), self.types)
        # A CSV has no sequence numbers; everything else is the same.
        self.assertEqual([(f.time_ns, f.valid, f.values) for f in after],
                         [(f.time_ns, f.valid, f.values) for f in before])

    def test_estimates_are_bit_identical_in_every_replay(self):
        original = self.record_simulated()
        first, second = (
            frames.payloads(self.replay(original, name, 0.0), "STICKSLIP_ESTIMATE")
            for name in ("once", "again"))
        self.assertGreater(len(first), 0)
        self.assertEqual(first, second)
        # Guards against estimates that are all alike.
        self.assertGreater(len(set(first)), len(first) // 2)


if __name__ == "__main__":
    main()
