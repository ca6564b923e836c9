"""Whatever is wrong with an input, every command that reads it says so in one line that names the
file and the line (a binary log: the byte), and ends with status 2."""
import re
import unittest

from programs import STICKSLIPD, EndToEnd, main, run, stickslip

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

# What is spoilt: (text that is replaced, what stands there instead, line that must be named,
# a word that the message must hold).
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

    def spoilt(self, name, text, old, new):
        self.assertEqual(text.count(old), 1, f"the case does not fit its text: {old!r}")
        return self.write(name, text.replace(old, new))

    def expect_refusal(self, result, file, line, word):
        """One line on standard error, file and line in it, status 2."""
        said = f"{result.args}\n{result.stdout}{result.stderr}"
        self.assertEqual(result.returncode, 2, said)
        lines = result.stderr.splitlines()
        self.assertEqual(len(lines), 1, said)
        place = re.escape(str(file)) + (r":\d+\b" if line is None else f":{line}" + r"\b")
        self.assertRegex(lines[0], place)
        self.assertIn(word, lines[0])

    def readers_of_a_recording(self, recording):
        return [
            ("diagnose", recording, "--model", self.good_model),
            ("evaluate", recording, "--model", self.good_model),
            ("simulate", "--model", self.good_model, "--drive", recording,
             "--out", self.folder / "out.csv"),
            ("convert", recording, self.folder / "out.log"),
        ]

    def readers_of_a_model(self, model):
        return [
            ("diagnose", self.good_recording, "--model", model),
            ("evaluate", self.good_recording, "--model", model),
            ("simulate", "--model", model, "--drive", self.good_recording,
             "--out", self.folder / "out.csv"),
        ]

    def test_the_good_inputs_are_accepted(self):
        """Otherwise the refusals below would prove nothing."""
        self.succeed("check", self.good_model)
        self.succeed("convert", self.good_recording, self.folder / "good.log")
        self.succeed(*self.readers_of_a_model(self.good_model)[2])
        self.succeed("evaluate", self.good_recording, "--model", self.good_model)

    def test_recordings(self):
        for name, (old, new, line, word) in BAD_RECORDINGS.items():
            recording = self.spoilt(f"{name}.csv", RECORDING, old, new)
            for command in self.readers_of_a_recording(recording):
                with self.subTest(case=name, command=command[0]):
                    self.expect_refusal(stickslip(*command), recording, line, word)

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

    def test_truncated_and_spoilt_logs(self):
        log = self.folder / "good.log"
        self.succeed("convert", self.good_recording, log)
        whole = log.read_bytes()
        self.assertGreater(len(whole), 1000)
        second = whole.index(b"\xed\xa1\xda\x01", 1)  # where the second event begins
        spoilt = {
            "truncated_in_a_message.log": whole[:len(whole) * 2 // 3],
            "truncated_by_one_byte.log": whole[:-1],
            "truncated_in_the_first_header.log": whole[:17],
            "overwritten.log": whole[:second] + b"\0" * 28 + whole[second + 28:],
            "trailing_rubbish.log": whole + b"rubbish, and no event",
        }
        for name, content in spoilt.items():
            recording = self.write(name, content)
            for command in self.readers_of_a_recording(recording):
                with self.subTest(case=name, command=command[0]):
                    result = stickslip(*command)
                    self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                    self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                    self.assertIn(str(recording), result.stderr)
                    self.assertRegex(result.stderr, r"byte|offset")

    def test_models(self):
        for name, (old, new, line, word) in BAD_MODELS.items():
            model = self.spoilt(f"{name}.toml", MODEL, old, new)
            for command in self.readers_of_a_model(model):
                with self.subTest(case=name, command=command[0]):
                    self.expect_refusal(stickslip(*command), model, line, word)
            with self.subTest(case=name, command="check"):
                result = stickslip("check", model)
                said = result.stdout + result.stderr
                self.assertEqual(result.returncode, 2, said)
                number = r"\d+" if line is None else str(line)
                self.assertRegex(said, re.escape(str(model)) + f":{number}:" + r"\d+: ")
                self.assertIn(word, said)

    def test_check_tells_all_problems_at_once(self):
        model = MODEL
        for old, new in (("damping_ratio", "damping_ratoi"), ("sigma = 0.0006", "sigma = -1.0"),
                         ('"coulomb"', '"viscous"')):
            model = model.replace(old, new)
        file = self.write("three.toml", model)
        result = stickslip("check", file)
        said = result.stdout + result.stderr
        self.assertEqual(result.returncode, 2, said)
        for line in (5, 7, 14):
            self.assertRegex(said, re.escape(str(file)) + f":{line}:" + r"\d+: ")

    def test_bad_arguments(self):
        for command in (("diagnose",), ("diagnose", self.good_recording),
                        ("evaluate", self.good_recording, "--model"), ("no-such-command",), (),
                        ("simulate", "--model", self.good_model, "--drive", self.good_recording,
                         "--seed", "many")):
            with self.subTest(command=command):
                result = stickslip(*command)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
                self.assertTrue(result.stderr.strip())

    def test_the_daemon_refuses_a_bad_configuration(self):
        rig = self.write("rig.toml", "schema = 1\n[rig]\nname = \"x\"\nspeling = 1\n")
        for command in ((STICKSLIPD, "--config", rig), (STICKSLIPD, "--config", self.folder / "no"),
                        (STICKSLIPD,), (STICKSLIPD, "--no-such-option")):
            with self.subTest(command=command):
                result = run(*command, timeout=20)
                self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        result = run(STICKSLIPD, "--config", rig, timeout=20)
        self.assertRegex(result.stderr, re.escape(str(rig)) + r":\d+:\d+: ")


if __name__ == "__main__":
    main()
