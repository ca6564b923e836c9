# SPDX-License-Identifier: Apache-2.0
"""The words of the project are those of the field (docs/glossary.md): tests/architecture/words.txt
lists those that are not, with what the field says. No comment opens with "what".

Usage: words.py SOURCE_FOLDER
"""
import pathlib
import re
import sys
import unittest

import checkout

SOURCE = pathlib.Path(sys.argv[1]).resolve()
LIST = "tests/architecture/words.txt"
OPENING = re.compile(r'(?:^\s*(?://+<?|#|\*|"""|<!--)|///<)\s*What\b', re.IGNORECASE)


def words():
    found = {}
    for line in (SOURCE / LIST).read_text().splitlines():
        if line and not line.startswith("#"):
            expression, instead = re.split(r"\s{2,}", line, maxsplit=1)
            found[expression] = instead
    return found


WORDS = words()
# A word ends where a letter of the other case, an underscore, a digit or anything else follows.
PATTERN = re.compile(r"(?<![A-Za-z])(?:" + "|".join(WORDS) + r")(?![a-z])", re.IGNORECASE)


def parts(line):
    """The line with the words of its identifiers set apart: DoubtedConstants, not_told_yet."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=\w)_(?=\w)", " ", line)


def findings(text):
    for number, line in enumerate(text.splitlines(), 1):
        for match in PATTERN.finditer(parts(line)):
            yield number, match[0], line.strip()
        if OPENING.search(line):
            yield number, "what", line.strip()


class Words(unittest.TestCase):
    def test_the_list_finds_what_it_lists(self):
        for text in ("struct DoubtedConstants {", "bool not_told_yet;", "// What a frame is.",
                     "bool is_strained() const", "to be had from"):
            with self.subTest(text=text):
                self.assertTrue(list(findings(text)))
        for text in ("strain gauges", "strain-gauge bridge", "constrained", "eyelet", "untold_", "in.tellg()"):
            with self.subTest(text=text):
                self.assertFalse(list(findings(text)))

    def test_every_word_is_one_of_the_field(self):
        for name in checkout.committed(SOURCE):
            if str(name).startswith(("tests/architecture/words", "tests/fuzz/seeds")):
                continue
            for number, word, line in findings(checkout.text_of(SOURCE / name)):
                with self.subTest(file=str(name), line=number):
                    self.fail(f'"{word}" is not a word of the field; see {LIST}: {line}')


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
