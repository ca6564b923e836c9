# SPDX-License-Identifier: Apache-2.0
"""The files of the checkout that a test reads."""
import pathlib
import subprocess


def committed(source):
    """Every file under version control, relative to the checkout; in an unpacked archive, every file
    outside the build folders."""
    listed = subprocess.run(["git", "-c", f"safe.directory={source}", "-C", str(source), "ls-files", "-z"],
                            capture_output=True)
    if listed.returncode == 0 and listed.stdout:
        names = [pathlib.PurePath(name) for name in listed.stdout.decode().split("\0") if name]
        return [name for name in names if (source / name).is_file()]
    return [path.relative_to(source) for path in source.rglob("*") if path.is_file()
            and not path.relative_to(source).parts[0].startswith(("build", ".git"))]


def text_of(path):
    """The content; nothing of a binary file."""
    try:
        return path.read_text()
    except UnicodeDecodeError:
        return ""
