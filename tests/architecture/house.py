"""The order of the house that no compiler sees: names, places, links.

Usage: house.py SOURCE_FOLDER
"""
import pathlib
import re
import subprocess
import sys
import unittest

SOURCE = pathlib.Path(sys.argv[1]).resolve()

TOP = {".ci", ".clang-format", ".clang-tidy", ".gitignore", "CHANGELOG.md", "CMakeLists.txt",
       "CMakePresets.json", "README.md", "config", "daemon", "docs", "drivers", "physics",
       "protocol", "systemd", "tests", "tools"}
EMPTY_NAMES = re.compile(r"(^|[_-])(utils?|common|managers?|helpers?|misc)([_-]|$)", re.IGNORECASE)
# A folder that exists on one machine only. (Written so that this line is not one.)
ONE_MACHINE = re.compile(r"(?<![\w.~$}>)])/(?:home|root|work|farm|Users)/[\w.]")


def committed():
    """Every file that is under version control, relative to the checkout; in an unpacked archive,
    every file outside the build folders."""
    listed = subprocess.run(["git", "-c", f"safe.directory={SOURCE}", "-C", str(SOURCE), "ls-files", "-z"],
                            capture_output=True)
    if listed.returncode == 0 and listed.stdout:
        names = [pathlib.PurePath(name) for name in listed.stdout.decode().split("\0") if name]
        return [name for name in names if (SOURCE / name).is_file()]
    return [path.relative_to(SOURCE) for path in SOURCE.rglob("*") if path.is_file()
            and not path.relative_to(SOURCE).parts[0].startswith(("build", ".git"))]


FILES = committed()


def text_of(name):
    try:
        return (SOURCE / name).read_text()
    except UnicodeDecodeError:
        return ""  # binary


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

    def test_no_path_of_one_machine(self):
        self.assertIsNotNone(ONE_MACHINE.search("/" + "home/someone/rig"))
        self.assertIsNone(ONE_MACHINE.search("build/root/x and ../work/x and a/home/b"))
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
