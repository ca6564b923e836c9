# SPDX-License-Identifier: Apache-2.0
"""Outputs of commands: never over a file that they read, never over a file that they did not write, whole or
not at all."""
import fcntl
import json
import os
import pathlib
import signal
import subprocess
import unittest

from malformed_input import MODEL, RECORDING
from programs import PATIENCE_S, STICKSLIP, EndToEnd, main, stickslip

WITHOUT_FORCE = "or --force to replace it"


class Outputs(EndToEnd):
    def setUp(self):
        super().setUp()
        self.model = self.write("model.toml", MODEL)
        self.recording = self.write("t.csv", RECORDING)
        self.log = self.folder / "run.log"
        self.succeed("convert", self.recording, self.folder / "made.log")
        self.write("run.log", (self.folder / "made.log").read_bytes())  # as if the daemon had written it
        (self.folder / "sub").mkdir()
        (self.folder / "sub/up").symlink_to(self.folder)
        os.link(self.recording, self.folder / "hard.csv")
        (self.folder / "soft.csv").symlink_to("t.csv")

    def files(self):
        return {path.name: path.read_bytes() for path in self.folder.iterdir() if path.is_file()}

    def refuse(self, *arguments, word="input"):
        before = self.files()
        result = stickslip(*arguments, cwd=self.folder)
        output = f"{result.args}\n{result.stdout}{result.stderr}"
        self.assertEqual(result.returncode, 2, output)
        self.assertEqual(len(result.stderr.splitlines()), 1, output)
        self.assertIn(word, result.stderr)
        self.assertEqual(self.files(), before, output)

    def writers(self, out):
        """Every command that writes a file, with this output and the inputs t.csv and model.toml."""
        model = ("--model", self.model)
        drive = (*model, "--frequency-hz", "3", "--amplitude", "0.003", "--transient", "1")
        return (("diagnose", "t.csv", *model, "--json", out),
                ("diagnose", "t.csv", *model, "--html", out),
                ("diagnose", "t.csv", *model, "--write-model", out),
                ("evaluate", "t.csv", *model, "--json", out),
                ("estimate", "t.csv", *model, "--out", out),
                ("estimate", "t.csv", *model, "--json", out),
                ("simulate", *model, "--drive", "t.csv", "--out", out),
                ("convert", "t.csv", out),
                ("log", "export", "t.csv", out),
                ("log", "repair", "t.csv", "--out", out),
                ("log", "join", "t.csv", "--out", out),
                ("calibration", "fit", "t.csv", "--channel", "displacement", "--reference", "blocks",
                 "--file", out),
                ("poincare", "--model", "t.csv", *drive[2:], "--out", out),
                ("bifurcation", "--model", "t.csv", "--frequency-hz", "3", "--over",
                 "drive.amplitude_m", "--from", "0.1", "--to", "0.2", "--out", out),
                ("lyapunov", "--model", "t.csv", *drive[2:], "--json", out),
                ("laws", "t.csv", *model, "--html", out))

    def test_an_input_is_never_an_output(self):
        for out in ("t.csv", "./t.csv", "sub/up/t.csv", "hard.csv", "soft.csv",
                    str(self.folder / "t.csv")):
            for command in self.writers(out):
                with self.subTest(out=out, command=command):
                    self.refuse(*command, word="t.csv")
        self.refuse("convert", "run.log", "run.log", word="run.log")
        self.refuse("convert", "run.log", "run.log", "--force", word="run.log")
        for command in (*self.writers("model.toml")[:7], self.writers("model.toml")[-1]):
            with self.subTest(command=command):
                self.refuse(*command, word="model.toml")

    def test_two_results_are_not_one_file(self):
        self.refuse("diagnose", "t.csv", "--model", self.model, "--json", "new", "--html", "./new",
                    word="--html")

    def test_a_file_of_others_needs_force(self):
        self.write("notes.csv", "measured by hand\n")
        for command in self.writers("notes.csv"):
            if command[0] == "calibration":
                continue  # adds to its file, and refuses what is no calibration
            with self.subTest(command=command):
                self.refuse(*command, word=WITHOUT_FORCE)
        self.refuse("record", "notes.csv", "--duration", "0.1", word=WITHOUT_FORCE)
        self.refuse("convert", "t.csv", "run.log", word=WITHOUT_FORCE)
        for command in (self.writers("notes.csv")[i] for i in (3, 5, 6, 7, 8)):
            with self.subTest(forced=command):
                self.write("notes.csv", "measured by hand\n")
                self.succeed(*command, "--force", cwd=self.folder)
                self.assertNotIn("by hand", (self.folder / "notes.csv").read_text())

    def test_a_log_in_use_is_never_replaced(self):
        with self.log.open("rb") as log:
            fcntl.flock(log, fcntl.LOCK_EX)
            for arguments in (("convert", "t.csv", "run.log", "--force"),
                              ("log", "repair", "made.log", "--out", "run.log", "--force")):
                self.refuse(*arguments, word="is being written by")

    def test_a_result_is_renewed_by_its_command(self):
        for name, command in (("e.json", 3), ("e.csv", 4), ("s.json", 5), ("sim.csv", 6),
                              ("c.csv", 7), ("x.csv", 8), ("x.mat", 8), ("x.h5", 8)):
            with self.subTest(name):
                arguments = self.writers(name)[command]
                self.succeed(*arguments, cwd=self.folder)
                first = (self.folder / name).read_bytes()
                self.succeed(*arguments, cwd=self.folder)
                if not name.startswith("x."):
                    self.assertEqual((self.folder / name).read_bytes(), first)
        self.assertEqual(json.loads((self.folder / "e.json").read_text())["written_by"],
                         "stickslip evaluate")
        self.refuse(*self.writers("e.json")[5], word=WITHOUT_FORCE)
        self.refuse("convert", "t.csv", "sim.csv", word=WITHOUT_FORCE)
        # A result is an input like any other.
        self.succeed("convert", "sim.csv", "again.log", cwd=self.folder)

    def test_a_failure_leaves_the_result_before(self):
        self.succeed(*self.writers("sim.csv")[6], cwd=self.folder)
        before = self.files()
        self.write("short.csv", "time_s,base_displacement_m\n0,0\n")
        before["short.csv"] = (self.folder / "short.csv").read_bytes()
        result = stickslip("simulate", "--model", self.model, "--drive", "short.csv", "--out",
                           "sim.csv", cwd=self.folder)
        self.assertEqual(result.returncode, 2)
        # A limit on the size of files stands for a full disk.
        result = subprocess.run(["bash", "-c", 'ulimit -f 4; exec "$@"', "-", STICKSLIP,
                                 *map(str, self.writers("sim.csv")[6])], cwd=self.folder,
                                capture_output=True, text=True, timeout=PATIENCE_S,
                                preexec_fn=lambda: signal.signal(signal.SIGXFSZ, signal.SIG_IGN))
        self.assertNotEqual(result.returncode, 0, result.stdout)
        self.assertEqual(self.files(), before)

    def test_special_files_work(self):
        self.succeed("estimate", "t.csv", "--model", self.model, "--out", "/dev/null", "--json",
                     "/dev/null", cwd=self.folder)
        piped = stickslip("simulate", "--model", self.model, "--drive", "t.csv", cwd=self.folder)
        with open(self.folder / "redirected.json", "wb") as out:
            result = subprocess.run([STICKSLIP, "evaluate", "t.csv", "--model", str(self.model),
                                     "--json", "/dev/stdout"], cwd=self.folder, stdout=out, timeout=PATIENCE_S)
        self.assertEqual(result.returncode, 0)
        redirected = (self.folder / "redirected.json").read_text()
        self.assertIn("RMS prediction error", redirected)
        self.assertEqual(json.loads(redirected[:redirected.index("chi-squared")])["schema"], 1)
        self.assertTrue(piped.stdout.startswith("time_s,"))
        os.mkfifo(self.folder / "pipe")
        with subprocess.Popen(["cat", self.folder / "pipe"], stdout=subprocess.PIPE) as reader:
            self.succeed("estimate", "t.csv", "--model", self.model, "--json", "pipe",
                         cwd=self.folder)
            self.assertIn(b"good_frames", reader.communicate(timeout=PATIENCE_S)[0])

    def test_a_folder_of_results_keeps_what_others_put_there(self):
        reduced = self.write("reduce.csv", "time_s,displacement_m,velocity_m_s,friction_force_n\n")
        self.assertEqual(stickslip("reduce", reduced, "--model", self.model, "--out",
                                   self.folder / "results").returncode, 2)
        self.assertFalse((self.folder / "results").exists())
        manual = self.folder / "man1"
        self.succeed("manual", manual)
        self.succeed("manual", manual)
        (manual / "stickslip.1").unlink()
        (manual / "stickslip.1").write_text("by hand")
        self.assertEqual(stickslip("manual", manual).returncode, 2)
        self.assertEqual((manual / "stickslip.1").read_text(), "by hand")


if __name__ == "__main__":
    main()
