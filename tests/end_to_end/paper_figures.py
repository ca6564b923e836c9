# SPDX-License-Identifier: Apache-2.0
"""`stickslip figures` and `stickslip reduce`: all plots are valid, and the page contains the numbers for
the paper's statements."""
import csv
import html
import pathlib
import re
import tempfile
import unittest
import xml.etree.ElementTree as xml

from programs import SOURCE, main, stickslip

PRESETS = SOURCE / "config"


def tables_of(page):
    """Rows (statement, paper, ours) by number of the figure."""
    found = {}
    for number, rest in re.findall(r'<h2 id="figure-(\d+)">(.*?)</section>', page, re.DOTALL):
        rows = re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td></tr>", rest)
        found[int(number)] = [tuple(html.unescape(cell) for cell in row) for row in rows]
    return found


class PaperFigures(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.keep = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.keep.name) / "new" / "figures"
        cls.drawn = stickslip("figures", "--out", cls.folder, "--presets", PRESETS, "--periods", "300")
        cls.page = (cls.folder / "index.html").read_text() if cls.drawn.returncode == 0 else ""
        cls.tables = tables_of(cls.page)

    @classmethod
    def tearDownClass(cls):
        cls.keep.cleanup()

    def ours(self, figure, beginning):
        for statement, _, ours in self.tables[figure]:
            if statement.startswith(beginning):
                return ours
        self.fail(f"Figure {figure} has no statement: {beginning}")

    def test_exit_status_and_output(self):
        self.assertEqual(self.drawn.returncode, 0, self.drawn.stderr)
        self.assertEqual(self.drawn.stderr, "")
        self.assertIn("9 figures", self.drawn.stdout)

    def test_figures_2_to_10_have_their_plots(self):
        self.assertEqual(sorted(self.tables), list(range(2, 11)))
        pictures = set(re.findall(r'<img src="([^"]+)"', self.page))
        self.assertGreaterEqual(len(pictures), 25)
        for name in pictures:
            with self.subTest(picture=name):
                shapes = xml.parse(self.folder / name).getroot().iter()
                self.assertGreater(sum(1 for _ in shapes), 50)
                png = (self.folder / name).with_suffix(".png").read_bytes()
                self.assertTrue(png.startswith(b"\x89PNG"))

    def test_each_statement_has_a_number(self):
        for number, rows in self.tables.items():
            self.assertGreaterEqual(len(rows), 3, f"Figure {number}")
            for statement, paper, ours in rows:
                with self.subTest(figure=number, statement=statement):
                    self.assertTrue(paper)
                    self.assertTrue(ours)
                    self.assertNotIn("nan", ours)

    def test_figure_9_has_its_extremes(self):
        self.assertEqual(self.ours(9, "Largest displacement"), "1.5397 and 2.1371")
        self.assertTrue(self.ours(9, "Negative friction").startswith("3.98 %"))

    def test_only_the_state_variable_overshoots_in_figure_10(self):
        coulomb, memory = (float(number) for number in
                           re.findall(r"([\d.]+) %", self.ours(10, "Overshoot")))
        self.assertLess(coulomb, 0.1)
        self.assertGreater(memory, 1.0)

    def test_chaotic_rigs_have_a_positive_exponent(self):
        for figure in (2, 6, 7, 8):
            exponent, error = map(float, re.search(r"([\d.-]+) \+- ([\d.]+)",
                                                   self.ours(figure, "Chaotic")).groups())
            with self.subTest(figure=figure):
                self.assertGreater(exponent, 5.0 * error)

    def test_recording_of_a_figure_can_be_reduced(self):
        out = pathlib.Path(self.keep.name) / "reduced"
        run = stickslip("reduce", self.folder / "figure-4.csv", "--model",
                        PRESETS / "models/beam-1.toml", "--out", out)
        self.assertEqual(run.returncode, 0, run.stderr)
        low, high = map(float, re.search(r"sliding mu: ([\d.-]+) to ([\d.-]+)", run.stdout).groups())
        self.assertAlmostEqual(low, 0.8, delta=0.05)
        self.assertAlmostEqual(high, 0.8, delta=0.03)
        with open(out / "surface.csv", newline="") as file:
            cells = list(csv.DictReader(file))
        with open(out / "samples.csv", newline="") as file:
            samples = list(csv.DictReader(file))
        self.assertEqual(sum(int(cell["samples"]) for cell in cells), len(samples))
        for stem in ("surface", "map", "sweep", "mu-v", "mu-x", "n-x"):
            self.assertIn("</svg>", (out / f"{stem}.svg").read_text())
        self.assert_documented(samples[0])
        self.assert_documented(cells[0])

    def assert_documented(self, columns):
        formats = (SOURCE / "docs/formats.md").read_text()
        for column in columns:
            self.assertIn(f"`{column}`", formats)

    def test_surfaces_have_a_flat_map_beside_them(self):
        for number in range(4, 9):
            with self.subTest(figure=number):
                self.assertIn("mu, mean of the cell",
                              (self.folder / f"figure-{number}a-map.svg").read_text())

    def test_the_trajectory_has_axes_with_units(self):
        for name, labels in (("figure-2a", ("x [mm]", "v [m/s]", "0.25", "0.75")),
                             ("figure-10a", (">x<", ">v<", "0.25", "0.75"))):
            texts = (self.folder / f"{name}.svg").read_text()
            for label in labels:
                with self.subTest(figure=name, label=label):
                    self.assertIn(label, texts)

    def diagram(self, model, *arguments):
        out = pathlib.Path(self.keep.name)
        run = stickslip("bifurcation", "--model", PRESETS / "models" / model, "--values", "3",
                        "--periods", "20", "--transient", "20", "--exponents", *arguments,
                        "--out", out / "diagram.csv", "--svg", out / "diagram.svg")
        self.assertEqual(run.returncode, 0, run.stderr)
        table = (out / "diagram.csv").read_text()
        self.assertNotRegex(table, r"(^|,)-0(\.0*)?(,|\n)")
        header = table.splitlines()[0]
        for name in ("diagram.png", "diagram.gp"):
            self.assertTrue((out / name).is_file(), name)
        return header, (out / "diagram.svg").read_text()

    def test_a_bifurcation_diagram_names_its_parameter_and_is_drawn(self):
        header, picture = self.diagram("motivational.toml", "--frequency-hz", "4.2", "--over",
                                       "drive.amplitude_m", "--from", "0.006", "--to", "0.008")
        self.assertEqual(header, "drive.amplitude_m,displacement_m,velocity_m_s,exponent_per_s")
        self.assertIn("drive.amplitude [mm]", picture)
        self.assertIn("largest exponent [1/s]", picture)
        run = stickslip("bifurcation", "--model", PRESETS / "models/motivational.toml",
                        "--frequency-hz", "4.2", "--over", "drive.amplitude_m", "--from", "0.006",
                        "--to", "0.008", "--svg", pathlib.Path(self.keep.name) / "diagram.pdf")
        self.assertEqual(run.returncode, 2)
        self.assertIn("expected a name that ends in .svg", run.stderr)

    def test_a_dimensionless_model_has_results_without_units(self):
        model = "paper-figure-10.toml"
        header, picture = self.diagram(model, "--omega", "1.25", "--over",
                                       "drive.acceleration_m_s2", "--from", "1.5", "--to", "1.9")
        self.assertEqual(header, "drive.acceleration,displacement,velocity,exponent")
        self.assertNotRegex(picture, r"\[(mm?|1/s|m/s2?)\]")
        drive = ("--model", PRESETS / "models" / model, "--omega", "1.25", "--acceleration", "1.9",
                 "--periods", "20", "--transient", "5")
        out = pathlib.Path(self.keep.name) / "section.csv"
        section = stickslip("poincare", *drive, "--out", out)
        self.assertEqual(section.returncode, 0, section.stderr)
        self.assertEqual(out.read_text().splitlines()[0], "time,displacement,velocity,theta")
        self.assertNotRegex(section.stdout, r"\d (m|m/s|N)\b")
        exponent = stickslip("lyapunov", *drive)
        self.assertIn("per unit of time", exponent.stdout)
        self.assertIn("dimensionless", stickslip("check", PRESETS / "models" / model).stdout)

    def test_method_of_the_paper_uses_800_samples(self):
        run = stickslip("reduce", self.folder / "figure-4.csv", "--model",
                        PRESETS / "models/beam-1.toml", "--method", "paper")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("800 of 10201 samples", run.stdout)

    def test_invalid_arguments_are_refused(self):
        for arguments, expected in (
                (["figures", "--out", self.keep.name, "--presets", PRESETS, "--only", "11"],
                 "no figure 11"),
                (["figures", "--out", self.keep.name, "--presets", self.folder],
                 "motivational.toml"),
                (["figures", "--out", self.folder / "index.html/x", "--presets", PRESETS],
                 "index.html/x"),
                (["reduce", self.folder / "figure-4.csv", "--model",
                  PRESETS / "models/motivational.toml"], "[load_cell]"),
                (["reduce", self.folder / "figure-4.csv", "--model", PRESETS / "models/beam-1.toml",
                  "--samples", "20000"], "expected 20000"),
        ):
            with self.subTest(arguments=[str(a) for a in arguments]):
                run = stickslip(*arguments)
                self.assertEqual(run.returncode, 2, run.stderr)
                self.assertIn(expected, run.stderr)


if __name__ == "__main__":
    main()
