#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests the first contact with the program: help, mistakes, checking and generating workloads.

Usage: usage.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import os
import re
import subprocess

from program import CART, MISTAKEN, PROGRAM, SOURCE, Case, main, redag

COMMANDS = [["validate"], ["generate"], ["import"], ["simulate"], ["run"], ["doctor"], ["compare"], ["analyze"], ["tune"],
            ["events"], ["why"], ["top"], ["serve"], ["report"], ["experiment"]]


class Usage(Case):
    def test_version(self):
        self.assertRegex(self.expect(redag("--version"), 0).stdout, r"^redag \d+\.\d+\.\d+ \(revision \S+\)\n$")

    def test_help_and_version_are_words_too(self):
        for words in (["version"], ["-V"]):
            self.assertEqual(redag(*words).stdout, redag("--version").stdout)
        self.assertEqual(self.expect(redag("help"), 0).stdout, redag("--help").stdout)
        for command in COMMANDS:
            self.assertEqual(self.expect(redag("help", *command), 0).stdout, redag(*command, "--help").stdout)
        self.expect(redag("help", "simulat"), 2, "unknown command 'simulat' (did you mean 'simulate'?)")

    def test_no_arguments(self):
        self.expect(redag(), 2, "Commands:", "events")

    def test_help_of_every_command(self):
        listed = redag("--help").stdout
        for command in COMMANDS:
            self.assertIn(command[0], listed)
            text = self.expect(redag(*command, "--help"), 0).stdout
            self.assertIn(f"Usage: redag {' '.join(command)}", text)
            self.assertIn("Examples:", text)
            self.assertEqual([line for line in text.splitlines() if len(line) > 80], [], command)

    def test_the_page_has_the_commands_and_their_options(self):
        """docs/cli.md has a row for every command, and a command's section names only options of that command."""
        page = (SOURCE / "docs" / "cli.md").read_text(encoding="utf-8")
        helps = {" ".join(command): redag(*command, "--help").stdout for command in COMMANDS}
        commands = re.findall(r"^  ([a-z][a-z-]+) {2,}", redag("--help").stdout.split("Commands:")[1], re.M)
        self.assertEqual(set(commands), {command[0] for command in COMMANDS})
        for command in commands:
            self.assertRegex(page, rf"(?m)^\|.*`{command}[ `].*\|")
        for section in re.split(r"(?m)^## ", page):
            heading = re.match(r"`([a-z-]+)`\n", section)
            texts = [text for name, text in helps.items() if not heading or name.split()[0] == heading[1]]
            self.assertTrue(texts, heading)
            for option in set(re.findall(r"`(?:[a-z]+ )*(--[a-z-]+)", section)) - {"--help"}:
                self.assertTrue(any(re.search(rf"{option}\b", text) for text in texts), (heading and heading[1], option))

    def test_mistakes_are_near_something(self):
        self.expect(redag("simualte", self.cart), 2, "did you mean 'simulate'?")
        self.expect(redag("simulate", self.cart, "--durtion", "1s"), 2, "did you mean '--duration'?")
        self.expect(redag("simulate", self.cart, "--policy", "rate_monotonc"), 2, "did you mean 'rate_monotonic'?")
        self.expect(redag("simulate", self.cart, "--executor", "mtee"), 2, "did you mean 'mte'?")
        self.expect(redag("compare", self.cart, "--executors", "redag,stee"), 2, "did you mean 'ste'?")

    def test_bad_values(self):
        for arguments, words in [(["--duration", "5"], "no unit"), (["--duration", "0s"], "not greater than 0"),
                                 (["--duration", "-1s"], "not greater than 0"), (["--seed", "-1"], "whole number"),
                                 (["--seed", "99999999999999999999"], "whole number"),
                                 (["--workers", "100000"], "workers"), (["--warm-up", "20s"], "leaves nothing")]:
            self.expect(redag("simulate", self.cart, "--duration=10s" if "--duration" not in arguments else "--seed=1",
                              *arguments), 2, words)
        self.expect(redag("run", self.cart, "--affinity", "1-"), 2, "list of processors")
        far = self.write("far.yaml", self.cart.read_text().replace("workers: 1", "cpus: 4095"))
        self.expect(redag("run", far), 2, "the platform has processor 4095, which this process cannot use", "change 'cpus:'")
        self.expect(redag("compare", far), 2, "the platform has processor 4095")
        self.expect(redag("simulate", far, "--duration", "1s"), 0)
        self.expect(redag("validate", "--strict", far), 0)
        self.expect(redag("simulate", self.cart, "--preemption", "os", "--policy", "edf"), 2, "static policy")
        self.expect(redag("simulate", self.cart, "--executor", "mte-fifo"), 2, "no threads")


class Validate(Case):
    def test_fine(self):
        self.assertIn("2 DAGs, 3 tasks", self.expect(redag("validate", self.cart), 0).stdout)

    def test_every_mistake_with_its_place(self):
        bad = self.write("bad.yaml", MISTAKEN)
        result = self.expect(redag("validate", bad, self.cart), 2, "did you mean 'wcet'?")
        self.assertRegex(result.stderr, rf"{re.escape(str(bad))}:6:\d+: error: .*wect")
        self.assertRegex(result.stderr, rf"{re.escape(str(bad))}:7:\d+: error: ")
        self.assertIn("cart.yaml: ok", result.stdout, "the other files are still looked at")

    def test_json(self):
        bad = self.write("bad.yaml", MISTAKEN)
        document = self.document(redag("validate", "--json", bad, self.cart), "redag.validate/1", 2)
        self.assertEqual([file["ok"] for file in document["files"]], [False, True])
        self.assertEqual(document["files"][0]["diagnostics"][0]["line"], 6)
        self.assertEqual(document["files"][1]["workload"]["hyperperiod_ns"], 100_000_000)

    def test_standard_input(self):
        self.expect(redag("validate", "-", text=CART), 0)
        self.expect(redag("validate", "-", text=MISTAKEN), 2, "<stdin>:6:")

    def test_what_is_no_workload(self):
        self.expect(redag("validate", self.folder), 2, str(self.folder))
        self.expect(redag("validate", "/no/such.yaml"), 2, "/no/such.yaml")
        self.expect(redag("validate", self.write("empty.yaml", "")), 2, "empty.yaml")
        binary = self.folder / "binary.yaml"
        binary.write_bytes(bytes(range(256)))
        self.expect(redag("validate", "--json", binary), 2)

    def test_name_that_is_not_utf8(self):
        name = os.fsencode(self.folder) + b"/\xff.yaml"
        result = subprocess.run([PROGRAM, "validate", "--json", name], capture_output=True, check=False)
        self.assertEqual(result.returncode, 2)
        json.loads(result.stdout)

    def test_strict(self):
        # 3 tasks of 60 % on one worker: legal, with a warning.
        text = CART.replace("wcet: 25ms", "wcet: 99ms")
        crowded = self.write("crowded.yaml", text)
        warned = redag("validate", crowded)
        if "warning:" not in warned.stderr:
            self.skipTest("nothing to warn of")
        self.expect(warned, 0)
        self.expect(redag("validate", "--strict", crowded), 2, "--strict")

    def test_workloads_of_the_repository(self):
        files = sorted((SOURCE / "workloads").rglob("*.yaml"))
        self.assertTrue(files)
        self.expect(redag("validate", *files), 0)


class Generate(Case):
    def test_same_seed_same_bytes(self):
        arguments = ["generate", "--dags", "3", "--seed", "5", "--shape", "fork_join"]
        self.assertEqual(redag(*arguments).stdout, redag(*arguments).stdout)
        self.assertNotEqual(redag(*arguments).stdout, redag(*arguments[:4], "6", *arguments[5:]).stdout)

    def test_is_valid_and_says_how_it_was_made(self):
        text = self.expect(redag("generate", "--periods", "robot", "--offsets", "--seed", "9"), 0).stdout
        self.assertTrue(text.startswith("# redag generate --periods robot --offsets --seed 9\n"), text[:80])
        self.expect(redag("validate", "-", text=text), 0)

    def test_impossible(self):
        self.expect(redag("generate", "--min-tasks", "9", "--max-tasks", "3"), 2, "error:")
        self.expect(redag("generate", "-o", "/no/such/folder/x.yaml"), 2, "/no/such/folder/x.yaml")
        self.expect(redag("generate", "-o", "/dev/full"), 2, "No space left")


if __name__ == "__main__":
    main()
