# SPDX-License-Identifier: Apache-2.0
"""`stickslip effects`: the catalogue in a terminal, an effect with its picture, and a slip of the finger."""
import unittest
import xml.etree.ElementTree as xml

from programs import SOURCE, main, stickslip

IDS = sorted(path.stem for path in (SOURCE / "physics/effects").glob("*.cpp"))
LAWS = sorted(path.stem for path in (SOURCE / "physics/laws").glob("*.cpp"))


class Effects(unittest.TestCase):
    def answer(self, *arguments):
        run = stickslip("effects", *arguments)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual(run.stderr, "")
        return run.stdout

    def test_the_list_has_one_line_per_effect_and_per_law(self):
        effects, heading, laws = self.answer().split("\n\n")
        self.assertEqual(sorted(line.split()[0] for line in effects.splitlines()), IDS)
        self.assertIn("Laws of friction", heading)
        self.assertEqual(sorted(line.split()[0] for line in laws.splitlines()), LAWS)

    def test_every_law_is_explained(self):
        for name in LAWS:
            with self.subTest(law=name):
                self.assertIn(f'\nDeclared as\n  [friction] law = "{name}"\n', self.answer(name))
        run = stickslip("effects", "lugre", "--svg")
        self.assertEqual(run.returncode, 2)
        self.assertIn("`stickslip laws --html` draws", run.stderr)

    def test_every_effect_is_explained(self):
        for name in IDS:
            with self.subTest(effect=name):
                text = self.answer(name)
                self.assertTrue(text.startswith(name + ": "))
                for heading in ("Formula", "Parameters", "Acts on", "Tier"):
                    self.assertIn(f"\n{heading}\n", text)

    def test_an_effect_states_units_and_references(self):
        text = self.answer("stribeck")
        for part in ("stribeck_speed_m_s [m/s]", "R. Stribeck", "1902", "dwell_strengthening"):
            self.assertIn(part, text)

    def test_the_picture_and_the_page_are_those_of_the_documents(self):
        self.assertEqual(self.answer("--markdown"), (SOURCE / "docs/effects.md").read_text())
        picture = self.answer("cubic_stiffness", "--svg")
        xml.fromstring(picture)
        self.assertEqual(picture, (SOURCE / "docs/effects/cubic_stiffness.svg").read_text())

    def test_an_unknown_id_gets_a_suggestion(self):
        for given, expected in (("stribek", 'did you mean "stribeck"?'),
                                ("zzzzzz", "`stickslip effects` lists them")):
            run = stickslip("effects", given)
            self.assertEqual(run.returncode, 2)
            self.assertEqual(run.stdout, "")
            self.assertIn(given, run.stderr)
            self.assertIn(expected, run.stderr)

    def test_options_that_contradict_are_refused(self):
        for arguments in (("--svg",), ("stribeck", "--markdown")):
            self.assertEqual(stickslip("effects", *arguments).returncode, 2)


if __name__ == "__main__":
    main()
