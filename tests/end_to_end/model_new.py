# SPDX-License-Identifier: Apache-2.0
"""`stickslip model new`: on a terminal it asks, elsewhere its options answer; what was edited is kept."""
import os

from programs import STICKSLIP, EndToEnd, main, stickslip
from pseudo_terminal import OnATerminal

CSV = "time_s,displacement_m,drive_force_n\n" + "".join(
    f"{i / 100:.2f},{1e-3 * (i % 7)!r},{0.1 * (i % 3)!r}\n" for i in range(200))
ANSWERS = ("--excitation", "force", "--mass", "95 kg +- 5", "--spring", "none", "--damping", "300 N s/m",
           "--load", "none", "--friction", "none")


class Dialogue(OnATerminal):
    """`stickslip ...` at a terminal of its own, with a person who answers."""

    def __init__(self, *arguments, cwd):
        super().__init__(STICKSLIP, *arguments, typing=True, cwd=cwd,
                         env={**os.environ, "COLUMNS": "60", "TERM": "dumb"})
        self.answered = 0

    def answer(self, line):
        """Types the line at the next prompt."""
        self.answered += 1
        self.wait_for(rf"(?s)(?:(?:^|\n)> .*?){{{self.answered}}}")
        self.type(line + "\n")

    def status(self):
        self.end()
        return self.process.returncode


class ModelNew(EndToEnd):
    def setUp(self):
        super().setUp()
        self.recording = self.write("data.csv", CSV)
        self.model = self.folder / "my-rig.toml"

    def new(self, *arguments):
        return stickslip("model", "new", *arguments, cwd=self.folder)

    def test_a_terminal_asks_and_explains(self):
        dialogue = Dialogue("model", "new", "--recording", "data.csv", cwd=self.folder)
        for line in ("", "heavy", "95 kg", "none", "300 N s/m", "", "", "displacement 1e-5, drive_force"):
            dialogue.answer(line)
        self.assertEqual(dialogue.status(), 0, dialogue.shown)
        shown = self.expect_to_fit(dialogue.shown)
        for text in ("1/8 Excitation", "Enter: force", 'found "heavy"', "6/8 Friction",
                     "$ stickslip diagnose data.csv --model my-rig.toml"):
            self.assertIn(text, " ".join(shown.split()))
        self.succeed("check", self.model)
        text = self.model.read_text()
        for line in ('excitation = "force"', "mass_kg = { value = 95.0, sigma = 0.95 }", "stiffness_n_m = 0.0",
                     "damping_n_s_m = { value = 300.0, sigma = 150.0 }", "noise_std = 1e-05  # m",
                     "# noise_std = ...  # N; unknown: estimated"):
            self.assertIn(f"\n{line}\n", text)

    def test_the_end_of_the_input_writes_nothing(self):
        dialogue = Dialogue("model", "new", cwd=self.folder)
        dialogue.answer("base")
        dialogue.answer("\x04")
        self.assertEqual(dialogue.status(), 2, dialogue.shown)
        self.assertIn("nothing is written", dialogue.shown)
        self.assertFalse(self.model.exists())

    def test_without_a_terminal_a_missing_answer_is_named(self):
        result = self.new("--recording", "data.csv", *ANSWERS[:2])
        self.assertEqual(result.returncode, 2)
        for option in ANSWERS[2::2]:
            self.assertIn(option, result.stderr)
        self.assertNotIn("--sensors", result.stderr, "the recording has them")
        self.assertEqual(len(result.stderr.splitlines()), 1)
        self.assertFalse(self.model.exists())

    def test_the_model_is_accepted_by_the_other_commands(self):
        self.assertEqual(self.new("--recording", "data.csv", *ANSWERS).returncode, 0)
        self.succeed("check", self.model)
        self.succeed("evaluate", "data.csv", "--model", self.model, cwd=self.folder)
        self.succeed("estimate", "data.csv", "--model", self.model, cwd=self.folder)

    def test_a_recording_of_another_program_has_its_units(self):
        self.write("mm.csv", CSV.replace("displacement_m", "displacement"))
        result = self.new("--recording", "mm.csv", "--unit", "displacement=mm", *ANSWERS)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("[sensors.displacement]", self.model.read_text())

    def test_an_edited_model_is_never_replaced_unasked(self):
        arguments = ("--recording", "data.csv", *ANSWERS)
        self.assertEqual(self.new(*arguments).returncode, 0)
        self.assertEqual(self.new(*arguments).returncode, 0, "its own file, unchanged")
        edited = self.model.read_text().replace("95.0", "96.0")
        for save in (self.model.write_text,  # in place, and as editors do
                     lambda text: (self.write("new", text), os.replace(self.folder / "new", self.model))):
            save(edited)
            result = self.new(*arguments)
            self.assertEqual(result.returncode, 2)
            self.assertIn("--force to replace it", result.stderr)
            self.assertEqual(self.model.read_text(), edited)
        self.assertEqual(self.new(*arguments, "--force").returncode, 0)
        self.assertIn("95.0", self.model.read_text())
        self.assertEqual(self.new(*arguments, "--out", "data.csv", "--force").returncode, 2)
        self.assertEqual(self.recording.read_text(), CSV)

    def test_an_existing_file_is_refused_before_the_first_question(self):
        self.model.write_text("by hand")
        dialogue = Dialogue("model", "new", cwd=self.folder)
        self.assertEqual(dialogue.status(), 2, dialogue.shown)
        self.assertNotIn("1/8", dialogue.shown)

    def test_standard_output_is_the_model_alone(self):
        result = self.new("--recording", "data.csv", *ANSWERS, "--out", "-")
        self.assertEqual(result.returncode, 0, result.stderr)
        piped = self.write("piped.toml", result.stdout)
        self.succeed("check", piped)


if __name__ == "__main__":
    main()
