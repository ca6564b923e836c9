# SPDX-License-Identifier: Apache-2.0
"""A program at a pseudo terminal."""
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time

from programs import PATIENCE_S


class OnATerminal:
    """A program whose standard error (and output, unless `piped`) is a pseudo terminal, and its input if
    `typing`."""

    def __init__(self, *command, columns=80, lines=24, piped=False, typing=False, **options):
        self.terminal, inside = pty.openpty()
        fcntl.ioctl(inside, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        self.process = subprocess.Popen(
            [str(part) for part in command], stdin=inside if typing else subprocess.DEVNULL, stderr=inside,
            stdout=subprocess.PIPE if piped else inside, start_new_session=typing, **options)
        os.close(inside)
        self.shown = ""
        self.began = time.monotonic()
        self.first_s = None  # time of its first output since its start
        self.took_s = None

    def read(self, seconds):
        """Reads for this duration; False once the program has closed the terminal."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            if not select.select([self.terminal], [], [], left)[0]:
                return True
            try:
                self.shown += os.read(self.terminal, 65536).decode(errors="replace")
            except OSError:  # the other end is closed
                return False
            self.first_s = self.first_s or time.monotonic() - self.began
        return True

    def wait_for(self, pattern, seconds=PATIENCE_S):
        until = time.monotonic() + seconds
        while not re.search(pattern, self.shown):
            assert time.monotonic() < until, f"{pattern} was not shown: {self.shown!r}"
            assert self.read(0.1) or re.search(pattern, self.shown), \
                f"{pattern} was not shown: {self.shown!r}"

    def type(self, text):
        os.write(self.terminal, text.encode())

    def end(self, seconds=PATIENCE_S):
        """The whole output, once the program has ended."""
        until = time.monotonic() + seconds
        while self.read(0.2):
            assert time.monotonic() < until, self.shown
        self.process.wait(seconds)
        self.took_s = time.monotonic() - self.began
        if self.process.stdout:
            self.process.stdout.close()
        os.close(self.terminal)
        return self.shown
