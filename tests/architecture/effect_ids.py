# SPDX-License-Identifier: Apache-2.0
"""No effect id stands as a string outside physics/effects/: other rooms ask the effect.

Usage: effect_ids.py SOURCE_FOLDER

The ids are the names of the files in physics/effects/. Exempt are tests, documents, laws of friction,
some of which have the name of an effect and list those that they contain, and tools/concealment, whose
simulator shares no code with physics/ on purpose. Two kinds of words that
merely coincide with an id are recognised by what they belong to:
- a key of a configuration file, which config/ declares as `.path = "KEY"`, is exempt in config/;
- a folder none of whose files includes a model, an effect or the catalogue cannot refer to one.
"""
import pathlib
import re
import sys
import unittest

SOURCE = pathlib.Path(sys.argv[1]).resolve()

EXEMPT = ("physics/effects", "physics/laws", "tests", "docs", "tools/concealment", "build")
SUFFIXES = {".cpp", ".h", ".in", ".py", ".js", ".mjs", ".html"}
PHYSICS = re.compile(
    r'#\s*include\s*"physics/(?:model|effect|catalogue|rig|reading|simulator)\.h"')
STRING = re.compile(r'(["\'`])([a-z][a-z0-9_]*)\1')
KEY = re.compile(r'\.path\s*=\s*"([a-z0-9_]+)"')
COMMENT = re.compile(r"//.*")


def effect_ids():
    return {path.stem for path in (SOURCE / "physics/effects").glob("*.cpp")}


def sources():
    """Source files outside the exempt folders, relative to the checkout."""
    for path in sorted(SOURCE.rglob("*")):
        name = path.relative_to(SOURCE)
        hidden = any(part.startswith(".") for part in name.parts)
        exempt = any(name.as_posix().startswith(folder + "/") for folder in EXEMPT)
        if path.is_file() and path.suffix in SUFFIXES and not hidden and not exempt:
            yield name


def text_of(name):
    return (SOURCE / name).read_text(encoding="utf-8", errors="replace")


def mentions(name, words):
    """(line, word) for each of `words` that is a whole string literal of the file."""
    for number, line in enumerate(text_of(name).splitlines(), 1):
        if name.suffix in (".cpp", ".h"):
            line = COMMENT.sub("", line)
        for match in STRING.finditer(line):
            if match.group(2) in words:
                yield number, match.group(2)


class EffectIds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.ids = effect_ids()
        cls.files = list(sources())
        cls.folders = {}
        for name in cls.files:
            cls.folders[name.parent] = (cls.folders.get(name.parent, False)
                                        or PHYSICS.search(text_of(name)) is not None)
        cls.keys = set()
        for name in cls.files:
            if name.parts[0] == "config":
                cls.keys |= set(KEY.findall(text_of(name)))

    def test_there_are_effects_and_files(self):
        self.assertGreater(len(self.ids), 40)
        self.assertGreater(len(self.files), 100)

    def test_every_file_of_the_effects_defines_the_effect_of_its_name(self):
        for name in self.ids:
            text = text_of(f"physics/effects/{name}.cpp")
            with self.subTest(effect=name):
                self.assertIn(f"const Effect& {name}()", text)
                self.assertRegex(text, rf'\.id = "{name}"')

    def test_the_search_finds_an_id(self):
        found = list(mentions(pathlib.PurePath("physics/effects/stribeck.cpp"), self.ids))
        self.assertIn("stribeck", [word for _, word in found])

    def test_no_id_stands_outside_the_effects(self):
        for name in self.files:
            if not self.folders[name.parent]:
                continue
            words = self.ids - self.keys if name.parts[0] == "config" else self.ids
            for line, word in mentions(name, words):
                with self.subTest(file=str(name), line=line):
                    self.fail(f'"{word}" is the id of an effect: ask the effect instead')


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
