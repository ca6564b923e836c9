# SPDX-License-Identifier: Apache-2.0
"""The manual pages: complete, valid by mandoc, and equal to those of the build."""
import os
import pathlib
import re
import shutil
import unittest

from programs import STICKSLIP, STICKSLIPD, EndToEnd, main, run

SECTIONS = ["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "EXAMPLES", "SEE ALSO"]


class Manual(EndToEnd):
    def setUp(self):
        super().setUp()
        self.succeed("manual", self.folder / "man1")
        source = pathlib.Path(os.environ["STICKSLIP_SOURCE_DIR"], "daemon/stickslipd.8.in")
        text = source.read_text().replace("@PROJECT_VERSION@", "0").replace("@BUILD_DATE@", "2026-01-01")
        self.daemon = self.write("stickslipd.8", text)
        self.pages = {page.stem: page for page in [*(self.folder / "man1").iterdir(), self.daemon]}

    def commands(self):
        text = self.succeed("--help").stdout.split("Subcommands:")[1]
        return re.findall(r"^  ([a-z]+) ", text, re.MULTILINE)

    def test_there_is_one_page_per_command(self):
        self.assertGreater(len(self.commands()), 10)
        self.assertEqual(set(self.pages),
                         {"stickslip", "stickslipd", *(f"stickslip-{each}" for each in self.commands())})

    def test_every_page_has_its_sections(self):
        for name, page in self.pages.items():
            with self.subTest(page=name):
                found = re.findall(r"^\.SH (.*)$", page.read_text(), re.MULTILINE)
                for section in SECTIONS:
                    self.assertIn(section, found)

    def test_every_option_is_on_the_page(self):
        for command in self.commands():
            with self.subTest(command=command):
                page = self.pages[f"stickslip-{command}"].read_text().replace("\\-", "-")
                for option in re.findall(r"^  (?:-\w,)?(--[a-z-]+)", self.succeed(command, "--help").stdout,
                                         re.MULTILINE):
                    self.assertIn(option, page)

    def test_the_page_of_the_daemon_has_the_options_of_its_help(self):
        in_help = set(re.findall(r"(--[a-z-]+)", run(STICKSLIPD, "--help").stdout))
        section = self.daemon.read_text().replace("\\-", "-").split(".SH OPTIONS")[1].split(".SH ")[0]
        self.assertEqual(set(re.findall(r"(--[a-z-]+)", section)), in_help)

    def test_referenced_pages_exist(self):
        for name, page in self.pages.items():
            for other in re.findall(r"\\fB(stickslip[a-z\\-]*)\\fR\([18]\)", page.read_text()):
                with self.subTest(page=name, names=other):
                    self.assertIn(other.replace("\\-", "-"), self.pages)

    @unittest.skipUnless(shutil.which("mandoc"), "mandoc is not installed")
    def test_mandoc_reports_nothing(self):
        for name, page in self.pages.items():
            with self.subTest(page=name):
                result = run("mandoc", "-T", "lint", "-W", "warning", page)
                self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "", ""))

    def test_the_build_contains_the_same_pages(self):
        built = pathlib.Path(STICKSLIP).parents[1] / "tools/man"
        if not built.is_dir():
            self.skipTest("the manual is not built")
        undated = lambda page: page.read_text().split("\n", 2)[2]
        for name, page in self.pages.items():
            if page == self.daemon:
                continue
            with self.subTest(page=name):
                self.assertEqual(undated(built / "man1" / page.name), undated(page))


if __name__ == "__main__":
    main()
