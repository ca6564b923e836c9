# SPDX-License-Identifier: Apache-2.0
"""Every command refuses a malformed input with one line that contains the file and the line (of a
binary log: the byte), and with status 2."""
import re
import subprocess
import unittest

from programs import PATIENCE_S, SOURCE, STICKSLIP, STICKSLIPD, EndToEnd, main, run, stickslip

MODEL = """schema = 1

[oscillator]
excitation = "base"
mass_kg = { value = 0.060, sigma = 0.0006 }
natural_frequency_hz = { value = 2.40, sigma = 0.05 }
damping_ratio = 0.015

[normal_load]
law = "constant"
load_n = 0.15

[friction]
law = "coulomb"
mu = { value = 0.8, sigma = 0.1 }
transition_speed_m_s = 0.0025
"""

RECORDING = "time_s,displacement_m,base_displacement_m\n" + "".join(
    f"{i / 1000},{1e-3 * (i % 7)},{2e-3 * (i % 5)}\n" for i in range(400))

# Errors: (replaced text, its replacement, line in the message, a word of the message).
BAD_RECORDINGS = {
    "no_time_column": ("time_s,", "t,", 1, "time_s"),
    "no_known_column": ("displacement_m,base_displacement_m", "a,b", 1, ""),
    "unknown_column": ("base_displacement_m", "base_displacement_mm", 1, "base_displacement_mm"),
    "column_twice": ("base_displacement_m", "displacement_m", 1, "displacement_m"),
    "missing_cell": ("\n0.1,0.002,0.0\n", "\n0.1,0.002\n", 102, ""),
    "one_cell_too_many": ("\n0.1,0.002,0.0\n", "\n0.1,0.002,0.0,7\n", 102, ""),
    "not_a_number": ("\n0.1,0.002,", "\n0.1,nan,", 102, "nan"),
    "infinite": ("\n0.1,0.002,", "\n0.1,inf,", 102, "inf"),
    "text_in_a_number": ("\n0.1,0.002,", "\n0.1,2mm,", 102, "2mm"),
    "time_goes_back": ("\n0.1,", "\n0.05,", 102, "0.05"),
    "time_stands_still": ("\n0.1,", "\n0.099,", 102, "0.099"),
}
BAD_MODELS = {
    "malformed_toml": ('law = "constant"', "law = = constant", 10, ""),
    "unterminated_text": ('excitation = "base"', 'excitation = "base', 4, ""),
    "unknown_key": ("damping_ratio = 0.015", "damping_ratoi = 0.015", 7, "damping_ratoi"),
    "unknown_table": ("[normal_load]", "[normal_laod]", 9, "normal_laod"),
    "no_schema": ("schema = 1\n", "\n", None, "schema"),
    "negative_sigma": ("sigma = 0.0006", "sigma = -0.0006", 5, "sigma"),
    "text_for_a_number": ("load_n = 0.15", 'load_n = "heavy"', 11, "load_n"),
    "nan_parameter": ("load_n = 0.15", "load_n = nan", 11, "load_n"),
    "unknown_law": ('law = "coulomb"', 'law = "viscous"', 14, "viscous"),
    "law_that_its_parameters_do_not_fit": ("transition_speed_m_s = 0.0025",
                                           "transition_speed_m_s = 0.0025\nrate_per_s = 10.0", 17,
                                           "rate_per_s"),
    "law_without_its_parameter": ('law = "constant"', 'law = "wedge"', None, "slope_per_m"),
    "imposed_motion_with_a_mass": ('excitation = "base"', 'excitation = "imposed"', None, ""),
    "unknown_effect": ("[friction]", '[[physics]]\nid = "gremlins"\n\n[friction]', None, "gremlins"),
    "effect_without_its_parameter": ("[friction]",
                                     '[[physics]]\nid = "cubic_stiffness"\n\n[friction]', None,
                                     "k3_n_m3"),
}


class MalformedInput(EndToEnd):
    def setUp(self):
        super().setUp()
        self.good_model = self.write("good.toml", MODEL)
        self.good_recording = self.write("good.csv", RECORDING)

    def altered(self, name, text, old, new):
        self.assertEqual(text.count(old), 1, f"the case does not fit its text: {old!r}")
        return self.write(name, text.replace(old, new))

    def expect_refusal(self, result, file, line, word):
        """One line with file and line on standard error, status 2."""
        output = f"{result.args}\n{result.stdout}{result.stderr}"
        self.assertEqual(result.returncode, 2, output)
        lines = result.stderr.splitlines()
        self.assertEqual(len(lines), 1, output)
        place = re.escape(str(file)) + (r":\d+\b" if line is None else f":{line}" + r"\b")
        self.assertRegex(lines[0], place)
        self.assertIn(word, lines[0])

    def readers_of_a_recording(self, recording):
        return [
            ("diagnose", recording, "--model", self.good_model),
            ("evaluate", recording, "--model", self.good_model),
            ("estimate", recording, "--model", self.good_model),
            ("simulate", "--model", self.good_model, "--drive", recording,
             "--out", self.folder / "out.csv"),
            ("convert", recording, self.folder / "out.log"),
        ]

    def readers_of_a_model(self, model):
        return [
            ("diagnose", self.good_recording, "--model", model),
            ("evaluate", self.good_recording, "--model", model),
            ("estimate", self.good_recording, "--model", model),
            ("simulate", "--model", model, "--drive", self.good_recording,
             "--out", self.folder / "out.csv"),
        ]

    def test_the_good_inputs_are_accepted(self):
        """Precondition of the refusals below."""
        self.succeed("check", self.good_model)
        self.succeed("convert", self.good_recording, self.folder / "good.log")
        self.succeed(*self.readers_of_a_model(self.good_model)[3])
        self.succeed("evaluate", self.good_recording, "--model", self.good_model)

    def test_recordings(self):
        for name, (old, new, line, word) in BAD_RECORDINGS.items():
            recording = self.altered(f"{name}.csv", RECORDING, old, new)
            for command in self.readers_of_a_recording(recording):
                with self.subTest(case=name, command=command[0]):
                    self.expect_refusal(stickslip(*command), recording, line, word)

    def test_files_of_other_programs(self):
        rows = "".join(f"{i};{i % 7},0;ok;{i % 5 * 2}\n" for i in range(400))
        foreign = self.write("foreign.csv", '"Zeit [ms]";Kanal 1;Status;base_displacement_mm\n' + rows)
        columns = self.write("columns.toml", '"Kanal 1" = { channel = "displacement", unit = "mm" }\n')
        out, expected = self.folder / "imported.csv", self.folder / "expected.csv"
        result = stickslip("convert", "--import", foreign, out, "--map", columns)
        self.assertEqual(result.returncode, 0, result.stderr)
        for guess in ("semicolons", "comma", 'displacement_m is column "Kanal 1"', 'ignored: "Status"'):
            self.assertIn(guess, result.stderr)
        self.succeed("convert", self.good_recording, expected)
        self.assertEqual(out.read_text(), expected.read_text())
        for command in (("convert", "--import", foreign, out, "--force"),
                        ("diagnose", foreign, "--model", self.good_model)):
            self.assertEqual(stickslip(*command).returncode, 0 if command[0] == "convert" else 2)
        unknown = self.write("unknown.csv", "Zeit;x [mm]\n1;2\n")
        self.expect_refusal(stickslip("convert", "--import", unknown, out, "--force"), unknown, 1, "no unit")

    def test_a_channel_that_measures_nothing(self):
        lines = RECORDING.splitlines()
        dead = self.write("dead.csv", "".join(
            line + (",normal_load_n" if i == 0 else ",0") + "\n" for i, line in enumerate(lines)))
        result = stickslip("diagnose", dead, "--model", self.good_model)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn(f"{dead}: normal_load_n is 0 N on average", result.stderr)

    def test_empty_and_absent_recordings(self):
        for name, text in (("empty.csv", ""), ("header_only.csv", RECORDING.split("\n")[0] + "\n"),
                           ("comments_only.csv", "# nothing\n"), ("absent.csv", None)):
            recording = self.folder / name if text is None else self.write(name, text)
            for command in self.readers_of_a_recording(recording):
                with self.subTest(case=name, command=command[0]):
                    result = stickslip(*command)
                    self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                    self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                    self.assertIn(str(recording), result.stderr)

    def test_damaged_logs(self):
        log = self.folder / "good.log"
        self.succeed("convert", self.good_recording, log)
        whole = log.read_bytes()
        self.assertGreater(len(whole), 1000)
        second = whole.index(b"\xed\xa1\xda\x01", 1)  # beginning of the second event
        damaged = {
            "truncated_in_the_first_header.log": whole[:17],
            "truncated_within_the_description.log": whole[:second - 1],
            "overwritten.log": whole[:second] + b"\0" * 28 + whole[second + 28:],
            "trailing_rubbish.log": whole + b"rubbish, not an event",
        }
        for name, content in damaged.items():
            recording = self.write(name, content)
            for command in self.readers_of_a_recording(recording):
                with self.subTest(case=name, command=command[0]):
                    result = stickslip(*command)
                    self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                    self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                    self.assertIn(str(recording), result.stderr)
                    self.assertRegex(result.stderr, r"byte|has no frames")
                    if name.startswith("overwritten"):
                        self.assertIn("stickslip log repair", result.stderr)

    def test_a_csv_file_cut_within_a_number_is_read_up_to_there_with_a_warning(self):
        cut = self.write("cut.csv", RECORDING[:-2])
        for command in (("convert", cut, self.folder / "out.log"), ("log", "export", cut, self.folder / "x.csv"),
                        ("evaluate", cut, "--model", self.good_model)):
            with self.subTest(command=command[0]):
                result = self.succeed(*command)
                self.assertIn(f"{cut}:401: the last line is not read", result.stderr)
        self.assertIn("399 frames", self.succeed("convert", cut, self.folder / "out.log").stdout)

    def test_a_case_of_an_examination_that_is_cut_is_named(self):
        case = self.folder / "set/01"
        case.mkdir(parents=True)
        cut = self.write("set/01/recording.csv", RECORDING[:-2])
        self.write("set/01/model.toml", MODEL)
        result = stickslip("examine", self.folder / "set", "--reports", self.folder / "reports")
        self.assertIn(f"{cut}:401: the last line is not read", result.stderr)

    def test_a_drive_that_is_cut_is_named_before_it_is_played(self):
        drive = "time_s,base_displacement_m\n" + "".join(
            f"{i / 100},{1e-3 * abs(i - 50) / 50:.6f}\n" for i in range(102))
        cut = self.write("drive.csv", drive[:-3])
        config = self.write("rig.toml", f"""schema = 1
            [rig]
            name = "cut"
            model = "{SOURCE}/config/models/simulated.toml"
            [driver]
            kind = "simulated"
            [driver.simulated]
            real_time = false
            [excitation]
            kind = "file"
            file.path = "{cut}"
            """)
        result = run(STICKSLIPD, "--config", config, "--no-lcm", "--duration", 0.1)
        output = result.stdout + result.stderr
        self.assertEqual(result.returncode, 0, output)
        self.assertIn(f"{cut}:103: the last line is not read", output)

    def test_a_truncated_log_is_read_up_to_there_with_a_warning(self):
        log = self.folder / "good.log"
        self.succeed("convert", self.good_recording, log)
        whole = log.read_bytes()
        for name, content in (("in_a_message.log", whole[:len(whole) * 2 // 3]),
                              ("by_one_byte.log", whole[:-1])):
            recording = self.write(name, content)
            for command in self.readers_of_a_recording(recording):
                with self.subTest(case=name, command=command[0]):
                    result = stickslip(*command)
                    self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
                    self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                    self.assertRegex(result.stderr, re.escape(str(recording)) +
                                     r": truncated: its last \d+ bytes are an incomplete event")

    def test_models(self):
        for name, (old, new, line, word) in BAD_MODELS.items():
            model = self.altered(f"{name}.toml", MODEL, old, new)
            for command in self.readers_of_a_model(model):
                with self.subTest(case=name, command=command[0]):
                    self.expect_refusal(stickslip(*command), model, line, word)
            with self.subTest(case=name, command="check"):
                result = stickslip("check", model)
                output = result.stdout + result.stderr
                self.assertEqual(result.returncode, 2, output)
                number = r"\d+" if line is None else str(line)
                self.assertRegex(output, re.escape(str(model)) + f":{number}:" + r"\d+: ")
                self.assertIn(word, output)

    def test_check_reports_all_problems(self):
        model = MODEL
        for old, new in (("damping_ratio", "damping_ratoi"), ("sigma = 0.0006", "sigma = -1.0"),
                         ('"coulomb"', '"viscous"')):
            model = model.replace(old, new)
        file = self.write("three.toml", model)
        result = stickslip("check", file)
        output = result.stdout + result.stderr
        self.assertEqual(result.returncode, 2, output)
        for line in (5, 7, 14):
            self.assertRegex(output, re.escape(str(file)) + f":{line}:" + r"\d+: ")

    def test_bad_arguments(self):
        """One line with the option (or the command), its value, and the expectation."""
        section = ("poincare", "--model", self.good_model, "--amplitude", "0.003")
        diagram = ("bifurcation", "--model", self.good_model, "--values", "2", "--periods", "2")
        cases = (
            (("diagnose",), "RECORDING is required"),
            (("diagnose", self.good_recording),
             f"--model is required, a file with the physics known of the rig: `stickslip model new --recording "
             f"{self.good_recording}` asks for it and writes one; docs/tutorial.md"),
            (("poincare", "--amplitude", "0.003"), "`stickslip model new` asks for it"),
            (("model",), 'after "stickslip model"; expected one of new'),
            (("model", "new", "--excitation", "force"), "missing: --mass (60 g"),
            (("model", "new", "--excitation", "push"), "expected one of base,force,imposed, found push"),
            (("model", "new", "--excitation", "base", "--mass", "0"), "--mass: expected a number above 0, found"),
            (("evaluate", self.good_recording, "--model"), "--model"),
            (("no-such-command",), 'there is no command "no-such-command"; expected one of'),
            ((), "no command is given; expected one of"),
            (("diagnos",), "did you mean `stickslip diagnose`?"),
            (("log", "chekc", "run.log"), "did you mean `stickslip log check`?"),
            (("diagnose", "run.log", "--modle", "m.toml"), "did you mean --model?"),
            (("ctl", "frobnicate"), "expected one of status, clear, arm"),
            (("simulate", "--model", self.good_model, "--drive", self.good_recording,
              "--seed", "many"), "--seed"),
            (("simulate", "--model", self.good_model, "--drive", self.good_recording,
              "--seed", "-1"), "found -1"),
            ((*section, "--frequency-hz", "nan"), "--frequency-hz: expected a finite number above 0, "
                                                  "found nan"),
            ((*section, "--frequency-hz", "1e-9"), "expected at most"),
            ((*section, "--frequency-hz", "3", "--omega", "2"), "both are given"),
            (section, "expected one of them: the drive's frequency"),
            ((*section, "--frequency-hz", "3", "--x", "inf"), "--x: expected a finite number"),
            ((*section, "--frequency-hz", "3", "--periods", "1.5"), "--periods"),
            ((*diagram, "--frequency-hz", "3", "--amplitude", "0.003", "--over", "friction.mu",
              "--from", "-1", "--to", "2"), "friction.mu = -1: must be 0 or more"),
            ((*diagram, "--amplitude", "0.003", "--over", "drive.frequency_hz",
              "--from", "0", "--to", "2"), "drive.frequency_hz = 0: must be above 0"),
            ((*diagram, "--frequency-hz", "3", "--over", "drive.speed",
              "--from", "0", "--to", "2"), "expected one of"),
            (("evaluate", self.good_recording, "--model", self.good_model, "--horizon", "0.001"),
             "expected at least"),
            (("evaluate", self.good_recording, "--model", self.good_model, "--horizon", "0"),
             "found 0"),
        )
        for command, word in cases:
            with self.subTest(command=[str(part) for part in command]):
                result = stickslip(*command)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                self.assertTrue(result.stderr.startswith("stickslip: "), result.stderr)
                self.assertIn(word, result.stderr)
                self.assertEqual(result.stdout, "")

    def test_a_swept_quantity_needs_no_option(self):
        for over, given in (("drive.amplitude_m", ("--frequency-hz", "3")),
                           ("drive.frequency_hz", ("--amplitude", "0.003"))):
            with self.subTest(over=over):
                result = self.succeed("bifurcation", "--model", self.good_model, *given, "--over",
                                      over, "--from", "0.5", "--to", "2", "--values", "2",
                                      "--periods", "2", "--transient", "1")
                self.assertEqual(len(result.stdout.splitlines()), 5)

    def test_a_failed_write_is_reported(self):
        """A full disk on standard output: status 1. An impossible path: status 2, before any work."""
        for command in (("poincare", "--model", self.good_model, "--amplitude", "0.003",
                         "--frequency-hz", "3", "--periods", "3"),
                        ("simulate", "--model", self.good_model, "--drive", self.good_recording),
                        ("evaluate", self.good_recording, "--model", self.good_model)):
            with self.subTest(command=command[0]), open("/dev/full", "wb") as full:
                result = subprocess.run([str(part) for part in (STICKSLIP, *command)], stdout=full,
                                        stderr=subprocess.PIPE, text=True, timeout=PATIENCE_S)
                self.assertEqual(result.returncode, 1, result.stderr)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
        for command in ("diagnose", "evaluate", "estimate"):
            nowhere = self.folder / "nowhere" / "out.json"
            result = stickslip(command, self.folder / "absent.csv", "--model", self.good_model,
                               "--json", nowhere)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(str(nowhere), result.stderr)

    def test_a_recording_without_motion_or_of_another_system_gets_no_verdict(self):
        still = "time_s,displacement_m,base_displacement_m\n" + "".join(
            f"{i / 1000},0,{2e-3 * (i % 5)}\n" for i in range(400))
        absurd = "time_s,displacement_m,base_displacement_m\n" + "".join(
            f"{i / 1000},{1e200 * (i % 7)},{2e-3 * (i % 5)}\n" for i in range(400))
        milliseconds = "time_s,displacement_m,base_displacement_m\n" + "".join(
            f"{i},{1e-3 * (i % 7)},{2e-3 * (i % 5)}\n" for i in range(400))
        for name, text, word in (("still.csv", still, "shows no motion"),
                                 ("absurd.csv", absurd, "displacement_m is 1e+200"),
                                 ("ms.csv", milliseconds, "time_s looks like milliseconds")):
            recording = self.write(name, text)
            for command in ("diagnose", "evaluate"):
                with self.subTest(case=name, command=command):
                    result = stickslip(command, recording, "--model", self.good_model)
                    self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                    self.assertIn(str(recording), result.stderr)
                    self.assertIn(word, result.stderr)

    def test_a_load_of_zero_is_answered_in_sentences(self):
        rows = RECORDING.strip().split("\n")
        recording = self.write("no_load.csv", "\n".join(
            [rows[0] + ",normal_load_n"] + [row + ",0" for row in rows[1:]]) + "\n")
        measured = self.altered("measured.toml", MODEL, 'law = "constant"\nload_n = 0.15',
                                'law = "measured"')
        for command in ("diagnose", "evaluate", "reduce"):
            with self.subTest(command=command):
                result = stickslip(command, recording, "--model", measured)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                self.assertIn(f"{recording}: ", result.stderr)
        self.assertIn("has no normal_load_n above 0", stickslip(
            "diagnose", recording, "--model", measured).stderr)

    def test_an_integration_that_would_not_end_is_refused(self):
        drive = ("--frequency-hz", "4.2", "--amplitude", "0.01")
        orbits = (("poincare", *drive), ("lyapunov", *drive),
                  ("bifurcation", *drive[:2], "--over", "drive.amplitude_m", "--from", "0.001", "--to", "0.002"))
        recordings = (("simulate", "--drive", self.good_recording),
                      ("evaluate", self.good_recording, "--free-run"), ("diagnose", self.good_recording))
        for key, value, commands in (("natural_frequency_hz", "1e8", orbits + recordings),
                                     ("natural_frequency_hz", "1e3", orbits[:2]),
                                     ("damping_ratio", "1e9", orbits + recordings)):
            model = self.write("fast.toml", re.sub(rf"{key} = .*", f"{key} = {value}", MODEL))
            for arguments in commands:
                with self.subTest(key=key, value=value, command=arguments[0]):
                    more = ("--periods", "20000") if value == "1e3" else ()
                    result = stickslip(*arguments, *more, "--model", model)
                    self.assertEqual(result.returncode, 2, result.stdout[:200] + result.stderr)
                    self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                    self.assertRegex(result.stderr, "integration steps|the shortest|nothing between two samples")
                    if arguments in orbits:
                        self.assertRegex(result.stderr, rf"{model}: .*oscillator\.{key} = .* rad/s")
        swept = stickslip("bifurcation", "--model", self.good_model, "--amplitude", "0.01", "--over",
                          "drive.frequency_hz", "--from", "1e-6", "--to", "1", timeout=PATIENCE_S)
        self.assertEqual(swept.returncode, 2, swept.stdout[:200] + swept.stderr)
        self.assertIn("for a drive period", swept.stderr)
        stiff = self.write("well.toml", re.sub(r"natural_frequency_hz = .*", "stiffness_n_m = 0.0\n", MODEL)
                           .replace("damping_ratio = 0.015", "damping_n_s_m = 0.0")
                           .replace("[normal_load]", "[oscillator.two_well]\nlinear_n_m = 1.0\ncubic_n_m3 = 1e18\n"
                                    "\n[normal_load]").replace("0.0025", "0.0"))
        result = stickslip("poincare", *drive, "--x", "0.1", "--model", stiff)
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        self.assertIn("integration steps by time", result.stderr)

    def test_check_reads_the_recording_of_a_replay(self):
        recording = self.altered("bad.csv", RECORDING, "\n0.1,0.002,", "\n0.1,nan,")
        rig = self.write("replay.toml", f"""schema = 1

[rig]
name = "replayed"
model = "{self.good_model}"

[driver]
kind = "replay"

[driver.replay]
recording = "{recording}"
""")
        result = stickslip("check", rig)
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        self.assertIn(f"{recording}:102", result.stderr)

    def test_the_daemon_refuses_a_bad_configuration(self):
        rig = self.write("rig.toml", "schema = 1\n[rig]\nname = \"x\"\nspeling = 1\n")
        for command in ((STICKSLIPD, "--config", rig), (STICKSLIPD, "--config", self.folder / "no"),
                        (STICKSLIPD,), (STICKSLIPD, "--no-such-option")):
            with self.subTest(command=command):
                result = run(*command)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        result = run(STICKSLIPD, "--config", rig)
        self.assertRegex(result.stderr, re.escape(str(rig)) + r":\d+:\d+: ")


if __name__ == "__main__":
    main()
