"""The room table of docs/architecture.md, held against the build.

For every room a file that includes one header is preprocessed with the very command that compiles
that room. A header of a room that the table forbids must not be found; one that it allows must be.
What include roots cannot enforce (system headers: LCM, TOML, threads, clocks) is read from the text.

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

ROOMS = ["physics", "protocol", "config", "drivers", "daemon/observer", "daemon", "tools/parallel",
         "tools/diagnose", "tools/conceal", "tools/examine", "tools/dynamics", "tools/reduce",
         "tools/figures", "tools/doctor", "tools/export", "tools/calibrate", "tools/scope", "tools"]
# Room: the rooms that it may use, beside itself.
MAY_USE = {
    "physics": set(),
    "protocol": {"physics"},
    "config": {"physics"},
    "drivers": {"physics", "config"},
    "daemon/observer": {"physics"},
    "daemon": {"physics", "protocol", "config", "drivers", "daemon/observer"},
    "tools/parallel": set(),
    "tools/diagnose": {"physics", "protocol", "config", "daemon/observer", "tools/parallel"},
    "tools/conceal": {"physics", "protocol"},
    "tools/examine": {"physics", "protocol", "tools/conceal"},
    "tools/dynamics": {"physics", "tools/parallel"},
    "tools/reduce": {"physics", "protocol", "tools/parallel", "tools/diagnose"},
    "tools/figures": {"physics", "protocol", "config", "tools/parallel", "tools/diagnose",
                      "tools/dynamics", "tools/reduce"},
    "tools/doctor": {"physics", "protocol", "config"},
    "tools/calibrate": {"physics", "config"},
    "tools/export": {"physics", "protocol"},
    "tools/scope": {"physics", "protocol", "config"},
    "tools": {"physics", "protocol", "config", "drivers", "daemon/observer", "tools/parallel",
              "tools/diagnose",
              "tools/dynamics", "tools/reduce", "tools/figures", "tools/doctor", "tools/conceal", "tools/examine",
              "tools/export", "tools/calibrate", "tools/scope"},
}
# What the table allows and the build links today; a permission that is not used is no dependency.
MUST_FIND = {
    "protocol": {"physics"},
    "config": {"physics"},
    "drivers": {"physics", "config"},
    "daemon/observer": {"physics"},
    "daemon": {"physics", "protocol", "config", "drivers", "daemon/observer"},
    "tools/diagnose": {"physics", "protocol", "tools/parallel"},
    "tools/conceal": {"physics", "protocol"},
    "tools/examine": {"physics", "tools/conceal"},
    "tools/dynamics": {"physics", "tools/parallel"},
    "tools/reduce": {"physics", "protocol", "tools/diagnose"},
    "tools/figures": {"physics", "protocol", "config", "tools/parallel", "tools/dynamics",
                      "tools/reduce"},
    "tools/doctor": {"protocol", "config"},
    "tools/calibrate": {"physics", "config"},
    "tools/export": {"physics", "protocol"},
    "tools/scope": {"physics", "protocol"},
    "tools": {"physics", "protocol", "config", "tools/diagnose", "tools/dynamics", "tools/reduce",
              "tools/figures", "tools/doctor", "tools/conceal", "tools/examine", "tools/export", "tools/calibrate",
              "tools/scope"},
}
# Room: system headers that it must not include, and why.
LCM = r"lcm/.*"
TOML = r"toml(\+\+|plusplus)?.*"
# <cstdio> is for numbers in text (snprintf); what writes or reads is looked for by name below.
INPUT_OUTPUT = r"(fstream|iostream|filesystem|unistd\.h|fcntl\.h|sys/.*|spdlog/.*)"
INPUT_OUTPUT_CALLS = re.compile(r"\b(printf|fprintf|puts|fputs|fopen|getenv)\(")
THREADS = r"(thread|mutex|condition_variable|future|pthread\.h)"
CLOCK = r"(chrono|ctime|time\.h|sys/time\.h)"
MUST_NOT_KNOW = {
    "physics": [LCM, TOML, INPUT_OUTPUT, THREADS, CLOCK, r"nlohmann/.*", r"CLI/.*"],
    "protocol": [TOML, r"libusb.*", r"hidapi.*", r"modbus.*", r"gpiod.*"],
    "config": [LCM, r"libusb.*", r"hidapi.*", r"modbus.*", r"gpiod.*"],
    "drivers": [LCM, TOML, r"nlohmann/.*", r"CLI/.*"],
    "daemon/observer": [LCM, TOML, INPUT_OUTPUT, THREADS, CLOCK],
    # Its checks ask a Host, so that a test can answer for a machine.
    "tools/doctor": [TOML, THREADS, CLOCK, r"sys/.*", r"unistd\.h", r"fcntl\.h"],
}


def room_of(path):
    """The innermost room that this path (relative to the checkout) lies in."""
    for room in sorted(ROOMS, key=len, reverse=True):
        if path.as_posix().startswith(room + "/"):
            return room
    return None


def files_of(room, *suffixes):
    return sorted(path for path in (SOURCE / room).rglob("*")
                  if path.suffix in suffixes and room_of(path.relative_to(SOURCE)) == room)


def header_of(room):
    """A header that stands for its room: the one that needs least, so that nothing else decides."""
    headers = files_of(room, ".h")
    return min(headers, key=lambda path: (path.read_text().count("#include"), path)) \
        .relative_to(SOURCE).as_posix() if headers else None


def compile_commands():
    """By room, the command that compiles its first source file."""
    commands = {}
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        try:
            room = room_of(pathlib.Path(entry["file"]).relative_to(SOURCE))
        except ValueError:
            continue  # generated or foreign
        if room:
            commands.setdefault(room, entry)
    return commands


COMMANDS = compile_commands()


def preprocess(room, header):
    """Preprocesses a file that includes `header`, as a source file of `room`. (found, output)"""
    entry = COMMANDS[room]
    arguments = shlex.split(entry["command"])
    for option in ("-o", "-c", "-MF", "-MT", "-MQ"):
        while option in arguments:
            at = arguments.index(option)
            del arguments[at:at + 2]
    arguments = [a for a in arguments if a not in ("-MD", "-MMD")]
    with tempfile.TemporaryDirectory() as folder:
        probe = pathlib.Path(folder) / "probe.cpp"
        probe.write_text(f'#include "{header}"\n')
        run = subprocess.run([*arguments, "-M", "-MG", str(probe)], cwd=entry["directory"],
                             capture_output=True, text=True)
    # -MG: a header that is nowhere (or not yet generated) is listed as it was written.
    if run.returncode != 0:
        raise AssertionError(f"the probe of {room} did not preprocess:\n{run.stderr}")
    listed = run.stdout.replace("\\\n", " ").split()
    return header not in listed, run.stdout


class Rooms(unittest.TestCase):
    def test_every_room_is_compiled_and_has_a_header(self):
        for room in ROOMS:
            with self.subTest(room=room):
                self.assertTrue(files_of(room, ".h"), f"{room} holds no header")
                self.assertIn(room, COMMANDS, f"no source file of {room} is compiled")

    def test_a_room_finds_its_own_headers_and_those_it_is_built_on(self):
        for room in ROOMS:
            for used in sorted({room} | MUST_FIND.get(room, set())):
                with self.subTest(room=room, used=used):
                    found, output = preprocess(room, header_of(used))
                    self.assertTrue(found, f"{room} cannot include {header_of(used)}:\n{output}")

    def test_a_forbidden_include_does_not_compile(self):
        for room in ROOMS:
            for other in ROOMS:
                if other == room or other in MAY_USE[room]:
                    continue
                with self.subTest(room=room, other=other):
                    found, _ = preprocess(room, header_of(other))
                    self.assertFalse(found, f"{room} can include {header_of(other)}, "
                                            f"but the table forbids {other} to it")

    def test_no_room_knows_what_it_must_not(self):
        for room, forbidden in MUST_NOT_KNOW.items():
            for path in files_of(room, ".h", ".cpp"):
                for number, line in enumerate(path.read_text().splitlines(), 1):
                    included = re.match(r'\s*#\s*include\s*[<"]([^">]+)[">]', line)
                    if not included:
                        continue
                    for pattern in forbidden:
                        with self.subTest(file=str(path.relative_to(SOURCE)), line=number):
                            self.assertIsNone(re.fullmatch(pattern, included[1]),
                                              f"{room} must not know <{included[1]}>")

    def test_the_equations_neither_read_nor_write(self):
        self.assertIsNotNone(INPUT_OUTPUT_CALLS.search('std::fprintf(stderr, "x")'))
        for path in [*files_of("physics", ".h", ".cpp"), *files_of("daemon/observer", ".h", ".cpp")]:
            for number, line in enumerate(path.read_text().splitlines(), 1):
                with self.subTest(file=str(path.relative_to(SOURCE)), line=number):
                    self.assertIsNone(INPUT_OUTPUT_CALLS.search(line.split("//")[0]), line)

    def test_drivers_do_not_know_each_other(self):
        devices = [path for path in (SOURCE / "drivers").iterdir() if path.is_dir()]
        self.assertTrue(devices)
        for device in devices:
            for path in [*device.rglob("*.h"), *device.rglob("*.cpp")]:
                for other in devices:
                    if other == device:
                        continue
                    with self.subTest(file=str(path.relative_to(SOURCE)), other=other.name):
                        self.assertNotIn(f'"drivers/{other.name}/', path.read_text())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
