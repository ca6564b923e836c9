# SPDX-License-Identifier: Apache-2.0
"""docs/tutorial.md, line by line: every command is run in a scratch folder and prints what the page shows,
its numbers within TOLERANCE."""
import os
import pathlib
import re
import subprocess
import time

from programs import PATIENCE_S, SOURCE, STICKSLIP, EndToEnd, main

PAGE = SOURCE / "docs/tutorial.md"
TOLERANCE = 0.1  # of a number that the page shows, relative: other compilers round differently
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
LEFT_OUT = "..."
ENDED = "-- ended with status "


def steps(page):
    """(command, lines that it prints) of every block ```console of the page."""
    found = []
    for block in re.findall(r"^```console\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ "):
                found.append((line[2:], []))
            elif found[-1][0].endswith("\\"):
                found[-1] = (found[-1][0][:-1] + line, [])
            else:
                found[-1][1].append(line)
    return found


def pieces(lines):
    """The parts between those that the page leaves out, as words, however lines are broken."""
    out = [[]]
    for line in lines:
        if line.strip() == LEFT_OUT:
            out.append([])
        else:
            out[-1].extend(line.split())
    return [piece for piece in out if piece]


def alike(shown, printed):
    """True if both words are the same but for numbers within the tolerance."""
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return False
    return all(abs(float(a) - float(b)) <= TOLERANCE * abs(float(a))
               for a, b in zip(NUMBER.findall(shown), NUMBER.findall(printed)))


def place(piece, words, begin):
    """Index behind the first place of the piece in the words; None if it is not there."""
    for at in range(begin, len(words) - len(piece) + 1):
        if all(map(alike, piece, words[at:])):
            return at + len(piece)
    return None


class Tutorial(EndToEnd):
    def run_in_one_shell(self, commands):
        """(status, output) of each command, all in one shell in the folder of the test."""
        (self.folder / "build/release").mkdir(parents=True)
        (self.folder / "build/release/bin").symlink_to(pathlib.Path(STICKSLIP).resolve().parent)
        (self.folder / "docs").symlink_to(SOURCE / "docs")
        script = "".join(f"{command}\necho '{ENDED}'$?\n" for command in commands)
        shell = subprocess.run(["bash", "-c", script], cwd=self.folder, text=True, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, timeout=PATIENCE_S,
                               env={**os.environ, "COLUMNS": "100"})
        parts = re.split(rf"{ENDED}(\d+)\n", shell.stdout)
        return list(zip(map(int, parts[1::2]), parts[0::2]))

    def test_every_command_prints_what_the_page_shows(self):
        expected = steps(PAGE.read_text())
        self.assertGreater(len(expected), 10)
        began = time.monotonic()
        results = self.run_in_one_shell([command for command, _ in expected])
        print(f"{len(expected)} commands in {time.monotonic() - began:.1f} s")
        self.assertEqual(len(results), len(expected))
        for (command, lines), (status, output) in zip(expected, results):
            with self.subTest(command):
                refused = bool(lines) and lines[0].startswith("stickslip: ")
                self.assertEqual(status, 2 if refused else 0, output)
                at, words = 0, output.split()
                for piece in pieces(lines):
                    begin, at = at, place(piece, words, at)
                    self.assertIsNotNone(at, f"not printed: {' '.join(piece)}\nprinted: {output}")
                    if begin == 0 and lines[0].strip() != LEFT_OUT:
                        self.assertEqual(at, len(piece), f"more is printed before it: {output}")
                if LEFT_OUT not in (line.strip() for line in lines[-1:]):
                    self.assertEqual(at, len(words), f"more is printed: {output}")

    def test_every_listing_is_tested(self):
        listings = re.findall(r"^```(\w*)\n.*?^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
        self.assertEqual(set(listings), {"console"})
        outside = re.sub(r"^```.*?^```$", "", PAGE.read_text(), flags=re.MULTILINE | re.DOTALL)
        self.assertNotRegex(outside, r"(?m)^    \S")

    def test_the_readme_shows_the_same_answer(self):
        readme = (SOURCE / "README.md").read_text()
        self.assertLessEqual(len(readme.splitlines()), 120)
        answer = re.search(r"(?m)(?:^    .*\n)+", readme[readme.index("    MISSING PHYSICS"):])[0]
        page = [line.strip() for line in PAGE.read_text().splitlines()]
        for line in answer.splitlines():
            self.assertIn(line.strip(), page)

    def test_numbers_are_compared_within_the_tolerance(self):
        for shown, printed in (("20.4", "20.5"), ("(95", "(95"), ("-3.2,", "-3.21,"), ("1e-05", "1.02e-05")):
            self.assertTrue(alike(shown, printed), (shown, printed))
        for shown, printed in (("20.4", "22.6"), ("20.4", "20.4,"), ("-3.2", "3.2"), ("force", "forces")):
            self.assertFalse(alike(shown, printed), (shown, printed))


if __name__ == "__main__":
    main()
