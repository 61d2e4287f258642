#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests bad values: of every option that --help lists, of combinations of options, and in files.

The program must name the mistake by the option's name, or by file, line and column. It must exit with 2, write nothing,
and print no control characters to the terminal.

Usage: hostile.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import os
import re
import resource
import subprocess

from program import CART, PROGRAM, SANITIZED, Case, in_terminal, main, redag
from usage import COMMANDS

ESCAPE = "\x1b"
HUGE = "9" * 30
BAD = {
    "N": ["-1", "1.5", "x", "nan", HUGE, "0x1", "1e300", " 1"],
    "X": ["x", "nan", "inf", "-1", "1e300", "-inf"],
    "DURATION": ["5", "-1s", "x", "nan", "1e300s", HUGE + "h", "0.1ns"],
    "NAME": ["nonsense", ESCAPE + "[2J"],
    "RANGE": ["x", "-1", "nan", "1:0:1", HUGE],
    "LOW-HIGH": ["x", "5-2", "0-1", "1", "1-" + HUGE],
    "CPUS": ["x", "1-", "99999", "-1"],
    "i/n": ["0/3", "4/3", "1/0", "x", "1/" + HUGE],
}
FREE = set()  # options that accept any name
SEED = "--seed"
# A sanitized program takes half a second to start, and the options share their code: a few of them will do there.
STEP = 12 if SANITIZED else 1


def options_of(command):
    """Returns (name, type) of every option that takes a value."""
    text = redag(*command, "--help").stdout.split("Examples:")[0]
    return re.findall(r"^ +(?:-\w,)?(--[\w-]+) ([A-Zi][\w/.,-]*)(?=[ \n=])", text, re.MULTILINE)[::STEP]


class EveryOption(Case):
    """Tries the options that --help lists, which includes future ones."""

    def arguments(self, command):
        if command in (["generate"], ["doctor"], ["top"]):
            return []
        return [self.cart]

    def refuse(self, command, option, value):
        result = redag(*command, *self.arguments(command), f"{option}={value}")
        self.assertEqual(result.returncode, 2, (command, option, value, result.stdout, result.stderr))
        self.assertIn("error: ", result.stderr)
        self.assertNotIn(ESCAPE, result.stderr)
        self.assertLess(len(result.stderr), 2000)
        return result.stderr

    def test_empty_values(self):
        tried = 0
        for command in COMMANDS:
            for option, _ in options_of(command):
                self.assertIn(option, self.refuse(command, option, ""), (command, option))
                tried += 1
        self.assertGreater(tried, 100 / STEP)

    def test_bad_values(self):
        tried = 0
        for command in COMMANDS:
            for option, kind in options_of(command):
                if (" ".join(command), option) in FREE:
                    continue
                for value in BAD.get(kind, []):
                    said = self.refuse(command, option, value)
                    if option not in ("--executor", "--run-workload"):
                        self.assertIn(option, said, (command, option, value))
                    tried += 1
        self.assertGreater(tried, 400 / STEP)

    def test_limits_are_said(self):
        """Every number has a range, which the message states."""
        for command in COMMANDS:
            for option, kind in options_of(command):
                if kind in ("N", "X"):
                    pattern = r"below 2\^64" if option == SEED else r"number from \S+ to \S+"
                    self.assertRegex(self.refuse(command, option, "x"), pattern, (command, option))

    def test_flags_take_no_value(self):
        for command in COMMANDS:
            text = redag(*command, "--help").stdout.split("Examples:")[0]
            for flag in re.findall(r"^ +(--[\w-]+)  ", text, re.MULTILINE)[::STEP]:
                if flag not in ("--help", "--version"):
                    self.assertIn(f"{flag} takes no value", self.refuse(command, flag, "maybe"), command)


class Combinations(Case):
    def refuse(self, *arguments, says):
        out = self.folder / "out"
        result = self.expect(redag(*arguments), 2, says)
        self.assertFalse(out.exists(), "something was written")
        return result

    def test_numbers_that_mean_nothing(self):
        for command in ("simulate", "run", "compare", "analyze", "tune"):
            self.refuse(command, self.cart, "--workers", "0", says="--workers: '0' is not a whole number from 1 to 4096")
            self.refuse(command, self.cart, "--workers", "-1", says="--workers: '-1' is not a whole number from 1 to 4096")
        self.refuse("compare", self.cart, "--repeat", "0", says="--repeat: '0' is not a whole number from 1 to 10000")
        self.refuse("experiment", self.cart, "--out", self.folder / "out", "--jobs", "100000", says="--jobs: '100000' is not a whole number from 1 to 1024")
        self.refuse("compare", self.cart, "--simulate", "--repeat", "2", "--seed", str(2**64 - 1), says="last seed")
        self.refuse("tune", self.cart, "--seed", str(2**64 - 1), says="last seed")
        self.refuse("generate", "--period-min", "1h", "--period-max", "1s", says="period_min to period_max must be a range")

    def test_an_executor_with_a_mode_of_its_own(self):
        for command in ("simulate", "run"):
            self.refuse(command, self.cart, "--executor", "redag-none", "--preemption", "os", "--out", self.folder / "out",
                        says="--preemption os: executor 'redag-none' always runs with preemption none")
            self.refuse(command, self.cart, "--executor", "mte", "--preemption", "os", says="--preemption os: executor 'mte'")
            self.refuse(command, self.cart, "--executor", "mte", "--policy", "edf", says="--policy edf: executor 'mte'")
            self.refuse(command, self.cart, "--executor", "ste", "--workers", "2", says="--workers 2: executor 'ste' has only one worker")
            self.refuse(command, self.cart, "--executor", "redag-os", "--policy", "edf", "--out", self.folder / "out",
                        says="redag-os: preemption 'os' needs a static policy")
        self.refuse("analyze", self.cart, "--executor", "mte", "--policy", "edf", says="--policy edf: executor 'mte'")
        self.refuse("compare", self.cart, "--executors", "mte,redag-none", "--preemption", "os", says="--preemption os")
        # A value that at least one executor accepts is accepted.
        self.expect(redag("compare", self.cart, "--simulate", "--executors", "mte,redag", "--preemption", "os", "--duration", "1s"), 0)
        self.expect(redag("simulate", self.cart, "--executor", "redag-none", "--preemption", "none"), 0)

    def test_one_vocabulary_of_modes(self):
        """A mode that is printed can also be given."""
        for arguments in (["simulate", self.cart], ["analyze", self.cart], ["compare", self.cart, "--simulate", "--duration", "1s"]):
            for given in ("none", "cooperative", "os", "auto"):
                text = self.expect(redag(*arguments, "--preemption", given), 0).stdout
                for mode in re.findall(r"^preemption: (\w+)|: preemption (\w+)", text, re.MULTILINE):
                    self.assertIn("".join(mode), ("none", "cooperative", "os"), text)

    def test_options_that_would_be_ignored(self):
        self.refuse("compare", self.cart, "--executors", "redag", says="no other executor to compare 'redag' with")
        self.refuse("compare", self.cart, "--simulate", "--affinity", "0", says="excludes")
        self.refuse("compare", self.cart, "--overhead-release", "5us", says="--overhead-release requires --simulate")
        self.refuse("analyze", self.cart, "--sensitivity", "--executor", "ste", says="available for ReDAG-RT only")
        self.refuse("analyze", "--methods", "--explain", "a.x", says="FILE is required")
        self.refuse("top", "--list", "5", says="excludes")
        self.refuse("simulate", self.cart, "--duration", "1s", "--duration", "2s", says="--duration is given more than once")
        self.refuse("run", self.cart, "--affinity", "1023", says="--affinity: this process is not allowed to use processor 1023")

    def test_chain_leaves_the_file_alone(self):
        before = self.expect(redag("analyze", "--chain", "fast.sense,fast.act", self.cart), 0).stdout
        after = self.expect(redag("analyze", self.cart, "--chain", "fast.sense,fast.act"), 0).stdout
        self.assertEqual(before, after)

    def test_outputs_are_looked_at_before_the_work(self):
        for command, option in (("tune", "-o"), ("generate", "-o")):
            file = [] if command == "generate" else [self.cart]
            result = self.refuse(command, *file, option, self.folder, says=f"{self.folder}: error: cannot write")
            self.assertEqual(result.stdout, "")
            self.refuse(command, *file, option, "/no/such/x.yaml", says="does the directory exist?")


class Files(Case):
    def limited(self, *arguments):
        def limit():
            resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
        return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False,
                              preexec_fn=limit)

    def test_what_is_no_file(self):
        for place in ("/dev/zero", "/nonexistent", self.folder / "empty"):
            (self.folder / "empty").mkdir(exist_ok=True)
            for command in (["validate"], ["simulate"], ["analyze"], ["events", "--check"], ["report"], ["experiment", "--out", self.folder / "m"]):
                result = self.expect(self.limited(*command, place), 2, "error: ")
                self.assertLess(len(result.stderr), 4000)
        self.assertFalse((self.folder / "m").exists())

    def test_a_workload_without_a_name_has_its_files(self):
        nameless = self.write("robot arm.yaml", CART.replace("name: cart\n", ""))
        self.assertTrue(self.expect(redag("simulate", nameless), 0).stdout.startswith("robot arm: redag"))
        self.assertTrue(self.expect(redag("analyze", nameless), 0).stdout.startswith("robot arm: "))
        text = self.expect(redag("simulate", "-", text=nameless.read_text()), 0).stdout
        self.assertTrue(text.startswith("stdin: redag"), text)

    def test_names_that_would_steer_a_terminal(self):
        for place, text in (("workload", CART.replace("name: cart", r'name: "\e[31mcart"')),
                            ("dag", CART.replace("name: fast", r'name: "fa\x9bst"')),
                            ("task", CART.replace("name: plan", r'name: "pl\u202ean"')),
                            ("group", CART.replace("wcet: 25ms", r'wcet: 25ms, group: "\a"')),
                            ("choice", CART.replace("preemption: none", r'preemption: "\e]0;x\a"')),
                            ("key", CART.replace("wcet: 25ms", r'"\e[2J": 25ms')),
                            ("after", CART.replace("after: sense", r'after: "\e[2J"'))):
            bad = self.write("bad.yaml", text)
            result = self.expect(redag("validate", bad), 2, "bad.yaml:")
            self.assertRegex(result.stderr, r"bad.yaml:\d+:\d+: error: ", place)
            self.assertIsNone(re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e]", result.stderr), (place, result.stderr))

    def test_texts_of_a_megabyte(self):
        long = "x" * 1_000_000
        for text in (CART.replace("name: cart", f"name: {long}"), CART.replace("name: plan", f"name: {long}"),
                     CART.replace("wcet: 25ms", f"wcet: {HUGE * 30000}ms"), CART.replace("after: sense", f"after: {long}"),
                     CART.replace("preemption: none", f"preemption: {long}"), CART.replace("wcet: 25ms", f"wcet: 25{long}")):
            result = self.expect(redag("validate", self.write("long.yaml", text)), 2, "long.yaml:")
            self.assertLess(len(result.stderr), 4000)
        self.assertLess(len(self.expect(redag("x" * 100_000), 2, "unknown command").stderr), 2000)

    def test_names_of_files_in_a_terminal(self):
        bad = self.folder / f"{ESCAPE}[2J{ESCAPE}]0;title\a.yaml"
        bad.write_text(CART)
        for command in ("validate", "simulate"):
            _, text = in_terminal(command, bad)
            for sequence in (ESCAPE + "[2J", ESCAPE + "]", "\a"):
                self.assertNotIn(sequence, text)
        _, text = in_terminal("validate", f"/nonexistent/{ESCAPE}[2J")
        self.assertNotIn(ESCAPE + "[2J", text)

    def test_folders_that_cannot_be_written(self):
        if os.geteuid() != 0:
            closed = self.folder / "closed"
            closed.mkdir(mode=0o555)
            self.expect(redag("simulate", self.cart, "--out", closed / "x"), 2, str(closed))
        for place in ("/proc/x", "/dev/null", str(self.cart)):
            self.expect(redag("simulate", self.cart, "--out", place), 2, f"{place}: error: cannot create the folder")


if __name__ == "__main__":
    main()
