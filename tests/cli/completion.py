#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests the completion in the real bash.

Usage: completion.py PROGRAM SOURCE_DIR. Lines are typed on a pseudo-terminal. A program in redag's place prints the
words that the shell inserted.
"""
import os
import pty
import re
import select
import time
import unittest

from program import PROGRAM, SOURCE, Case, main, redag

PRINTER = r"""redag() { if [[ ${*: -1} == --help ]]; then command redag "$@"; return; fi; printf '<%s>' "$@"; printf 'E%s\n' ND; }"""
PATIENCE = 60  # s; a shell that says nothing for so long has failed


def listed(*command, heading="Commands:"):
    """Returns the names in a section of --help."""
    text = redag(*command, "--help").stdout.split(f"\n{heading}\n")[1].split("\n\n")[0]
    return set(re.findall(r"^  ([a-z][a-z-]*)", text, re.M))


def options_of(*command):
    text = redag(*command, "--help").stdout.split("\nExamples:")[0]
    return {name for line in re.findall(r"^  (-.*)", text, re.M)
            for name in re.findall(r"(?:^|, )(--?[a-z][a-z-]*)", line.split("  ")[0])}


class Terminal:
    """A shell on a pseudo-terminal."""

    def __init__(self, command, folder):
        try:
            self.pid, self.file = pty.fork()
        except OSError as error:
            raise unittest.SkipTest(f"no pseudo-terminal to be had here: {error}") from error
        if self.pid == 0:
            os.chdir(folder)
            os.environ.update(TERM="dumb", HOME=str(folder), PS1="> ", PATH=f"{PROGRAM.parent}:{os.environ['PATH']}")
            os.execvp(command[0], command)

    def send(self, text):
        os.write(self.file, text.encode())

    def read_until(self, end):
        text = ""
        deadline = time.monotonic() + PATIENCE
        while end not in text:
            ready, _, _ = select.select([self.file], [], [], max(0, deadline - time.monotonic()))
            if not ready:
                raise AssertionError(f"no {end!r} in {text!r}")
            text += os.read(self.file, 65536).decode(errors="replace")
        return text

    def close(self):
        os.close(self.file)
        os.waitpid(self.pid, 0)


class Bash(Case):
    def setUp(self):
        super().setUp()
        place = self.folder / "place"
        (place / "runs").mkdir(parents=True)
        (place / "robot.yaml").touch()
        self.terminal = Terminal(["bash", "--norc", "--noprofile", "-i"], place)
        self.addCleanup(self.terminal.close)
        for text in ("bind 'set enable-bracketed-paste off'", f"source {SOURCE / 'redag_lab' / 'share' / 'redag.bash'}",
                     PRINTER, "printf 'RE%s\\n' ADY"):
            self.terminal.send(text + "\n")
        self.terminal.read_until("READY")

    def complete(self, line):
        """Returns the words that the shell offers."""
        key = "\x1b*"  # inserts all possible completions
        self.terminal.send(f"redag {line}{key}\n")
        words = re.findall(r"<([^>]*)>", re.search(r"([^\n]*)END\r", self.terminal.read_until("END\r"))[1])
        before = len(re.findall(r"\S+", line)) - (0 if line.endswith(" ") or not line else 1)
        return words[before:]

    def test_commands(self):
        commands = listed()
        self.assertGreater(len(commands), 10)
        self.assertEqual(set(self.complete("")), commands)
        self.assertEqual(self.complete("sim"), ["simulate"])

    def test_options(self):
        for command in (["simulate"], ["analyze"], ["experiment"], ["top"]):
            long_options = {name for name in options_of(*command) if name.startswith("--")}
            self.assertGreater(len(long_options), 3, command)
            self.assertEqual(set(self.complete(" ".join(command) + " --")), long_options, command)
        self.assertEqual(self.complete("simulate robot.yaml --durat"), ["--duration"])

    def test_files(self):
        self.assertEqual(self.complete("simulate ro"), ["robot.yaml"])
        self.assertEqual(sorted(word.rstrip("/") for word in self.complete("why ")), ["robot.yaml", "runs"])


if __name__ == "__main__":
    main()
