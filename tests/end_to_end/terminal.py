# SPDX-License-Identifier: Apache-2.0
"""Progress, colours and the live table on a pseudo terminal and in a pipe."""
import json
import math
import os
import re
import signal
import socket
import struct
import subprocess
import time

import pseudo_terminal
from programs import SOURCE, STICKSLIP, EndToEnd, main, run

GROUP = ("239.255.76.67", 7667)
CSV = "time_s,displacement_m,friction_force_n\n" + "".join(
    f"{i / 100:.2f},{1e-3 * (i % 7)!r},{0.1 * (i % 3)!r}\n" for i in range(200))
ERASE_LINE = "\r\033[K"


def environment(**changes):
    """The environment with a colour terminal and changes; None removes a variable."""
    out = {**os.environ, "TERM": "xterm-256color"}
    out.pop("NO_COLOR", None)
    for name, value in changes.items():
        out.pop(name, None)
        if value is not None:
            out[name] = value
    return out


def on_a_terminal(*command, env=None, **options):
    return pseudo_terminal.OnATerminal(*command, env=env or environment(), **options)


class Progress(EndToEnd):
    """Progress of a replay, which takes the 2 s of its recording."""

    def setUp(self):
        super().setUp()
        self.recording = self.write("run.csv", CSV)

    def test_it_appears_with_the_time_left_and_is_erased(self):
        replay = on_a_terminal(STICKSLIP, "replay", self.recording, piped=True)
        shown = replay.end()
        drawn = [line for line in shown.split(ERASE_LINE) if line]
        self.assertTrue(drawn, "it did not appear")
        self.assertGreaterEqual(replay.first_s, 1.0, "it appeared before the first second")
        self.assertLessEqual(len(drawn), 10 * replay.took_s, "drawn more than ten times a second")
        for line in drawn:
            self.assertRegex(line, r"^ *\d+ %  publishing .*, \d+ s left$")
        shares = [int(line.split("%")[0]) for line in drawn]
        self.assertEqual(shares, sorted(shares))
        self.assertTrue(shown.endswith(ERASE_LINE), "the line was left behind")

    def test_a_pipe_receives_nothing(self):
        result = run(STICKSLIP, "replay", self.recording)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertNotIn("\033", result.stdout)

    def test_a_dumb_terminal_receives_nothing(self):
        replays = {term: on_a_terminal(STICKSLIP, "replay", self.recording, piped=True,
                                       env=environment(TERM=term)) for term in ("dumb", None)}
        for term, replay in replays.items():
            with self.subTest(TERM=term):
                self.assertEqual(replay.end(), "")

    def test_no_color_does_not_affect_progress(self):
        shown = on_a_terminal(STICKSLIP, "replay", self.recording, piped=True,
                              env=environment(NO_COLOR="1")).end()
        self.assertIn("left", shown)
        self.assertNotRegex(shown, r"\033\[[0-9;]*m")

    def test_the_line_fits_a_narrow_terminal(self):
        replays = {columns: on_a_terminal(STICKSLIP, "replay", self.recording, piped=True, columns=columns)
                   for columns in (24, 8, 3)}
        for columns, replay in replays.items():
            with self.subTest(columns=columns):
                shown = replay.end()
                self.assertNotIn("\n", shown)
                for line in shown.split(ERASE_LINE):
                    self.assertLess(len(line), columns, shown)

    def test_the_result_is_on_an_empty_line(self):
        shown = on_a_terminal(STICKSLIP, "replay", self.recording).end()
        self.assertRegex(shown.split(ERASE_LINE)[-1], r"^published 200 of 200 frames")

    def test_the_elapsed_time_is_shown_if_the_total_is_unknown(self):
        recorder = on_a_terminal(STICKSLIP, "record", self.folder / "out.log", piped=True)
        recorder.wait_for(r"recording, 0 frames, lost 0, \d+ s")
        recorder.process.send_signal(signal.SIGTERM)
        shown = recorder.end()
        self.assertNotIn("left", shown)
        self.assertRegex(shown, r"\r\033\[Kstickslip: no frames arrived")


class Colours(EndToEnd):
    def setUp(self):
        super().setUp()
        self.log = self.folder / "run.log"
        self.succeed("convert", self.write("run.csv", CSV), self.log)

    def shown(self, *options, **changes):
        return on_a_terminal(STICKSLIP, "log", "check", self.log, *options,
                             env=environment(**changes)).end()

    def test_a_terminal_has_colours(self):
        self.assertIn("\033[32mintact\033[0m", self.shown())

    def test_no_color_and_dumb_terminals_have_none(self):
        self.assertIn(": intact", self.shown(NO_COLOR="1"))
        self.assertIn("\033[32m", self.shown(NO_COLOR=""), "an empty NO_COLOR is ignored")
        self.assertIn(": intact", self.shown(TERM="dumb"))
        self.assertIn(": intact", self.shown("--color=never"))

    def test_a_pipe_has_them_on_request(self):
        self.assertNotIn("\033", self.succeed("log", "check", self.log).stdout)
        self.assertIn("\033[32m", self.succeed("log", "check", self.log, "--color=always").stdout)
        self.assertIn("\033[32m", self.shown("--color", "always", NO_COLOR="1"))

    def test_damage_is_red(self):
        self.log.write_bytes(self.log.read_bytes()[:-10])
        self.assertIn("\033[1;31mdamaged\033[0m", self.shown())

    def test_commands_with_colours_have_the_option(self):
        for command in (("spy",), ("doctor",), ("check",), ("ctl",), ("log", "check")):
            with self.subTest(command=command):
                self.assertIn("--color", self.succeed(*command, "--help").stdout)


MODEL = """schema = 1
[oscillator]
excitation = "force"
mass_kg = { value = 1.0, sigma = 0.02 }
stiffness_n_m = { value = 158.0, sigma = 5.0 }
damping_n_s_m = { value = 0.5, sigma = 0.2 }
"""


class Pages(EndToEnd):
    """Every page of text fits 60 columns."""

    def setUp(self):
        super().setUp()
        self.log = self.folder / "run.log"
        self.succeed("convert", self.write("run.csv", CSV), self.log)

    def page(self, *command, status=(0,)):
        result = run(STICKSLIP, *command, env=environment(COLUMNS="60"))
        self.assertIn(result.returncode, status, result.stdout + result.stderr)
        return self.expect_to_fit(result.stdout, command)

    def test_a_terminal_of_60_columns(self):
        for command in (("log", "info", self.log), ("log", "check", self.log)):
            shown = on_a_terminal(STICKSLIP, *command, columns=60).end()
            self.assertIn("200", self.expect_to_fit(shown, command))

    def test_help(self):
        commands = [line.split()[0] for line in
                    self.succeed("--help").stdout.split("Subcommands:\n")[1].splitlines()
                    if line.startswith("  ") and line[2] != " "]
        self.assertGreater(len(commands), 20)
        for command in [()] + [(each,) for each in commands] + [("log", "export"), ("ctl", "set")]:
            self.assertIn("--help", self.page(*command, "--help"))

    def test_pages_of_files_and_the_machine(self):
        rig = SOURCE / "config/bench-u6.toml"
        self.page("check", rig, SOURCE / "config/models/beam-1.toml")
        self.page("doctor", "--config", rig, "--duration", "0.1", status=(0, 1))
        self.page("devices", status=(0, 1))
        self.page("config", rig)
        self.page("config", rig, "--explain")
        listed = self.page("effects")
        for name in re.findall(r"(?m)^(\w+)  ", listed):
            self.page("effects", name)
        self.page("calibration", "show", SOURCE / "config/calibrations/beam.toml", "--history")
        self.page("log", "export", self.log, self.folder / "run.mat")

    def test_pages_of_computations(self):
        drive = self.write("drive.csv", "time_s,drive_force_n,displacement_m\n" + "".join(
            f"{i / 100:.2f},{math.sin(0.09 * i) + math.sin(0.13 * i)},0\n" for i in range(800)))
        model = self.write("model.toml", MODEL)
        recording = self.folder / "simulated.csv"
        self.page("simulate", "--model", model, "--drive", drive, "--out", recording)
        self.page("evaluate", recording, "--model", model)
        self.page("diagnose", recording, "--model", model)
        self.page("poincare", "--model", model, "--frequency-hz", "2", "--amplitude", "1",
                  "--periods", "3", "--out", self.folder / "section.csv")
        self.page("lyapunov", "--model", model, "--frequency-hz", "2", "--amplitude", "1",
                  "--periods", "20")
        self.page("estimate", recording, "--model", model, "--out", self.folder / "estimate.csv")
        self.page("bifurcation", "--model", model, "--amplitude", "1", "--over", "drive.frequency_hz",
                  "--from", "1", "--to", "2", "--values", "3", "--transient", "1", "--periods", "2",
                  "--out", self.folder / "diagram.csv")


class Spy(EndToEnd):
    def setUp(self):
        super().setUp()
        self.recording = self.write("run.csv", CSV)

    def publish(self, channel, payload):
        """One message of another program, as a short packet of LCM's UDP protocol."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            udp.sendto(struct.pack(">II", 0x4C433032, 1) + channel.encode() + b"\0" + payload, GROUP)

    def replay(self):
        player = subprocess.Popen([STICKSLIP, "replay", self.recording, "--speed", "0.3"],
                                  stdout=subprocess.DEVNULL)
        self.addCleanup(player.wait)
        self.addCleanup(player.kill)

    def output(self, *options):
        """Output of `spy` in a pipe while a replay and another program publish."""
        spy = subprocess.Popen([STICKSLIP, "spy", "--duration", "5", *options],
                               stdout=subprocess.PIPE, text=True)
        self.addCleanup(spy.kill)
        spy.stdout.readline()  # it has subscribed
        self.replay()
        while spy.poll() is None:
            self.publish("FOREIGN", bytes(range(1, 21)))
            time.sleep(0.05)
        return spy.communicate()[0]

    def test_json_has_the_statistics(self):
        reports = [json.loads(line) for line in self.output("--json").splitlines()]
        self.assertGreaterEqual(len(reports), 2)
        channels = {each["channel"]: each for each in reports[-1]["channels"]}
        frames = channels["STICKSLIP_FRAMES"]
        self.assertEqual(frames["type"], "frame_block_t")
        self.assertEqual((frames["frames"]["lost"], frames["not_decoded"]), (0, 0))
        self.assertGreater(frames["frames"]["count"], 10)
        force = frames["values"]["friction_force"]
        self.assertEqual((force["unit"], force["least"], force["greatest"]), ("N", 0.0, 0.2))
        foreign = channels["FOREIGN"]
        self.assertEqual((foreign["type"], foreign["fingerprint"], foreign["last_bytes"]),
                         (None, "0x0102030405060708", 20))

    def test_selection_and_order(self):
        output = self.output("forei", "--values")
        self.assertIn("unknown type 0x0102030405060708", output)
        self.assertNotIn("STICKSLIP_FRAMES", output)
        report = json.loads(self.output("--sort", "size", "--json").splitlines()[-1])
        sizes = [channel["last_bytes"] for channel in report["channels"]]
        self.assertEqual(len(sizes), 3)
        self.assertEqual(sizes, sorted(sizes, reverse=True))

    def test_messages_that_cannot_be_decoded_are_counted(self):
        spy = subprocess.Popen([STICKSLIP, "spy", "--duration", "2.5", "--json"],
                               stdout=subprocess.PIPE, text=True)
        self.addCleanup(spy.kill)
        while spy.poll() is None:
            self.publish("STICKSLIP_STATUS", b"no status")
            time.sleep(0.05)
        channel = json.loads(spy.communicate()[0].splitlines()[-1])["channels"][0]
        self.assertGreater(channel["not_decoded"], 0)
        self.assertEqual(channel["not_decoded"], channel["messages"])

    def test_a_terminal_shows_a_table_that_is_redrawn_in_place(self):
        for colours in (True, False):
            with self.subTest(colours=colours):
                spy = on_a_terminal(STICKSLIP, "spy", "--values", columns=100, lines=40,
                                    env=environment(NO_COLOR=None if colours else "1"))
                self.replay()
                spy.wait_for(r"STICKSLIP_FRAMES +\d+ +\d+\.\d")
                spy.wait_for(r"displacement +[-\d.e]+ m +from")
                spy.process.send_signal(signal.SIGINT)
                shown = spy.end()
                self.assertEqual(spy.process.returncode, 0)
                self.assertIn("\033[H", shown)
                self.assertNotIn("\033[2J", shown)  # it would flicker
                painted = re.search(r"\033\[[0-9;]*m", shown) is not None
                self.assertEqual(painted, colours, shown)
                for line in re.sub(r"\033\[[0-9;]*[A-Za-z]", "", shown).split("\r\n"):
                    self.assertLessEqual(len(line), 100, line)

    def test_a_low_terminal_does_not_scroll(self):
        spy = on_a_terminal(STICKSLIP, "spy", "--values", lines=8)
        self.replay()
        spy.wait_for("name a channel to see no others")
        spy.process.send_signal(signal.SIGINT)
        for screen in spy.end().split("\033[H")[1:]:
            self.assertLess(screen.count("\r\n"), 8, screen)


if __name__ == "__main__":
    main()
