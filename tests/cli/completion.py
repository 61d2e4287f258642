#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests completions in the real bash, zsh and fish, and the manual pages with man and mandoc.

Usage: completion.py PROGRAM SOURCE_DIR. A shell or a tool that is not installed is skipped by name. In bash and zsh the
line is typed on a pseudo-terminal. A function in the program's place prints the words that the shell inserted.
"""
import os
import pathlib
import pty
import re
import select
import shutil
import subprocess
import time
import unittest

from program import PROGRAM, Case, main, redag

PRINTER = r"""redag() { printf '<%s>' "$@"; printf 'E%s\n' ND; }"""
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


class Shell:
    """The tests of each shell. `complete(line)` returns the words that the shell offers."""

    def test_commands(self):
        commands = listed()
        self.assertGreater(len(commands), 15)
        self.assertEqual(set(self.complete("")), commands)
        self.assertEqual(self.complete("sim"), ["simulate"])
        self.assertEqual(set(self.complete("experiment ")), listed("experiment"))
        self.assertEqual(self.complete("experiment mer"), ["merge"])

    def test_options(self):
        for command in (["simulate"], ["analyze"], ["experiment", "acceptance"], ["top"]):
            long_options = {name for name in options_of(*command) if name.startswith("--")}
            self.assertGreater(len(long_options), 5, command)
            self.assertEqual({self.bare(word) for word in self.complete(" ".join(command) + " --")}, long_options, command)

    def test_values(self):
        policies = ["rate_monotonic", "deadline_monotonic", "fixed", "edf", "fifo", "chain_aware"]
        self.assertEqual(sorted(self.complete("simulate w.yaml --policy ")), sorted(policies))
        self.assertEqual([self.bare(word) for word in self.complete("simulate w.yaml --policy=ed")], ["edf"])
        self.assertEqual(self.complete("generate --shape er"), ["erdos_renyi"])
        self.assertIn("mte-fifo", self.complete("run w.yaml --executor "))
        self.assertNotIn("mte-fifo", self.complete("simulate w.yaml --executor "))
        self.assertEqual(sorted(self.complete("completion ")), ["bash", "fish", "zsh"])

    def test_lists(self):
        self.assertIn("redag,mte", [word.rstrip(",") for word in self.complete("compare w.yaml --executors redag,mt")])

    def test_files(self):
        self.assertEqual(self.places("simulate "), ["a plan.yaml", "robot.yml", "runs"])
        self.assertEqual(self.places("simulate ro"), ["robot.yml"])
        self.assertEqual(self.places("validate robot.yml "), ["a plan.yaml", "robot.yml", "runs"])
        self.assertEqual(self.places("simulate robot.yml --out "), ["runs"])
        self.assertEqual(self.places("why runs/"), ["runs/events.jsonl"])
        self.assertEqual(self.places("report runs/"), ["runs/events.jsonl"])
        self.assertIn("notes.txt", self.places("calibrate --out "))

    def places(self, line):
        """Only some shells end the name of a folder with a slash."""
        return sorted(word.rstrip("/") for word in self.complete(line))

    def bare(self, word):
        return word.rstrip("=").split("=")[-1]

    def setUp(self):
        super().setUp()
        if not shutil.which(self.program):
            self.skipTest(f"{self.program} is not installed")
        self.place = self.folder / "place"
        (self.place / "runs").mkdir(parents=True)
        for name in "robot.yml", "a plan.yaml", "notes.txt", "runs/events.jsonl", "runs/jobs.csv":
            (self.place / name).touch()
        self.script = self.folder / "script"
        self.script.write_text(self.expect(redag("completion", self.program), 0).stdout)


class TypedShell(Shell):
    def complete(self, line):
        self.terminal.send(f"redag {line}{self.key}\n")
        words = re.findall(r"<([^>]*)>", re.search(r"([^\n]*)END\r", self.terminal.read_until("END\r"))[1])
        before = len(re.findall(r"\S+", line)) - (0 if line.endswith(" ") or not line else 1)
        return words[before:]

    def setUp(self):
        super().setUp()
        self.terminal = Terminal(self.command, self.place)
        self.addCleanup(self.terminal.close)
        for text in (*self.preparation, f"source {self.script}", PRINTER):
            self.terminal.send(text + "\n")
        self.terminal.send("printf 'RE%s\\n' ADY\n")
        self.terminal.read_until("READY")


class Bash(TypedShell, Case):
    program = "bash"
    command = ["bash", "--norc", "--noprofile", "-i"]
    preparation = ["bind 'set enable-bracketed-paste off'"]
    key = "\x1b*"  # inserts all possible completions

    def test_no_more_files_than_arguments(self):
        self.assertEqual(self.complete("simulate robot.yml "), [])


class Zsh(TypedShell, Case):
    program = "zsh"
    command = ["zsh", "-f", "-i"]
    preparation = ["unsetopt zle_bracketed_paste 2>/dev/null; unset zle_bracketed_paste; PS1='> '",
                   "autoload -U compinit && compinit -u -D", "zstyle ':completion:*' completer _all_matches _complete",
                   "zstyle ':completion:*' insert true"]
    key = "\t"


class Fish(Shell, Case):
    program = "fish"

    def complete(self, line):
        result = subprocess.run(["fish", "--no-config", "-c", f"source {self.script}; complete --do-complete $argv[1]",
                                 f"redag {line}"], cwd=self.place, capture_output=True, text=True, check=True,
                                env={**os.environ, "HOME": str(self.folder)})
        self.assertEqual(result.stderr, "")
        return [entry.split("\t")[0] for entry in result.stdout.splitlines()]


class Manual(Case):
    def pages(self):
        self.expect(redag("man", "--out", self.folder / "man1"), 0)
        return sorted((self.folder / "man1").iterdir())

    def test_every_command_has_a_page(self):
        names = {page.stem for page in self.pages()}
        inner = {f"redag-experiment-{command}" for command in listed("experiment")}
        self.assertEqual(names - inner - {"redag"}, {f"redag-{command}" for command in listed()})
        self.assertLess(inner, names)

    def test_pages_have_no_mistakes(self):
        tools = {"mandoc": ["mandoc", "-T", "lint", "-W", "warning"], "man": ["man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", "-Z"]}
        for name, command in tools.items():
            with self.subTest(name):
                if not shutil.which(name):
                    self.skipTest(f"{name} is not installed")
                for page in self.pages():
                    result = subprocess.run([*command, page], capture_output=True, text=True, check=False)
                    said = result.stderr + (result.stdout if name == "mandoc" else "")
                    self.assertEqual((result.returncode, said), (0, ""), page)

    def test_a_page_says_what_help_says(self):
        text = self.expect(redag("man", "experiment", "merge"), 0).stdout.replace("\\-", "-")
        for option in options_of("experiment", "merge"):
            self.assertIn(option, text)
        self.assertIn("redag experiment merge results/dags-1", text)
        self.expect(redag("man", "simualte"), 2, "did you mean 'simulate'?")
        self.expect(redag("man", "simulate", "--markdown"), 2, "--markdown")
        self.expect(redag("completion", "tcsh"), 2, "SHELL")

    def test_same_date_same_bytes(self):
        pages = [redag("man", "top", env={**os.environ, "SOURCE_DATE_EPOCH": "0"}).stdout for _ in range(2)]
        self.assertEqual(*pages)
        self.assertIn(" 1 1970-01-01 ", pages[0])


if __name__ == "__main__":
    main()
