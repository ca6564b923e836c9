# SPDX-License-Identifier: Apache-2.0
"""The Python module against the programs: same readings, reports and messages; live frames of a daemon."""
import ast
import csv
import inspect
import math
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import threading
import unittest

from programs import PATIENCE_S, SKIPPED, SOURCE, STICKSLIPD, EndToEnd, main, read_json, stickslip

if os.environ.get("STICKSLIP_PYTHON_PROBLEM"):
    print("skipped: the Python module is not built: " + os.environ["STICKSLIP_PYTHON_PROBLEM"])
    sys.exit(SKIPPED)

import numpy

import stickslip as module

MODEL = """schema = 1
[oscillator]
excitation = "force"
mass_kg = 1.0
stiffness_n_m = { value = 400.0, sigma = 4.0 }
damping_n_s_m = 2.0
[friction]
law = "coulomb"
mu = { value = 1.5, sigma = 0.1 }
transition_speed_m_s = 0.01
[sensors.displacement]
noise_std = 2e-5
[sensors.drive_force]
noise_std = 0.001
"""


def force_n(t):
    return 6.0 * math.sin(2.0 * math.pi * 1.7 * t) + 4.0 * math.sin(2.0 * math.pi * 2.9 * t)


class Recordings(unittest.TestCase):
    def made(self):
        t = numpy.arange(8) / 64
        return module.Recording(t, displacement_m=t ** 2, velocity_m_s=[0, 1, math.nan, 3, 4, 5, 6, 7])

    def test_arrays_come_back_and_nan_is_not_measured(self):
        recording = self.made()
        self.assertEqual((len(recording), recording.channels), (8, ("displacement_m", "velocity_m_s")))
        numpy.testing.assert_array_equal(recording.time_s, numpy.arange(8) / 64)
        numpy.testing.assert_array_equal(recording["displacement_m"], (numpy.arange(8) / 64) ** 2)
        numpy.testing.assert_array_equal(recording["velocity_m_s"], [0, 1, math.nan, 3, 4, 5, 6, 7])
        self.assertEqual(list(recording.frames["valid"]), [3, 3, 1, 3, 3, 3, 3, 3])
        self.assertEqual(recording.frames["velocity_m_s"][2], 0.0)
        self.assertEqual(recording.period_s, 1 / 64)

    def test_whole_channels_are_views_that_outlive_the_recording_and_cannot_be_written(self):
        recording = self.made()
        self.assertTrue(numpy.shares_memory(recording["displacement_m"], recording.frames))
        self.assertFalse(numpy.shares_memory(recording["velocity_m_s"], recording.frames))
        view = recording["displacement_m"]
        del recording
        self.assertEqual(view[-1], (7 / 64) ** 2)
        with self.assertRaises(ValueError):
            view[0] = 1.0

    def test_records_make_a_recording_again(self):
        recording = self.made()
        again = module.Recording.from_frames(numpy.concatenate([recording.frames[:3], recording.frames[3:]]))
        numpy.testing.assert_array_equal(again.frames, recording.frames)
        changed = recording.frames.copy()
        changed["displacement_m"] *= 2
        self.assertEqual(module.Recording.from_frames(changed)["displacement_m"][-1], 2 * (7 / 64) ** 2)

    def test_errors_name_the_array(self):
        t = numpy.arange(3.0)
        for arguments, words in (
                ({"displacement_m": [1, 2]}, "displacement_m has 2 values; expected 3"),
                ({"displacemnt_m": t}, "did you mean displacement_m?"),
                ({"displacement_m": [[1, 2, 3]]}, "2 dimensions"),
                ({"displacement_m": ["a", "b", "c"]}, "not an array of numbers"),
                ({"displacement_m": [0, math.inf, 0]}, "sample 1 is infinite")):
            with self.subTest(words), self.assertRaisesRegex(module.InputError, words.replace("?", r"\?")):
                module.Recording(t, source="mine", **arguments)
        for times, words in (([0, 1, 1], "sample 2"), ([], "no sample"), ([0, math.nan], "sample 1 is")):
            with self.subTest(words), self.assertRaisesRegex(ValueError, "mine: .*" + words):
                module.Recording(times, source="mine")
        with self.assertRaisesRegex(module.InputError, "time_ns"):
            module.Recording.from_frames(t)


class Models(EndToEnd):
    def test_numbers_are_a_mapping(self):
        model = module.Model.parse(MODEL)
        self.assertEqual(model["oscillator.stiffness_n_m"], (400.0, 4.0))
        self.assertIn("friction.mu", model)
        self.assertEqual(dict(model)["friction.mu"].sigma, 0.1)
        before = model.copy()
        model["oscillator.stiffness_n_m"] = 410
        self.assertEqual(model["oscillator.stiffness_n_m"], (410.0, 4.0))
        model["friction.mu"] = 1.4, 0.0
        self.assertEqual(model["friction.mu"], (1.4, 0.0))
        self.assertNotEqual(model, before)
        self.assertEqual(module.Model.parse(model.text), model)
        self.assertEqual(pickle.loads(pickle.dumps(model)), model)
        self.assertEqual((model.excitation, model.physics, model.dimensionless), ("force", [], False))

    def test_a_change_that_no_file_could_have_is_refused(self):
        model = module.Model.parse(MODEL)
        before = model.copy()
        for path, value, error, words in (
                ("oscillator.mass_kg", -1.0, module.InputError, "mass_kg"),
                ("oscillator.mass_kg", "heavy", TypeError, "not to 'heavy'"),
                ("oscillator.mas_kg", 1.0, KeyError, "did you mean oscillator.mass_kg")):
            with self.subTest(path=path, value=value), self.assertRaisesRegex(error, words):
                model[path] = value
        self.assertEqual(model, before)

    def test_files_of_others_are_not_replaced(self):
        file = self.write("rig.toml", MODEL)
        model = module.Model.read(file)
        for path in (file, self.write("other.toml", "mine")):
            with self.assertRaises(module.InputError):
                model.write(path)
        with self.assertRaisesRegex(module.InputError, "force=True"):
            model.write(self.folder / "other.toml")
        with self.assertRaises(module.InputError):
            model.write(file, force=True)
        model.write(self.folder / "other.toml", force=True)
        self.assertEqual(module.Model.read(self.folder / "other.toml"), model)
        self.assertEqual(file.read_text(), MODEL)

    def test_messages_are_those_of_the_program(self):
        broken = self.write("rig.toml", MODEL.replace("mass_kg = 1.0", "mass_kg = true"))
        data = self.write("data.csv", "time_s,displacement_m\n0,1\n1,x\n")
        drive = self.write("drive.csv", "time_s,drive_force_n\n" + "".join(f"{k},1\n" for k in range(9)))
        for read, command in ((lambda: module.Model.read(broken), ("evaluate", drive, "--model", broken)),
                              (lambda: module.Recording.read(data), ("evaluate", data, "--model", "beam-1"))):
            with self.assertRaises(module.InputError) as raised:
                read()
            printed = " ".join(stickslip(*command).stderr.split())
            self.assertEqual(f"stickslip: {raised.exception}", printed)
            self.assertGreater(raised.exception.line, 2)
            self.assertEqual(raised.exception.file, str(command[-1] if command[-1] == broken else data))
            self.assertEqual(raised.exception.problems[0][:2], (raised.exception.file, raised.exception.line))

    def test_shipped_models_are_found_by_name(self):
        self.assertIn("oscillator.mass_kg", module.Model.read("beam-1"))


class Processing(EndToEnd):
    def setUp(self):
        super().setUp()
        self.model_file = self.write("rig.toml", MODEL)
        t = numpy.arange(3000) / 200
        self.drive = module.Recording(t, source="drive", drive_force_n=[force_n(each) for each in t])
        self.drive_file = self.folder / "drive.csv"
        self.drive.write(self.drive_file)
        self.run_file = self.folder / "run.csv"
        self.succeed("simulate", "--model", self.model_file, "--drive", self.drive_file, "--out", self.run_file)

    def same(self, recording, file):
        read = module.Recording.read(file)
        self.assertEqual(recording.channels, read.channels)
        numpy.testing.assert_array_equal(recording.frames, read.frames)

    def test_files_round_trip(self):
        for name in ("copy.csv", "copy.log"):
            self.drive.write(self.folder / name)
            self.same(self.drive, self.folder / name)
            self.drive.write(self.folder / name)  # its own result is replaced
        self.assertIn(module.__version__, self.succeed("--version").stdout)

    def test_simulates_as_the_program(self):
        self.same(module.simulate(self.model_file, self.drive), self.run_file)
        quiet = module.simulate(self.model_file, self.drive, noise=False)
        self.assertFalse(numpy.array_equal(quiet["displacement_m"], module.Recording.read(self.run_file)["displacement_m"]))
        with self.assertRaisesRegex(module.InputError, "fewer than 5 samples"):
            module.simulate(self.model_file, module.Recording([0.0], drive_force_n=[1.0]))

    def test_reports_are_those_of_the_program(self):
        report, amended, scores = (self.folder / name for name in ("report.json", "amended.toml", "scores.json"))
        stiff = self.write("soft.toml", MODEL.replace("value = 400.0, sigma = 4.0", "value = 404.0, sigma = 4.0"))
        printed = self.succeed("diagnose", self.run_file, "--model", stiff, "--json", report, "--write-model", amended)
        steps = []
        result = module.diagnose(self.run_file, stiff, progress=lambda step, done: steps.append((step, done)))
        expected = read_json(report)
        self.assertEqual(expected.pop("written_by"), "stickslip diagnose")
        self.assertEqual(result, expected)
        self.assertEqual(list(result), list(expected))
        self.assertEqual(result.text, printed.stdout)
        self.assertEqual(result.model, module.Model.read(amended))
        self.assertEqual(steps[-1], ("done", 1.0))
        self.assertIn("<pre>", result._repr_html_())

        self.succeed("evaluate", self.run_file, "--model", self.model_file, "--free-run", "--json", scores)
        expected = read_json(scores)
        del expected["written_by"]
        self.assertEqual(module.evaluate(self.run_file, self.model_file, free_run=True), expected)

    def test_estimates_are_those_of_the_program(self):
        out, summary = self.folder / "estimates.csv", self.folder / "summary.json"
        self.succeed("estimate", self.run_file, "--model", self.model_file, "--out", out, "--json", summary)
        with open(out) as file:
            rows = list(csv.DictReader(file))
        result = module.estimate(module.Recording.read(self.run_file), module.Model.read(self.model_file))
        expected = read_json(summary)
        del expected["written_by"]
        self.assertEqual(result.summary, expected)
        self.assertEqual(list(result), list(rows[0]))
        for name, column in result.items():
            with self.subTest(name):
                numpy.testing.assert_allclose(column, [float(row[name]) for row in rows], rtol=6e-3, atol=6e-5)
        self.assertEqual(result["good"].dtype, bool)

    def test_options_are_checked(self):
        for options in ({"jobs": -1}, {"horizon_s": 0.0}, {"horizon_s": math.nan}):
            with self.subTest(options), self.assertRaises(ValueError):
                module.evaluate(self.run_file, self.model_file, **options)
        with self.assertRaises(ValueError):
            module.diagnose([], self.model_file)

    def test_ctrl_c_ends_a_diagnosis(self):
        """The signal comes from another thread of Python, which therefore runs beside the diagnosis."""
        begun = threading.Event()

        def interrupt():
            begun.wait()
            os.kill(os.getpid(), signal.SIGINT)

        steps = []

        def progress(step, done):
            steps.append(done)
            begun.set()

        thread = threading.Thread(target=interrupt)
        thread.start()
        with self.assertRaises(KeyboardInterrupt):
            module.diagnose(self.run_file, self.model_file, bootstrap=1000, progress=progress)
        thread.join()
        self.assertLess(steps[-1], 1.0)

    def test_an_exception_of_the_progress_ends_the_work(self):
        class Enough(Exception):
            pass

        def progress(step, done):
            raise Enough

        with self.assertRaises(Enough):
            module.diagnose(self.run_file, self.model_file, bootstrap=1000, progress=progress)


class LiveFrames(EndToEnd):
    def test_frames_are_those_that_the_daemon_records(self):
        recorded = self.folder / "run.log"
        with module.Live() as live:
            self.assertIsNone(live.receive(timeout_s=0.0))
            daemon = subprocess.Popen([STICKSLIPD, "--config", str(SOURCE / "config/simulated.toml"), "--control",
                                       str(self.folder / "socket"), "--record", str(recorded)],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(daemon.kill)
            blocks = []
            for frames in live:
                blocks.append(frames)
                if sum(map(len, blocks)) >= 500:
                    break
            daemon.terminate()
            self.assertEqual(daemon.wait(timeout=PATIENCE_S), 0)
            self.assertEqual((live.lost, live.malformed), (0, 0))
        with self.assertRaisesRegex(module.InputError, "closed"):
            live.receive()
        self.assertEqual(list(live), [])
        received = module.Recording.from_frames(numpy.concatenate(blocks))
        log = module.Recording.read(recorded)
        self.assertEqual(log.description["rig"], "simulated rig")
        begin = int(numpy.searchsorted(log.frames["sequence"], received.frames["sequence"][0]))
        numpy.testing.assert_array_equal(log.frames[begin:begin + len(received)], received.frames)

    def test_a_url_that_lcm_would_not_understand_is_refused(self):
        with self.assertRaisesRegex(module.InputError, "expected"):
            module.Live("udp://239.255.76.67:7667")


class Stub(unittest.TestCase):
    """The types in __init__.pyi are those of the module."""

    def test_names_and_parameters_are_those_of_the_module(self):
        stub = ast.parse((pathlib.Path(module.__file__).parent / "__init__.pyi").read_text())
        defined = {node.name: node for node in stub.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(set(defined), set(module.__all__) - {"__version__"})
        for name, node in defined.items():
            if isinstance(node, ast.FunctionDef):
                with self.subTest(name):
                    named = [each.arg for each in (*node.args.args, *node.args.kwonlyargs)]
                    self.assertEqual(named, list(inspect.signature(getattr(module, name)).parameters))
        for name in ("Recording", "Model", "Live"):
            members = {each.name: each for each in defined[name].body}
            public = {each for each in vars(getattr(module, name)) if not each.startswith("_")}
            with self.subTest(name):
                self.assertEqual({each for each in members if each[0] != "_"},
                                 public - {"get", "keys", "items", "values"})
            for each in public & set(members):
                with self.subTest(f"{name}.{each}"):
                    arguments = members[each].args
                    for argument in (*arguments.args, *arguments.kwonlyargs):
                        self.assertIn(argument.arg, "self " + getattr(getattr(module, name), each).__doc__)

    def test_everything_is_documented(self):
        for name in module.__all__:
            if name in ("__version__", "Parameter"):
                continue
            with self.subTest(name):
                self.assertGreater(len(inspect.getdoc(getattr(module, name)) or ""), 40)


if __name__ == "__main__":
    main()
