"""A rig whose model lacks a physics, and one whose model lacks nothing: the diagnosis knows which is
which, names the first, and what it writes can be used again."""
import math
import unittest
import xml.etree.ElementTree

from contract import faults_of_diagnosis, faults_of_evaluation
from programs import SOURCE, EndToEnd, main, read_json

BELIEVED = SOURCE / "config/models/simulated.toml"
TRUTH = SOURCE / "config/models/simulated-truth.toml"
SECONDS = 16
RATE_HZ = 1000


def drive():
    """Base motion: a carrier of 2.5 Hz whose amplitude swells to 12 mm and back."""
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
        result = self.succeed("diagnose", recording, "--model", BELIEVED, "--json", report, *more,
                              timeout=300)
        content = read_json(report)
        self.assertEqual(faults_of_diagnosis(content), [])
        return content, result.stdout

    def first_screen(self, page):
        """What a person reads first, as text. The page is one file that needs nothing else: well
        formed, nothing loaded, nothing run, and small enough to be sent."""
        text = page.read_text()
        self.assertLess(len(text), 1_000_000)
        tree = xml.etree.ElementTree.fromstring(text)  # throws where it is no XML
        for element in tree.iter():
            self.assertNotIn(element.tag, {"script", "link", "iframe", "img", "object", "embed"})
            for name, value in element.attrib.items():
                self.assertNotIn("://", value)
                self.assertFalse(name.startswith("on"), name)
                self.assertTrue(name != "href" or value.startswith("#"), value)
        self.assertNotRegex(tree.find("head/style").text, r"url\(|@import")
        # Every picture has a name and a description, every link a place.
        for picture in tree.iter("svg"):
            self.assertTrue(picture.find("title").text and picture.find("desc").text)
        places = {element.get("id") for element in tree.iter()}
        for link in tree.iter("a"):
            self.assertIn(link.get("href")[1:], places)
        return " ".join("".join(tree.find("body/main/header").itertext()).split())

    def test_a_hidden_cubic_stiffness_is_named_and_the_model_mended(self):
        recording = self.record(TRUTH, 11)
        mended = self.folder / "mended.toml"
        # A name that HTML would take for markup.
        page = self.folder / "<b>&page\".html"
        report, said = self.diagnose(recording, "--write-model", mended, "--html", page)
        top = self.first_screen(page)
        self.assertIn("leaves out one piece of physics", top)
        self.assertIn(recording.name, top)
        held_out = report["fit"]["heldout"]
        self.assertIn(f"\u2192 {held_out['augmented']['chi2_per_sample']:#.3g}", top)
        self.assertIn(mended.read_text().splitlines()[-1], page.read_text())
        self.assertEqual(report["verdict"], "missing_physics")
        self.assertEqual(report["location"]["relation"], "force_balance")
        self.assertEqual([finding["id"] for finding in report["findings"]], ["cubic_stiffness"])
        self.assertGreater(report["findings"][0]["probability"], 0.9)
        self.assertIn("cubic_stiffness", said)

        # The true value is the one in the truth's file.
        true_value = float(next(line for line in TRUTH.read_text().splitlines()
                                if line.startswith("k3_n_m3")).split("=")[1].split("#")[0])
        found = report["findings"][0]["parameters"]["k3_n_m3"]["value"]
        self.assertAlmostEqual(found / true_value, 1.0, delta=0.15)
        held_out = report["fit"]["heldout"]
        self.assertLess(held_out["augmented"]["chi2_per_sample"],
                        0.5 * held_out["baseline"]["chi2_per_sample"])

        # The model that it wrote is a model: it is sound, it predicts another run of the same rig
        # better than what was believed, and nothing is missing from it.
        self.succeed("check", mended)
        other = self.record(TRUTH, 12)
        scores = {}
        for name, model in (("believed", BELIEVED), ("mended", mended)):
            out = self.folder / f"{name}.json"
            self.succeed("evaluate", other, "--model", model, "--json", out, timeout=300)
            evaluation = read_json(out)
            self.assertEqual(faults_of_evaluation(evaluation), [])
            scores[name] = evaluation["fit"]["chi2_per_sample"]
        self.assertLess(scores["mended"], 0.5 * scores["believed"])
        again = self.folder / "again.json"
        self.succeed("diagnose", other, "--model", mended, "--json", again, timeout=300)
        self.assertEqual(read_json(again)["verdict"], "consistent")

    def test_a_rig_that_follows_its_model_is_called_consistent(self):
        page = self.folder / "page.html"
        report, said = self.diagnose(self.record(BELIEVED, 13), "--html", page)
        self.assertEqual(report["verdict"], "consistent", said)
        top = self.first_screen(page)
        self.assertIn("Nothing is missing", top)
        chi2 = report["fit"]["heldout"]["baseline"]["chi2_per_sample"]
        self.assertIn(f"{chi2:#.3g} chi-squared per sample: 1 is what noise alone leaves", top)
        self.assertEqual(report["findings"], [])

    def test_the_answer_is_the_same_however_the_recording_is_cut_and_sampled(self):
        """Whole, in two pieces, at half the rate, and with another seed of the tool's own dice."""
        recording = self.record(TRUTH, 15)
        header, *rows = recording.read_text().splitlines(keepends=True)
        middle = len(rows) // 2
        halves = [self.write("first.csv", header + "".join(rows[:middle])),
                  self.write("second.csv", header + "".join(rows[middle:]))]
        sparse = self.write("sparse.csv", header + "".join(rows[::2]))
        found = {}
        for name, arguments in (("whole", [recording]), ("halves", halves), ("sparse", [sparse]),
                                ("seed", [recording, "--seed", 77])):
            out = self.folder / f"{name}-report.json"
            said = self.succeed("diagnose", *arguments, "--model", BELIEVED, "--json", out,
                                timeout=300).stdout
            report = read_json(out)
            self.assertEqual([f["id"] for f in report["findings"]], ["cubic_stiffness"],
                             f"{name}: {said}")
            found[name] = report["findings"][0]["parameters"]["k3_n_m3"]["value"]
        for name, value in found.items():
            self.assertAlmostEqual(value / found["whole"], 1.0, delta=0.05, msg=name)

    def test_the_same_recording_and_seed_give_the_same_bytes(self):
        """Whether it is a CSV file or a log, and on however many cores."""
        recording = self.record(TRUTH, 14)
        log = self.folder / "same.log"
        self.succeed("convert", recording, log)
        reports = []
        for source, jobs in ((recording, 2), (log, 1)):
            out = self.folder / f"from-{source.suffix[1:]}.json"
            self.succeed("diagnose", source, "--model", BELIEVED, "--json", out, "--seed", 5,
                         "--jobs", jobs, timeout=300)
            reports.append(out.read_bytes())
        self.assertEqual(reports[0], reports[1])


if __name__ == "__main__":
    main()
