# SPDX-License-Identifier: Apache-2.0
"""Recordings survive: a killed daemon leaves a readable log with small losses, parts form one
recording, and damage is found, reported and repaired."""
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import time

import frames
from programs import PATIENCE_S, SOURCE, STICKSLIP, STICKSLIPD, EndToEnd, main, stickslip

CONFIG = SOURCE / "config/simulated.toml"


class RecordingsSurvive(EndToEnd):
    def setUp(self):
        super().setUp()
        self.types = frames.generate_types(self.folder)

    def start(self, *command):
        process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    def rig(self, name, recording, fast=False):
        """The simulated rig with further keys of its recording."""
        text = CONFIG.read_text().replace("models/", f"{SOURCE}/config/models/")
        if fast:
            self.assertIn("[driver.simulated]\n", text)
            text = text.replace("[driver.simulated]\n", "[driver.simulated]\nreal_time = false\n")
        self.assertNotIn("[recording]", text)
        log = self.folder / f"{name}.log"
        return self.write(f"{name}.toml", text + f'\n[recording]\nenabled = true\nfile = "{log}"\n'
                          + recording), log

    def run_rig(self, config, seconds):
        result = subprocess.run([STICKSLIPD, "--config", config, "--no-lcm", "--duration",
                                 str(seconds)], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return result.stdout + result.stderr

    def test_a_killed_daemon_costs_less_than_a_second(self):
        rng = random.Random(20240712)
        for kill in range(4):
            heard = self.folder / f"heard{kill}.log"
            listener = self.start(STICKSLIP, "record", heard)
            self.assertIn("recording", listener.stdout.readline())
            log = self.folder / f"killed{kill}.log"
            daemon = self.start(STICKSLIPD, "--config", CONFIG, "--record", log)
            until = time.monotonic() + PATIENCE_S
            while not log.exists() or log.stat().st_size < 20_000:  # frames have been flushed
                self.assertLess(time.monotonic(), until, "the recording does not grow")
                time.sleep(0.01)
            time.sleep(rng.uniform(0.0, 1.5))
            daemon.kill()
            daemon.wait()
            time.sleep(0.1)  # messages published before the kill arrive
            listener.send_signal(signal.SIGTERM)
            output, _ = listener.communicate(timeout=PATIENCE_S)
            self.assertEqual(listener.returncode, 0, output)

            csv = self.folder / f"killed{kill}.csv"
            self.succeed("convert", log, csv)
            recorded = stickslip("log", "info", log, "--json")
            self.assertEqual(recorded.returncode, 0, recorded.stderr)
            info = json.loads(recorded.stdout)
            self.assertEqual(info["rig"], "simulated rig")
            self.assertEqual(info["frames"]["gaps"], 0)
            self.assertEqual(info["frames"]["first_sequence"], 0)
            last_heard = frames.frames(heard, self.types)[-1].sequence
            self.assertGreater(last_heard, 0)
            # 1000 frames a second.
            self.assertGreater(info["frames"]["last_sequence"], last_heard - 1000)
            for text in ("configuration", "model"):
                self.assertTrue(info["texts"][text]["verified"])

    def test_an_existing_log_is_kept(self):
        config, log = self.rig("twice", "", fast=True)
        self.run_rig(config, 1)
        before = log.read_bytes()
        self.assertIn("kept as", self.run_rig(config, 1))
        kept = [path for path in self.folder.glob("twice.*.log")]
        self.assertEqual(len(kept), 1)
        self.assertEqual(kept[0].read_bytes(), before)

    def test_parts_are_one_recording(self):
        for name, recording, least in (("by_time", "rotate_s = 2\n", 5),
                                       ("by_size", "rotate_mb = 0.2\n", 4)):
            with self.subTest(rotation=name):
                config, log = self.rig(name, recording, fast=True)
                output = self.run_rig(config, 10)
                parts = [log, *sorted(self.folder.glob(f"{name}.0*.log"))]
                self.assertGreaterEqual(len(parts), least)
                self.assertIn("recording: 10000 produced = 10000 recorded", output)
                sequences = []
                for number, part in enumerate(parts):
                    events = list(frames.events(part))
                    self.assertEqual(events[0][0], "STICKSLIP_RECORDING")
                    info = self.types.recording_info_t.decode(events[0][1])
                    self.assertEqual(info.part, number)
                    self.assertEqual(info.previous_part, parts[number - 1].name if number else "")
                    self.assertEqual(info.frames_before, len(sequences))
                    self.assertIn("[rig]", info.configuration)
                    sequences += [frame.sequence for frame in frames.frames(part, self.types)]
                    self.assertEqual(events[-1][0], "STICKSLIP_STATUS")
                    status = self.types.status_t.decode(events[-1][1])
                    self.assertEqual(status.recorded, len(sequences))
                self.assertEqual(sequences, list(range(10000)))

                self.succeed("log", "check", *parts)
                whole = self.folder / f"{name}_whole.log"
                self.succeed("log", "join", *reversed(parts), "--out", whole)
                self.succeed("log", "check", whole)
                self.assertEqual([frame.sequence for frame in frames.frames(whole, self.types)],
                                 sequences)

                lacking = stickslip("log", "check", parts[0], *parts[2:])
                self.assertEqual(lacking.returncode, 1, lacking.stdout)
                self.assertIn("part 1 is missing", lacking.stdout)
                refused = stickslip("log", "join", parts[0], parts[2], "--out", self.folder / "x.log")
                self.assertEqual(refused.returncode, 2)
                self.assertIn("part 1 is missing", refused.stderr)
                self.assertFalse((self.folder / "x.log").exists())

    def test_damage_is_found_reported_and_repaired(self):
        config, log = self.rig("damaged", "", fast=True)
        self.run_rig(config, 2)
        self.assertIn("damaged.log: intact", self.succeed("log", "check", log).stdout)
        content = bytearray(log.read_bytes())
        middle = content.index(b"\xed\xa1\xda\x01", len(content) // 2)
        content[middle:middle + 40] = b"\0" * 40
        log.write_bytes(content[:-7])
        read = stickslip("convert", log, self.folder / "x.csv")
        self.assertEqual(read.returncode, 2)
        self.assertIn(f"at byte {middle}", read.stderr)
        self.assertIn("stickslip log repair", read.stderr)
        checked = stickslip("log", "check", log)
        self.assertEqual(checked.returncode, 1, checked.stderr)
        self.assertIn("damaged in 1 place", checked.stdout)
        self.assertIn(f"at byte {middle}", checked.stdout)
        self.assertIn("truncated", checked.stdout)
        mended = self.folder / "mended.log"
        output = self.succeed("log", "repair", log, "--out", mended).stdout
        self.assertIn("1 place outside of events", output)
        self.succeed("convert", mended, self.folder / "mended.csv")
        left = len((self.folder / "mended.csv").read_text().splitlines()) - 1
        self.assertGreaterEqual(left, 1980)
        self.assertLess(left, 2001)
        # It is intact now, though incomplete, which its ledger cannot show after the cut.
        self.assertNotIn("damaged in", stickslip("log", "check", mended).stdout)

    def wait_for(self, what, condition):
        until = time.monotonic() + PATIENCE_S
        while not condition():
            self.assertLess(time.monotonic(), until, what)
            time.sleep(0.01)

    def start_daemon(self, config, name, within=()):
        """The daemon with a control socket of that name, behind a command that becomes the daemon."""
        errors = open(self.folder / f"{name}.txt", "w+")
        self.addCleanup(errors.close)
        daemon = subprocess.Popen([*within, STICKSLIPD, "--config", config, "--no-lcm", "--control",
                                   self.folder / f"{name}.sock"], stderr=errors)
        self.addCleanup(daemon.wait)
        self.addCleanup(daemon.kill)
        return daemon, lambda: (self.folder / f"{name}.txt").read_text()

    def stop(self, daemon):
        daemon.send_signal(signal.SIGTERM)
        return daemon.wait(timeout=PATIENCE_S)

    def events(self, log):
        """Codes of the events in a log."""
        return [self.types.event_t.decode(content).code
                for channel, content in frames.events(log) if channel == "STICKSLIP_EVENT"]

    def test_a_log_in_use_is_never_renamed_or_written_to(self):
        config, log = self.rig("used", "rotate_mb = 0.1\n")
        second = self.folder / "used.001.log"
        daemon, _ = self.start_daemon(config, "first")
        self.wait_for("no second part", lambda: second.exists() and second.stat().st_size > 20_000)
        # Tidied up by a person: the name of the first part is free, the recording is not.
        tidied = log.rename(self.folder / "tidied.log")
        names = {path.name for path in self.folder.glob("*.log")}
        for socket, words in (("first.sock", ("first.sock", "another daemon")),
                              ("other.sock", ("used.0", "is being written by"))):
            with self.subTest(socket=socket):
                refused = subprocess.run(
                    [STICKSLIPD, "--config", config, "--no-lcm", "--duration", "1", "--control",
                     self.folder / socket], capture_output=True, text=True, timeout=PATIENCE_S)
                self.assertEqual(refused.returncode, 2, refused.stderr)
                for word in (*words, f"process {daemon.pid}", "stop "):
                    self.assertIn(word, refused.stderr)
                self.assertNotIn("kept as", refused.stderr)
        self.assertLessEqual(names, {path.name for path in self.folder.glob("*.log")})
        part = max(path for path in self.folder.glob("used.0*.log"))
        for command in (("record", part, "--frames", "1"), ("convert", tidied, part)):
            refused = stickslip(*command)
            if part == max(path for path in self.folder.glob("used.0*.log")):  # still the latest
                self.assertEqual(refused.returncode, 2, refused.stdout)
                self.assertRegex(refused.stderr, rf"{part}.*process {daemon.pid} \(stickslipd\)")
        self.assertEqual(self.stop(daemon), 0)
        parts = [tidied, *self.folder.glob("used.0*.log")]
        self.succeed("log", "join", *parts, "--out", self.folder / "joined.log")
        self.assertFalse((self.folder / "first.sock").exists())

    def test_a_full_disk_is_reported_and_the_tail_is_kept(self):
        disk = self.folder / "disk"
        disk.mkdir()
        on_disk = ["unshare", "--mount", "sh", "-c",
                   f"mount -t tmpfs -o size=2m none '{disk}' && \"$@\"; status=$?; "
                   f"cp '{disk}'/* '{self.folder}'; exit $status", "sh"]
        probe = subprocess.run([*on_disk, "touch", disk / "probe"], capture_output=True, text=True)
        if probe.returncode != 0:
            self.skipTest(f"no small file system can be mounted: {probe.stderr.strip()}")
        config, log = self.rig("full", f'[metrics]\nfile = "{self.folder}/full.prom"\n', fast=True)
        result = subprocess.run(
            [*on_disk, STICKSLIPD, "--config", config, "--no-lcm", "--duration", "60", "--record",
             disk / "full.log"], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn("the recording is not whole", result.stderr)
        self.assertIn("No space left on device", result.stderr)
        self.assertIn("recording_fails", self.events(log))
        channel, content = list(frames.events(log))[-1]
        self.assertEqual(channel, "STICKSLIP_STATUS")
        status = self.types.status_t.decode(content)
        self.assertEqual(status.produced, 60000)
        self.assertEqual(status.recorded, len(frames.frames(log, self.types)))
        self.assertEqual(status.recorded + sum(status.record_loss), 60000)
        self.assertGreater(status.recorded, 5000)
        metrics = (self.folder / "full.prom").read_text()
        self.assertRegex(metrics, r"(?m)^stickslip_recording_failing\{.*\} 1$")
        self.assertRegex(metrics, r'(?m)^stickslip_frames_lost_total\{.*"recorder",reason="write_error"'
                                  r"\} [1-9]")
        self.succeed("log", "info", log)

    def test_a_log_that_vanishes_is_begun_anew(self):
        for how, status in (("deleted", 1), ("moved", 0)):
            with self.subTest(how=how):
                config, log = self.rig(how, "")
                daemon, errors = self.start_daemon(config, how)
                self.wait_for("it does not grow", lambda: log.exists() and log.stat().st_size > 20_000)
                moved = log.rename(self.folder / f"{how}_away.log")
                if how == "deleted":
                    moved.unlink()
                self.wait_for("no new log", lambda: log.exists() and log.stat().st_size > 20_000)
                self.assertEqual(self.stop(daemon), status, errors())
                self.assertIn(f"{log} was deleted" if how == "deleted" else f"{log} is not in its place",
                              errors())
                self.assertIn("log_begun_anew", self.events(log))
                channel, content = next(iter(frames.events(log)))
                self.assertEqual(channel, "STICKSLIP_RECORDING")
                info = self.types.recording_info_t.decode(content)
                self.assertEqual(info.part, 1)
                self.assertIn("[rig]", info.configuration)
                self.succeed("log", "check", log)
                if how == "moved":
                    joined = self.folder / "both.log"
                    self.succeed("log", "join", moved, log, "--out", joined)
                    sequences = [one.sequence for one in frames.frames(joined, self.types)]
                    self.assertEqual(sequences, list(range(len(sequences))))

    def test_a_log_whose_folder_is_covered_by_a_mount_is_begun_anew(self):
        namespace = ("unshare", "--mount") if os.geteuid() == 0 else ("unshare", "--map-root-user", "--mount")
        enter = ("nsenter", "--mount") if os.geteuid() == 0 else ("nsenter", "--user", "--preserve-credentials",
                                                                  "--mount")
        probe = subprocess.run([*namespace, "mount", "-t", "tmpfs", "none", self.folder], capture_output=True,
                               text=True)
        if probe.returncode != 0:
            self.skipTest(f"no file system can be mounted: {probe.stderr.strip()}")
        disk = self.folder / "disk"
        disk.mkdir()
        config, _ = self.rig("covered", "")
        config.write_text(config.read_text().replace("covered.log", "disk/run.log"))
        old = disk / "run.log"
        daemon, errors = self.start_daemon(config, "covered", namespace)
        self.wait_for("it does not grow", lambda: old.exists() and old.stat().st_size > 20_000)
        subprocess.run([*enter, "--target", str(daemon.pid), "mount", "-t", "tmpfs", "none", str(disk)],
                       check=True)
        # The folder as the daemon sees it; the mount lasts as long as this is open.
        seen = os.open(f"/proc/{daemon.pid}/root{disk}", os.O_RDONLY)
        self.addCleanup(os.close, seen)
        new = pathlib.Path(f"/proc/self/fd/{seen}/run.log")
        self.wait_for("no new log", lambda: new.exists() and new.stat().st_size > 20_000)
        self.assertEqual(self.stop(daemon), 0, errors())
        self.assertIn(f"{old} is not in its place", errors())
        self.assertIn("log_begun_anew", self.events(new))
        after = self.folder / "after.log"
        after.write_bytes(new.read_bytes())
        self.succeed("log", "join", old, after, "--out", self.folder / "both.log")
        sequences = [one.sequence for one in frames.frames(self.folder / "both.log", self.types)]
        self.assertEqual(sequences, list(range(len(sequences))))

    def test_a_log_that_cannot_be_begun_anew_is_a_loss(self):
        (self.folder / "gone").mkdir()
        config, log = self.rig("gone/run", "")
        daemon, errors = self.start_daemon(config, "lost")
        self.wait_for("it does not grow", lambda: log.exists() and log.stat().st_size > 20_000)
        log.unlink()
        log.parent.joinpath("run.toml").unlink()
        log.parent.rmdir()
        self.wait_for("not noticed", lambda: "was deleted" in errors())
        self.assertEqual(self.stop(daemon), 1)
        self.assertIn("a new log cannot be begun", errors())
        self.assertRegex(errors(), r"the recording is not whole: \d+ of \d+ frames were lost")

    def test_info_describes_a_log(self):
        config, log = self.rig("described", "", fast=True)
        self.run_rig(config, 3)
        output = self.succeed("log", "info", log).stdout
        for line in (r"rig +simulated rig", r"program +stickslipd \d", r"part +0, the first",
                     r"configuration +SHA-256 [0-9a-f]{64}, verified", r"duration +2\.999 s",
                     r"rate +1000 Hz", r"frames +3000, .*no gap", r"displacement +-\S+ to \S+ m",
                     r"ledger +3000 produced = 3000 recorded$"):
            self.assertRegex(output, re.compile(line, re.MULTILINE))

    def test_exports_are_written_and_a_csv_has_every_frame(self):
        config, log = self.rig("out", "", fast=True)
        self.run_rig(config, 2)
        for ending in ("csv", "mat", "h5"):
            output = self.succeed("log", "export", log, self.folder / f"out.{ending}").stdout
            self.assertIn("2000 rows of frames, 2000 rows of excitation, 200 rows of estimate", output)
        rows = [line for line in (self.folder / "out.csv").read_text().splitlines()
                if not line.startswith("#")]
        self.assertEqual(len(rows), 2001)
        self.assertTrue(rows[0].startswith("time_s,time_ns,sequence,valid,gap,displacement_m"), rows[0])
        refused = stickslip("log", "export", log, self.folder / "out.xyz")
        self.assertEqual(refused.returncode, 2)
        self.assertIn("expected .csv, .mat or .h5", refused.stderr)

    def test_bad_arguments_are_refused_in_one_line(self):
        csv = self.write("in.csv", "time_s,displacement_m\n0,1\n0.1,2\n")
        for arguments, word in ((("log",), "no command"), (("log", "check"), "FILE"),
                                (("log", "repair", csv), "--out"),
                                (("log", "check", csv), "not an LCM event log"),
                                (("log", "info", self.folder / "absent.log"), "absent.log"),
                                (("log", "check", self.folder), "folder")):
            with self.subTest(arguments=arguments):
                result = stickslip(*arguments)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                self.assertIn(word, result.stderr)


if __name__ == "__main__":
    main()
