# SPDX-License-Identifier: Apache-2.0
"""docs/dependencies.md, held against tools/packages, the npm packages of the build, and the libraries that
the programs and the Python module are linked with.

Usage: dependencies.py SOURCE_FOLDER PROGRAM ...
"""
import pathlib
import re
import subprocess
import sys
import unittest

SOURCE = pathlib.Path(sys.argv[1]).resolve()
PROGRAMS = [each for each in sys.argv[2:] if each]
PAGE = (SOURCE / "docs/dependencies.md").read_text()


def tables():
    """Rows of cells, the header left out, by heading."""
    found = {}
    for section in PAGE.split("\n## ")[1:]:
        heading, text = section.split("\n", 1)
        rows = [[cell.strip() for cell in line.strip("|").split("|")]
                for line in text.splitlines() if line.startswith("|")]
        found[heading] = rows[2:]
    return found


TABLES = tables()
LINKED = TABLES["Linked or compiled into the programs"]


def linked_libraries():
    """Names without version of the shared libraries that the programs name themselves."""
    names = set()
    for program in PROGRAMS:
        listed = subprocess.run(["readelf", "-d", program], capture_output=True, text=True, check=True).stdout
        names |= {name.split(".so")[0] for name in re.findall(r"\(NEEDED\).*\[(.*)\]", listed)}
    return names


class Dependencies(unittest.TestCase):
    def test_every_package_has_its_row_and_every_row_its_package(self):
        needed = [line.split()[1] for line in (SOURCE / "tools/packages").read_text().splitlines()
                  if line and not line.startswith("#")]
        rows = [cells[0].strip("`") for heading, table in TABLES.items() if heading != "From npm" for cells in table]
        self.assertEqual(sorted(rows), sorted(needed))

    def test_the_npm_packages_are_those_of_the_build(self):
        fetched = set()
        for name in ("tools/scope/CMakeLists.txt", "tests/browser/CMakeLists.txt"):
            fetched |= set(re.findall(r"stickslip_npm_package\((\S+) (\S+)\s+\w{128}\)", (SOURCE / name).read_text()))
        self.assertEqual({tuple(cells[0].lower().split()) for cells in TABLES["From npm"]}, fetched)

    def test_the_programs_are_linked_with_the_listed_libraries(self):
        listed = {name for cells in LINKED for name in re.findall(r"`([^`]+)`", cells[2])}
        self.assertEqual(linked_libraries(), listed)

    def test_libraries_under_the_lgpl_are_linked_dynamically(self):
        lesser = [cells for cells in LINKED if "LGPL" in cells[1]]
        self.assertGreater(len(lesser), 3)
        for cells in lesser:
            with self.subTest(package=cells[0]):
                self.assertNotEqual(cells[2], "headers only")

    def test_every_row_names_licence_and_reason(self):
        for table in TABLES.values():
            for cells in table:
                with self.subTest(package=cells[0]):
                    self.assertGreaterEqual(len(cells), 3)
                    self.assertTrue(all(cells[:3]))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
