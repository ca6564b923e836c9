# SPDX-License-Identifier: Apache-2.0
"""The table of rooms in docs/architecture.md, held against the build and the sources.

Every target that compiles a file of a room is probed with its own compile command: it must find the
headers of the rooms that the table allows, their dependencies included, and no others. Includes are
compared with the table directly. Include roots do not hide system headers (LCM, TOML, threads,
clocks): these are looked for in the text.

Usage: rooms.py SOURCE_FOLDER BUILD_FOLDER
"""
import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

SOURCE, BUILD = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
TABLE = SOURCE / "docs/architecture.md"

# The last column of the table in words, and the system headers that each phrase rules out.
# <cstdio> is for numbers in text (snprintf); calls that read or write are searched for by name.
FORBIDDEN = {
    "do I/O": r"fstream|iostream|filesystem|unistd\.h|fcntl\.h|sys/(?!time).*|spdlog/.*",
    "start threads": r"thread|mutex|condition_variable|future|pthread\.h",
    "read a clock": r"chrono|ctime|time\.h|sys/time\.h",
    "LCM": r"lcm/.*",
    "TOML": r"toml(\+\+|plusplus)?.*",
    "JSON": r"nlohmann/.*",
    "devices": r"libusb.*|hidapi.*|modbus.*|gpiod.*",
    "a command line": r"CLI/.*",
}
# Folders of drivers/ that hold no device: parts that devices share, and what makes the configured ones.
SHARED_BY_DRIVERS = {"clock", "labjack", "serial", "usb"}
ASSEMBLY_OF_DRIVERS = "factory"
INPUT_OUTPUT_CALLS = re.compile(r"\b(printf|fprintf|puts|fputs|fopen|getenv)\(")


class Room:
    def __init__(self, name, may_use, must_not):
        self.name, self.may_use, self.must_not = name, may_use, must_not


def cells_of(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def rooms_in(text):
    """The rooms of the table, by name without the trailing slash."""
    rows = [cells_of(line) for line in text.splitlines() if re.match(r"\| `[a-z_/]+/` \|", line)]
    names = [re.findall(r"`([^`]+)/`", row[0])[0] for row in rows]
    rooms = {}
    for name, (_, _, may_use, must_not) in zip(names, rows):
        listed = set(re.findall(r"`([^`]+)/`", may_use))
        uses = set(names) - {name} - listed if may_use.startswith("all but") else listed
        phrases = [phrase for phrase in FORBIDDEN if re.search(rf"(?<!\w){re.escape(phrase)}(?!\w)", must_not)]
        rooms[name] = Room(name, uses, phrases)
        rooms[name].all_but = may_use.startswith("all but")
        rooms[name].words = must_not
    return rooms


ROOMS = rooms_in(TABLE.read_text())


def reachable_from(name):
    """The rooms whose headers a target of this room can include: what it uses, and what that uses."""
    found, todo = set(), [name]
    while todo:
        room = todo.pop()
        if room not in found:
            found.add(room)
            todo += ROOMS[room].may_use
    return found


def room_of(path):
    """The innermost room that holds this path (relative to the checkout)."""
    for name in sorted(ROOMS, key=len, reverse=True):
        if path.as_posix().startswith(name + "/"):
            return name
    return None


def files_of(room, *suffixes):
    return sorted(path for path in (SOURCE / room).rglob("*")
                  if path.suffix in suffixes and room_of(path.relative_to(SOURCE)) == room)


def includes_of(path):
    return re.findall(r'^\s*#\s*include\s*[<"]([^">]+)[">]', path.read_text(), re.MULTILINE)


def header_of(room):
    headers = files_of(room, ".h")
    return headers[0].relative_to(SOURCE).as_posix() if headers else None


def targets():
    """One compile command of each target that compiles a file of a room: (target, room) -> entry."""
    found = {}
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        try:
            room = room_of(pathlib.Path(entry["file"]).relative_to(SOURCE))
        except ValueError:
            continue  # generated or third-party
        if room:
            target = re.search(r"CMakeFiles/([^/]+)\.dir/", entry["command"])[1]
            found.setdefault((target, room), entry)
    return found


TARGETS = targets()


def headers_found(entry):
    """The rooms of which this compile command finds a header."""
    arguments = shlex.split(entry["command"])
    for option in ("-o", "-c", "-MF", "-MT", "-MQ"):
        while option in arguments:
            at = arguments.index(option)
            del arguments[at:at + 2]
    arguments = [a for a in arguments if a not in ("-MD", "-MMD") and not a.endswith("ccache")]
    with tempfile.TemporaryDirectory() as folder:
        probe = pathlib.Path(folder) / "probe.cpp"
        probe.write_text("".join(f'#if __has_include("{header_of(room)}")\nfound {room}\n#endif\n'
                                 for room in ROOMS if header_of(room)))
        run = subprocess.run([*arguments, "-E", "-P", str(probe)], cwd=entry["directory"],
                             capture_output=True, text=True)
    if run.returncode != 0:
        raise AssertionError(f"the probe of {entry['file']} did not preprocess:\n{run.stderr}")
    return set(re.findall(r"^found (\S+)$", run.stdout, re.MULTILINE))


class Rooms(unittest.TestCase):
    def test_the_table_has_every_folder_of_the_build_and_no_other(self):
        self.assertGreater(len(ROOMS), 20)
        folders = {path.parent.relative_to(SOURCE).as_posix() for top in ("physics", "protocol", "config",
                   "observer", "diagnosis", "drivers", "daemon", "tools")
                   for path in (SOURCE / top).rglob("CMakeLists.txt")} - {"tools"}
        self.assertEqual(folders, set(ROOMS))

    def test_the_table_rules_out_what_its_words_say(self):
        for room in ROOMS.values():
            rest = room.words
            for phrase in room.must_not:
                rest = rest.replace(phrase, "")
            with self.subTest(room=room.name):
                self.assertEqual(re.sub(r"\b(know|or)\b|[, ]", "", rest), "")

    def test_no_arrow_leads_back(self):
        for name, room in ROOMS.items():
            for used in room.may_use:
                with self.subTest(room=name, uses=used):
                    self.assertNotIn(name, reachable_from(used))

    def test_a_target_finds_the_headers_of_its_rooms_and_no_others(self):
        self.assertEqual({room for _, room in TARGETS} | {"tools/files", "tools/python"}, set(ROOMS))
        for (target, room), entry in sorted(TARGETS.items()):
            allowed = reachable_from(room)
            found = headers_found(entry)
            with self.subTest(target=target, room=room):
                self.assertEqual(found - allowed, set(), "finds what the table forbids")
                self.assertIn(room, found | {r for r in [room] if header_of(r) is None})

    def test_includes_are_those_of_the_table(self):
        for name, room in ROOMS.items():
            used = set()
            for path in files_of(name, ".h", ".cpp"):
                for header in includes_of(path):
                    other = room_of(pathlib.PurePath(header))
                    if other and other != name:
                        used.add(other)
                        with self.subTest(file=str(path.relative_to(SOURCE)), includes=header):
                            self.assertIn(other, room.may_use)
            if not room.all_but:
                with self.subTest(room=name):
                    self.assertEqual(room.may_use - used, set(), "allowed, but not used")

    def test_no_room_knows_what_it_must_not(self):
        for name, room in ROOMS.items():
            for path in files_of(name, ".h", ".cpp"):
                for header in includes_of(path):
                    for phrase in room.must_not:
                        with self.subTest(file=str(path.relative_to(SOURCE)), includes=header):
                            self.assertIsNone(re.fullmatch(FORBIDDEN[phrase], header),
                                              f"{name} must not {phrase}")

    def test_rooms_without_input_or_output_call_none(self):
        self.assertIsNotNone(INPUT_OUTPUT_CALLS.search('std::fprintf(stderr, "x")'))
        for name, room in ROOMS.items():
            if "do I/O" not in room.must_not:
                continue
            for path in files_of(name, ".h", ".cpp"):
                for number, line in enumerate(path.read_text().splitlines(), 1):
                    with self.subTest(file=str(path.relative_to(SOURCE)), line=number):
                        self.assertIsNone(INPUT_OUTPUT_CALLS.search(line.split("//")[0]), line)

    def test_files_do_not_include_each_other_in_a_circle(self):
        uses = {path.relative_to(SOURCE).as_posix(): includes_of(path)
                for name in ROOMS for path in files_of(name, ".h", ".cpp")}
        finished = set()

        def visit(node, path):
            self.assertNotIn(node, path, " -> ".join([*path, node]))
            if node not in finished:
                for other in uses.get(node, ()):
                    visit(other, [*path, node])
                finished.add(node)

        for node in uses:
            visit(node, [])

    def test_drivers_do_not_know_each_other(self):
        folders = {path.name for path in (SOURCE / "drivers").iterdir() if path.is_dir()}
        self.assertTrue(SHARED_BY_DRIVERS | {ASSEMBLY_OF_DRIVERS} < folders)
        for folder in folders - {ASSEMBLY_OF_DRIVERS}:
            allowed = {folder} | SHARED_BY_DRIVERS
            for path in [*(SOURCE / "drivers" / folder).rglob("*.h"), *(SOURCE / "drivers" / folder).rglob("*.cpp")]:
                used = {match[1] for header in includes_of(path) if (match := re.match(r"drivers/(\w+)/", header))}
                with self.subTest(file=str(path.relative_to(SOURCE))):
                    self.assertEqual(used - allowed, set())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
