# SPDX-License-Identifier: Apache-2.0
"""The programs under test, run as a user would.

ctest sets the environment: STICKSLIP and STICKSLIPD (the programs), STICKSLIP_SOURCE_DIR (the
checkout), LCM_GEN. STICKSLIP_SHARED may name a folder with recordings from other sources.
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

STICKSLIP = os.environ.get("STICKSLIP", "stickslip")
STICKSLIPD = os.environ.get("STICKSLIPD", "stickslipd")
SOURCE = pathlib.Path(os.environ.get("STICKSLIP_SOURCE_DIR", pathlib.Path(__file__).parents[2]))
#: Limit of every wait [s]: for what never ends, since a busy machine is no failure.
PATIENCE_S = 1200
SKIPPED = 77  # exit status that ctest takes as "skipped"


def shared_folder():
    """The folder with recordings from other sources, or None."""
    for folder in (os.environ.get("STICKSLIP_SHARED"), SOURCE.parent / "shared"):
        if folder and (pathlib.Path(folder) / "recordings").is_dir():
            return pathlib.Path(folder)
    return None


def run(*command, timeout=PATIENCE_S, cwd=None, env=None):
    """Runs a command to its end; the result has returncode, stdout and stderr as text."""
    return subprocess.run([str(part) for part in command], capture_output=True, text=True,
                          timeout=timeout, cwd=cwd, env=env, stdin=subprocess.DEVNULL)


def as_other_user():
    """Prefix that runs a command as another user without privileges; empty if that is not possible, as
    in a user namespace, in which no other user exists."""
    command = ("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups")
    return command if run(*command, "true").returncode == 0 else ()


def stickslip(*arguments, **options):
    return run(STICKSLIP, *arguments, **options)


def read_json(path):
    """A JSON file, strictly: without NaN and Infinity."""
    def refuse(word):
        raise ValueError(f"{path} holds {word}, which is not JSON")
    return json.loads(pathlib.Path(path).read_text(), parse_constant=refuse)


#: Decorator of tests that need `stickslip scope` to serve.
needs_page = unittest.skipIf(os.environ.get("STICKSLIP_PAGE_PROBLEM"),
                             "the live view has no page: " + os.environ.get("STICKSLIP_PAGE_PROBLEM", ""))


def temporary_folder(add_cleanup):
    """A folder until the test or the class ends whose `addCleanup` or `addClassCleanup` is given."""
    folder = tempfile.TemporaryDirectory(prefix="stickslip-")
    add_cleanup(folder.cleanup)
    return pathlib.Path(folder.name)


class EndToEnd(unittest.TestCase):
    """A test with a temporary folder, `self.folder`."""
    longMessage = True
    maxDiff = None

    def setUp(self):
        self.folder = temporary_folder(self.addCleanup)

    def write(self, name, text):
        path = self.folder / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    def succeed(self, *arguments, **options):
        """`stickslip ...` that has to succeed."""
        result = stickslip(*arguments, **options)
        self.assertEqual(result.returncode, 0,
                         f"stickslip {' '.join(map(str, arguments))}\n{result.stdout}{result.stderr}")
        return result

    def expect_to_fit(self, shown, command=("",)):
        """A page of text for a terminal of 60 columns, without control sequences. What cannot be broken is
        longer: a command to copy, on a line that begins with "$ ", and in the page of `config`, which is
        TOML, a key with its value."""
        plain = re.sub(r"\033\[[0-9;]*[A-Za-z]", "", shown).replace("\r\n", "\n")
        whole = re.compile(r"(# )?[a-z_0-9.]+ = \S+" if command[0] == "config" else r" *\$ ")
        for line in plain.splitlines():
            if not whole.match(line):
                self.assertLessEqual(len(line), 60, f"{command}: {line!r}")
        self.assertNotRegex(plain, r"(?<![\w.:-])1 (?!(is|s|was|has|as)\b)[a-z-]+s\b")
        self.assertNotRegex(plain, r"(?<![\w.])-0(\.0*)?(?![\w.])")
        return plain


def main():
    """Runs the tests of the calling script. If all are skipped, ctest counts the script as skipped; the
    reason is on the last line."""
    program = unittest.main(exit=False, verbosity=2)
    result = program.result
    if not result.wasSuccessful():
        sys.exit(1)
    if result.testsRun == 0 or len(result.skipped) == result.testsRun:
        reasons = sorted({reason for _, reason in result.skipped})
        print("skipped: " + ("; ".join(reasons) or "no test"), flush=True)
        sys.exit(SKIPPED)
