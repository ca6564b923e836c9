# SPDX-License-Identifier: Apache-2.0
"""Completion in the shells themselves: bash always, zsh and fish where they are installed."""
import os
import pty
import re
import select
import shlex
import shutil
import time

from programs import PATIENCE_S, EndToEnd, main, run, stickslip


class Completion(EndToEnd):
    def setUp(self):
        super().setUp()
        self.scripts = {shell: self.succeed("completion", shell).stdout
                        for shell in ("bash", "zsh", "fish")}
        self.write("model.toml", "")
        self.write("my recording.csv", "")

    def bash(self, *words):
        """Completions in bash of the last of `words`, after `stickslip`."""
        split = [part for word in words for part in (re.split("(=)", word) if word[:2] == "--" else [word])]
        line = " ".join(shlex.quote(word) for word in ("stickslip", *split))
        script = (f"{self.scripts['bash']}\nCOMP_WORDS=({line}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))\n"
                  "_stickslip\nprintf '%s\\n' \"${COMPREPLY[@]}\"\ncomplete -p stickslip >&2\n")
        result = run("bash", "--norc", "-c", script, cwd=self.folder)
        self.assertEqual(result.stderr, "complete -F _stickslip stickslip\n")
        return result.stdout.split("\n")[:-1]

    def commands(self):
        """Commands listed by --help."""
        text = self.succeed("--help").stdout.split("Subcommands:")[1]
        return re.findall(r"^  ([a-z]+) ", text, re.MULTILINE)

    def test_bash_offers_every_command(self):
        self.assertGreater(len(self.commands()), 10)
        self.assertEqual(sorted(self.bash("")), sorted(self.commands()))
        self.assertEqual(sorted(self.bash("di")), ["diagnose"])

    def test_bash_offers_every_option_of_a_command(self):
        for command in self.commands():
            with self.subTest(command=command):
                text = self.succeed(command, "--help").stdout
                listed = re.findall(r"^  (?:-\w,)?(--[a-z-]+)", text, re.MULTILINE)
                self.assertEqual(set(self.bash(command, "--")), set(listed))

    def test_bash_offers_the_choices_of_an_option(self):
        self.assertEqual(self.bash("convert", "a.csv", "b", "--format", ""), ["csv", "lcm"])
        self.assertEqual(self.bash("convert", "--format=l"), ["lcm"])
        self.assertEqual(self.bash("convert", "--format="), ["csv", "lcm"])
        self.assertEqual(self.bash("completion", ""), ["bash", "zsh", "fish"])
        self.assertIn("excitation.carrier_hz",
                      self.bash("config", "rig.toml", "--explain", "excitation."))

    def test_bash_offers_files_for_file_arguments(self):
        self.assertEqual(self.bash("diagnose", "m"), ["model.toml", "my recording.csv"])
        self.assertEqual(self.bash("diagnose", "--model", "mo"), ["model.toml"])
        self.assertEqual(self.bash("diagnose", "--model=mo"), ["model.toml"])

    def test_bash_offers_nothing_for_a_number(self):
        self.assertEqual(self.bash("diagnose", "--jobs", "m"), [""])

    def test_a_value_is_not_taken_for_a_command(self):
        self.assertIn("--json", self.bash("diagnose", "--model", "spy", "--"))

    def test_zsh(self):
        zsh = shutil.which("zsh")
        if zsh is None:
            self.check_words("zsh")
            return
        script = self.write("_stickslip", self.scripts["zsh"])
        self.assertEqual(run(zsh, "-n", script).stderr, "")
        # A shell on a terminal; two tabs request the completions.
        shown = self.shell_output(
            [zsh, "-f"], ["PS1='> '; unsetopt zle_bracketed_paste; LISTMAX=1000; autoload -Uz compinit; "
                          "compinit -D -u; source ./_stickslip; echo rea''dy\n"], "stickslip convert --format \t\t")
        self.assertRegex(shown, r"csv\s+lcm")

    def test_fish(self):
        fish = shutil.which("fish")
        if fish is None:
            self.check_words("fish")
            return
        script = self.write("stickslip.fish", self.scripts["fish"])
        self.assertEqual(run(fish, "--no-execute", script).stderr, "")

        def offered(line):
            result = run(fish, "--no-config", "-c",
                         f"source {script}; complete -C {shlex.quote(line)}", cwd=self.folder)
            self.assertEqual(result.stderr, "")
            return [each.split("\t")[0] for each in result.stdout.splitlines()]

        self.assertEqual(sorted(offered("stickslip ")), sorted(self.commands()))
        self.assertEqual(offered("stickslip convert --format "), ["csv", "lcm"])
        self.assertEqual(offered("stickslip diagnose --model mo"), ["model.toml"])
        self.assertIn("--write-model", offered("stickslip diagnose --w"))
        self.assertEqual(offered("stickslip completion "), ["bash", "fish", "zsh"])

    def check_words(self, shell):
        """Checks a script without its shell: quotes are balanced, and every command occurs."""
        words = shlex.split(self.scripts[shell], comments=True)
        for command in self.commands():
            self.assertTrue(any(word == command or word.startswith(command + ":") for word in words),
                            command)

    def shell_output(self, command, setup, typed):
        """Output of a shell on a pseudo terminal after `typed`."""
        pid, terminal = pty.fork()
        if pid == 0:
            os.chdir(self.folder)
            os.execvpe(command[0], command, {**os.environ, "TERM": "dumb", "HOME": str(self.folder)})
        self.addCleanup(os.waitpid, pid, 0)
        self.addCleanup(os.close, terminal)
        shown = ""

        def read_until(pattern):
            nonlocal shown
            until = time.monotonic() + PATIENCE_S
            while not re.search(pattern, shown):
                self.assertLess(time.monotonic(), until, shown)
                if select.select([terminal], [], [], 0.1)[0]:
                    shown += os.read(terminal, 65536).decode(errors="replace")

        for line in setup:
            os.write(terminal, line.encode())
        read_until(r"\bready\r?\n")
        shown = ""
        os.write(terminal, typed.encode())
        read_until(r"lcm")
        return shown

    def test_other_shells_are_refused(self):
        result = stickslip("completion", "tcsh")
        self.assertEqual(result.returncode, 2)
        self.assertIn("expected one of bash,zsh,fish", result.stderr)


if __name__ == "__main__":
    main()
