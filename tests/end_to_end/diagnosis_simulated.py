# SPDX-License-Identifier: Apache-2.0
"""A rig whose model lacks an effect, and one whose model is complete: verdict, identified effect, report
page, augmented model and determinism."""
import math
import xml.etree.ElementTree
from hashlib import sha256

from contract import faults_of_diagnosis, faults_of_evaluation
from programs import PATIENCE_S, SOURCE, EndToEnd, main, read_json

DECLARED = SOURCE / "config/models/simulated.toml"
TRUTH = SOURCE / "config/models/simulated-truth.toml"
SECONDS = 16
RATE_HZ = 1000


def drive():
    """Base motion: a carrier of 2.5 Hz, amplitude-modulated between 0 and 12 mm."""
    lines = ["time_s,base_displacement_m"]
    for i in range(SECONDS * RATE_HZ + 1):
        t = i / RATE_HZ
        amplitude = 0.006 * (1 - math.cos(2 * math.pi * t / 8))
        lines.append(f"{t:.3f},{amplitude * math.sin(2 * math.pi * 2.5 * t):.9f}")
    return "\n".join(lines) + "\n"


class SimulatedDiagnosis(EndToEnd):
    def record(self, truth, seed):
        recording = self.folder / f"{truth.stem}-{seed}.csv"
        self.succeed("simulate", "--model", truth, "--drive", self.write("drive.csv", drive()),
                     "--out", recording, "--seed", seed)
        return recording

    def diagnose(self, recording, *more):
        report = self.folder / f"{recording.stem}.json"
        result = self.succeed("diagnose", recording, "--model", DECLARED, "--json", report, *more,
                              timeout=PATIENCE_S)
        content = read_json(report)
        self.assertEqual(faults_of_diagnosis(content), [])
        return content, result.stdout

    def first_screen(self, page):
        """The text of the page's header. The page is self-contained: well-formed, below 1 MB, without
        scripts and external resources."""
        text = page.read_text()
        self.assertLess(len(text), 1_000_000)
        tree = xml.etree.ElementTree.fromstring(text)  # raises if not well-formed
        for element in tree.iter():
            self.assertNotIn(element.tag, {"script", "link", "iframe", "img", "object", "embed"})
            for name, value in element.attrib.items():
                self.assertNotIn("://", value)
                self.assertFalse(name.startswith("on"), name)
                self.assertTrue(name != "href" or value.startswith("#"), value)
        self.assertNotRegex(tree.find("head/style").text, r"url\(|@import")
        # Every figure has a title and a description, every link a target.
        for figure in tree.iter("svg"):
            self.assertTrue(figure.find("title").text and figure.find("desc").text)
        targets = {element.get("id") for element in tree.iter()}
        for link in tree.iter("a"):
            self.assertIn(link.get("href")[1:], targets)
        return " ".join("".join(tree.find("body/main/header").itertext()).split())

    def test_hidden_cubic_stiffness_is_identified_and_the_model_augmented(self):
        recording = self.record(TRUTH, 11)
        augmented = self.folder / "augmented.toml"
        # A file name that needs escaping in HTML.
        page = self.folder / "<b>&page\".html"
        report, text = self.diagnose(recording, "--write-model", augmented, "--html", page)
        top = self.first_screen(page)
        self.assertIn("lacks one physical effect", top)
        self.assertIn(recording.name, top)
        held_out = report["fit"]["heldout"]
        self.assertIn(f"\u2192 {held_out['augmented']['chi2_per_sample']:#.3g}", top)
        self.assertIn(augmented.read_text().splitlines()[-1], page.read_text())
        self.assertEqual(report["verdict"], "missing_physics")
        self.assertEqual(report["location"]["relation"], "force_balance")
        self.assertEqual([finding["id"] for finding in report["findings"]], ["cubic_stiffness"])
        self.assertGreater(report["findings"][0]["probability"], 0.9)
        self.assertIn("cubic_stiffness", text)

        true_value = float(next(line for line in TRUTH.read_text().splitlines()
                                if line.startswith("k3_n_m3")).split("=")[1].split("#")[0])
        found = report["findings"][0]["parameters"]["k3_n_m3"]["value"]
        self.assertAlmostEqual(found / true_value, 1.0, delta=0.15)
        held_out = report["fit"]["heldout"]
        # Of chi-squared above that of noise alone, little is left.
        excess = {model: score["chi2_per_sample"] - 1.0 for model, score in held_out.items()}
        self.assertGreater(excess["baseline"], 0.2)
        self.assertLess(excess["augmented"], 0.2 * excess["baseline"])

        # The augmented model is valid, predicts another run of the same rig better than the declared
        # one, and lacks nothing.
        self.succeed("check", augmented)
        self.assertRegex(augmented.read_text(), r"k3_n_m3 = \{ value = .*, sigma = .* \}")
        other = self.record(TRUTH, 12)
        scores = {}
        for name, model in (("declared", DECLARED), ("augmented", augmented)):
            out = self.folder / f"{name}.json"
            self.succeed("evaluate", other, "--model", model, "--json", out)
            evaluation = read_json(out)
            self.assertEqual(faults_of_evaluation(evaluation), [])
            scores[name] = evaluation["fit"]["chi2_per_sample"]
        self.assertLess(scores["augmented"], 0.5 * scores["declared"])
        again = self.folder / "again.json"
        self.succeed("diagnose", other, "--model", augmented, "--json", again)
        self.assertEqual(read_json(again)["verdict"], "consistent")

    def test_recording_of_the_declared_model_is_consistent(self):
        page = self.folder / "page.html"
        report, text = self.diagnose(self.record(DECLARED, 13), "--html", page)
        self.assertEqual(report["verdict"], "consistent", text)
        top = self.first_screen(page)
        self.assertIn("No missing physics", top)
        chi2 = report["fit"]["heldout"]["baseline"]["chi2_per_sample"]
        self.assertIn(f"{chi2:#.3g} chi-squared per sample (1: noise only)", top)
        self.assertEqual(report["findings"], [])


class SmallRig(EndToEnd):
    """A driven mass on a spring: what does not depend on the rig is shown where a diagnosis takes seconds."""
    RIG = """
schema = 1
[oscillator]
excitation = "force"
mass_kg = 1.0
stiffness_n_m = {{ value = 158.0, sigma = 5.0 }}
damping_ratio = {damping_ratio}
[sensors.displacement]
noise_std = 2.0e-5
"""
    CUBIC = """
[[physics]]
id = "cubic_stiffness"
k3_n_m3 = 2000.0
"""

    def setUp(self):
        super().setUp()
        self.declared = self.write("declared.toml", self.RIG.format(damping_ratio=0.02))

    def record(self, truth, seed):
        rows = [f"{k / 200:.3f},{math.sin(2 * math.pi * (0.2 + k / 4000) * k / 200):.6f}" for k in range(3600)]
        drive_file = self.write("force.csv", "\n".join(["time_s,drive_force_n", *rows]) + "\n")
        recording = self.folder / "recording.csv"
        self.succeed("simulate", "--model", self.write("truth.toml", truth), "--drive", drive_file, "--out",
                     recording, "--seed", seed)
        return recording

    def diagnose(self, name, *arguments):
        """The report, its text, and what was printed."""
        out = self.folder / f"{name}.json"
        printed = self.succeed("diagnose", *arguments, "--model", self.declared, "--json", out).stdout
        report = read_json(out)
        self.assertEqual(faults_of_diagnosis(report), [])
        return report, out.read_text(), printed

    def test_a_declared_number_that_is_wrong_by_a_factor_is_named(self):
        recording = self.record(self.RIG.format(damping_ratio=0.06), 3)
        mended = self.folder / "mended.toml"
        report, _, text = self.diagnose("wrong", recording, "--write-model", mended)
        self.assertEqual([(f["id"], f["parameter"]) for f in report["findings"]],
                         [("declared_value", "oscillator.damping_ratio")], text)
        self.assertIn("not 0.02; with it the model fits", text)
        self.assertAlmostEqual(report["findings"][0]["parameters"]["value"]["value"], 0.06, delta=0.002)
        self.assertRegex(mended.read_text(), r"damping_ratio = \{ value = 0.0[56].*, sigma = ")
        self.assertNotIn("[[physics]]", mended.read_text())

    def test_result_does_not_depend_on_segmentation_sampling_format_and_threads(self):
        """One recording, two halves, half the rate, another seed of the bootstrap; from CSV and LCM log, on
        one and two threads, the same bytes but for the files that were read."""
        recording = self.record(self.RIG.format(damping_ratio=0.02) + self.CUBIC, 15)
        header, *rows = recording.read_text().splitlines(keepends=True)
        middle = len(rows) // 2
        halves = [self.write("first.csv", header + "".join(rows[:middle])),
                  self.write("second.csv", header + "".join(rows[middle:]))]
        sparse = self.write("sparse.csv", header + "".join(rows[::2]))
        log = self.folder / "recording.log"
        self.succeed("convert", recording, log)
        found = {}
        texts = {}
        for name, arguments in (("whole", [recording, "--jobs", 2]), ("log", [log, "--jobs", 1]),
                                ("halves", halves), ("sparse", [sparse]), ("seed", [recording, "--seed", 77])):
            report, texts[name], printed = self.diagnose(name, *arguments)
            self.assertEqual([f["id"] for f in report["findings"]], ["cubic_stiffness"], f"{name}: {printed}")
            found[name] = report["findings"][0]["parameters"]["k3_n_m3"]["value"]
        for name, value in found.items():
            self.assertAlmostEqual(value / found["whole"], 1.0, delta=0.05, msg=name)
        parts = {name: texts[name].split('"provenance"') for name in ("whole", "log")}
        self.assertEqual(parts["whole"][0], parts["log"][0])
        for name, source in (("whole", recording), ("log", log)):
            self.assertIn(sha256(source.read_bytes()).hexdigest(), parts[name][1])


if __name__ == "__main__":
    main()
