# SPDX-License-Identifier: Apache-2.0
"""The order of the house that no compiler sees: names, places, links.

Usage: house.py SOURCE_FOLDER
"""
import json
import pathlib
import re
import subprocess
import sys
import unittest

import checkout

SOURCE = pathlib.Path(sys.argv[1]).resolve()

TOP = {".ci", ".clang-format", ".clang-tidy", ".gitignore", "CHANGELOG.md", "CMakeLists.txt",
       "CMakePresets.json", "LICENSE", "README.md", "config", "daemon", "diagnosis", "docs", "drivers",
       "observer", "physics", "protocol", "systemd", "tests", "tools"}
EMPTY_NAMES = re.compile(r"(^|[_-])(utils?|common|managers?|helpers?|misc)([_-]|$)", re.IGNORECASE)
# A folder that exists on one machine only. (Written so that this line is not one.)
ONE_MACHINE = re.compile(r"(?<![\w.~$}>)])/(?:home|root|work|farm|Users)/[\w.]")

SOURCES = {".h", ".cpp", ".py", ".sh", ".cmake", ".js", ".mjs", ".lcm", ".conf", ".rules"}

FILES = checkout.committed(SOURCE)
LONGEST_FUNCTION = 100
LONG_FUNCTION = 60
MOST_LONG_FUNCTIONS = 10
LONGEST_LINE = 110  # of a document, tables and listings excepted


def text_of(name):
    return checkout.text_of(SOURCE / name)


def functions():
    """(lines, file, name) of every function, by Universal Ctags; of tests, too."""
    sources = [str(name) for name in FILES if name.suffix in (".h", ".cpp")]
    listed = subprocess.run(["ctags", "-f", "-", "-L", "-", "--c++-kinds=f", "--fields=+ne",
                             "--output-format=json"], cwd=SOURCE, input="\n".join(sources),
                            capture_output=True, text=True, check=True)
    for line in listed.stdout.splitlines():
        tag = json.loads(line)
        if "end" in tag:
            yield tag["end"] - tag["line"] + 1, tag["path"], tag["name"]


class House(unittest.TestCase):
    def test_there_is_something_to_look_at(self):
        self.assertGreater(len(FILES), 20)

    def test_only_the_agreed_folders_stand_at_the_top(self):
        self.assertEqual({name.parts[0] for name in FILES} - TOP, set())

    def test_files_are_named_after_the_thing_in_them(self):
        for name in FILES:
            for part in name.parts:
                with self.subTest(file=str(name)):
                    self.assertIsNone(EMPTY_NAMES.search(pathlib.PurePath(part).stem))

    def test_includes_do_not_climb(self):
        climbing = re.compile(r'^\s*#\s*include\s*["<]\.\./', re.MULTILINE)
        self.assertIsNotNone(climbing.search('#include "../physics/frame.h"'))
        for name in FILES:
            if name.suffix in (".h", ".cpp"):
                with self.subTest(file=str(name)):
                    self.assertIsNone(climbing.search(text_of(name)))

    def test_headers_are_included_once(self):
        for name in FILES:
            if name.suffix == ".h":
                with self.subTest(file=str(name)):
                    self.assertIn("#pragma once", text_of(name))

    def test_every_source_names_its_licence(self):
        for name in FILES:
            text = text_of(name)
            if name.suffix in SOURCES or name.name == "CMakeLists.txt" or text.startswith("#!"):
                with self.subTest(file=str(name)):
                    self.assertIn("SPDX-License-Identifier: Apache-2.0", "".join(text.splitlines(True)[:2]))

    def test_no_path_of_one_machine(self):
        self.assertIsNotNone(ONE_MACHINE.search("/" + "home/someone/rig"))
        self.assertIsNone(ONE_MACHINE.search("build/" + "root/x and ../" + "work/x and a/" + "home/b"))
        for name in FILES:
            for number, line in enumerate(text_of(name).splitlines(), 1):
                with self.subTest(file=str(name), line=number):
                    self.assertIsNone(ONE_MACHINE.search(line), line)

    def test_links_in_the_documentation_lead_somewhere(self):
        link = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
        for name in FILES:
            if name.suffix != ".md":
                continue
            for target in link.findall(text_of(name)):
                if "://" in target or target.startswith("mailto:"):
                    continue
                with self.subTest(file=str(name), link=target):
                    self.assertTrue((SOURCE / name.parent / target).exists())

    def test_functions_fit_on_a_screen(self):
        lengths = sorted(functions(), reverse=True)
        self.assertGreater(len(lengths), 1000)
        self.assertEqual([each for each in lengths if each[0] > LONGEST_FUNCTION], [])
        long = [each for each in lengths if each[0] > LONG_FUNCTION]
        self.assertLessEqual(len(long), MOST_LONG_FUNCTIONS, long)

    def test_lines_of_documents_are_short(self):
        for name in FILES:
            if name.suffix != ".md":
                continue
            listing = False
            for number, line in enumerate(text_of(name).splitlines(), 1):
                if line.startswith("```"):
                    listing = not listing
                if listing or line.startswith(("|", "    ")):
                    continue
                with self.subTest(file=str(name), line=number):
                    self.assertLessEqual(len(re.sub(r"\]\([^)]*\)", "]", line)), LONGEST_LINE)

    def test_the_commands_of_the_readme_can_be_run(self):
        for name in ("tools/demo", "tools/test", ".ci/run"):
            with self.subTest(file=name):
                self.assertTrue((SOURCE / name).stat().st_mode & 0o111, "not executable")
                self.assertTrue(text_of(name).startswith("#!"))
        self.assertIn("tools/test", text_of(".ci/run"))
        readme = text_of("README.md")
        for command in ("tools/demo", "tools/test", "tools/packages"):
            self.assertIn(command, readme)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
