#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Runs every example of every --help as it is printed, in bash.

Usage: examples.py PROGRAM SOURCE_DIR. A folder has the repository's workloads, the plans of its experiments with fewer
runs, and the results that an example names. Three things differ from what a user types: lengths of runs in real time,
numbers of processes and processors, and `sudo`, which calls the command.
"""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time
import unittest

from program import CART, PROGRAM, SOURCE, Case, main, redag

SHORT = "500ms"       # of a run in real time
MEASUREMENT = "10s"  # everything is measured once, on a busy machine too
# What a plan of the repository gets less of. Its factors stay.
FEWER = {r"(?m)^(sets): .*$": r"\1: 1", r"(?m)^(repetitions): .*$": r"\1: 1", r"(?m)^(duration): .*$": r"\1: 50ms",
         r"(?m)^(warm_up): .*$": r"\1: 0s", r"(?m)^(simulation): .*$": r"\1: {offsets: 1, periods: 1}"}
ROBOT = ["simulate", "workloads/robot.yaml", "--preemption", "none", "--duration", "2s"]
# The results that examples name, by the commands that make them.
RESULTS = {
    "results/demo": ROBOT, "results/none": ROBOT, "results/before": ROBOT, "results/main": ROBOT,
    "results/os": [*ROBOT[:3], "cooperative", *ROBOT[4:]],
    "results/after": [*ROBOT, "--seed", "2"], "results/branch": [*ROBOT, "--seed", "3"],
    "results/cmp": ["compare", "workloads/robot.yaml", "--simulate", "--executors", "redag,mte", "--duration", "2s"],
}
TOOLS = {
    "sudo": '#!/bin/sh\nexec "$@"\n',
    "ros2": "#!/bin/sh\nexit 1\n",
}


def commands():
    """Returns every command: ["simulate"], ["analyze"], ..."""
    found = []
    for name in names_in(redag("--help").stdout):
        inner = names_in(redag(name, "--help").stdout)
        found += [[name], *([name, below] for below in inner)]
    return found


def names_in(text):
    return re.findall(r"(?m)^  ([a-z][a-z-]+) {2,}", text.split("\nCommands:\n")[1].split("\n\n")[0]) if "\nCommands:\n" in text else []


class Examples(Case):
    def setUp(self):
        super().setUp()
        for shipped in ("workloads", "examples"):
            (self.folder / shipped).symlink_to(SOURCE / shipped)
        for plan in (SOURCE / "evaluation" / "experiments").rglob("*.yaml"):
            text = plan.read_text()
            for pattern, less in FEWER.items():
                text = re.sub(pattern, less, text)
            copy = self.folder / plan.relative_to(SOURCE)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(text)
        self.watched = None
        tools = self.folder / "tools"
        tools.mkdir()
        for name, text in TOOLS.items():
            (tools / name).write_text(text)
            (tools / name).chmod(0o755)
        path = os.pathsep.join([str(tools), str(PROGRAM.parent), os.environ["PATH"]])
        self.environment = {**os.environ, "PATH": path}

    def make(self, place):
        """Makes a result that an example names."""
        if place not in RESULTS:
            return
        self.expect(redag(*RESULTS[place], "--out", place, cwd=self.folder), 0)

    def running_executor(self):
        """Returns the process ID of a run that `redag top` can watch. The first call starts it."""
        if self.watched is not None and self.watched.poll() is None:
            return self.watched.pid
        # Of a name that no other test's executor has: top goes on with the next executor of its name.
        workload = self.write("watched.yaml", CART.replace("name: cart", "name: watched"))
        process = self.watched = subprocess.Popen([PROGRAM, "run", workload, "--duration", "300s"], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.send_signal, signal.SIGKILL)
        deadline = time.monotonic() + 60
        while str(process.pid) not in redag("top", "--list").stdout:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.05)
        return process.pid

    def adapted(self, command, example):
        """Returns the example with the differences that the top of this file states."""
        name = command[0]
        if name == "doctor":
            example = example.replace("1234", str(os.getpid())).replace("5min", MEASUREMENT)
        if name == "run" or (name == "compare" and ".yaml" in example and "--simulate" not in example):
            shorter = re.sub(r"--duration \S+", f"--duration {SHORT}", example)
            example = shorter if shorter != example else re.sub(rf"(redag {name}(?: \S+\.yaml)?)", rf"\1 --duration {SHORT}", example)
        if "--affinity" in example:
            example = re.sub(r"--affinity \S+", f"--affinity {','.join(map(str, sorted(os.sched_getaffinity(0))[-2:]))}", example)
        if name == "top":
            pid = self.running_executor()
            example = example.replace("1234", str(pid))
            if "--" not in example or "--interval" in example:  # a screen, until it is interrupted
                example = example.replace("redag top", f"redag top {pid}") if example == "redag top" else example
                example = f"script --quiet --return --command 'timeout --foreground --preserve-status -s INT 2 {example}' /dev/null"
        if name == "serve":  # until it is interrupted
            self.running_executor()
            example = f"timeout --preserve-status -s INT 2 {example}"
        return example

    def lacking(self, command, example):
        """Returns why this machine cannot run an example, or None."""
        if "--preemption os" in example and command[0] == "run" and redag(
                "run", self.cart, "--preemption", "os", "--duration", "50ms").returncode != 0:
            return "no right to use SCHED_FIFO"
        if "--affinity" in example and len(os.sched_getaffinity(0)) < 2:
            return "two processors are needed"
        for tool in ("jq", "script"):
            if re.search(rf"(?:\| |^){tool} ", example) and not shutil.which(tool):
                return f"{tool} is not installed"
        return None

    def run_example(self, command, example):
        shutil.rmtree(self.folder / "results", ignore_errors=True)
        for place in set(re.findall(r"results/[a-z]+(?:-\d)?", example)):
            if f"--out {place}" in example:
                continue
            self.make(place)
        result = subprocess.run(["bash", "-c", f"set -o pipefail; {self.adapted(command, example)}"], cwd=self.folder,
                                text=True, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=250,
                                stdin=subprocess.DEVNULL, check=False)
        # Deadlines of the examples are missed, and their traces are lawful.
        expected = 1 if "--check" in example and "||" not in example and command[0] != "events" else 0
        if command[0] == "doctor" and result.returncode == 1:  # a setting of this machine is red
            expected = 1
        self.assertEqual(result.returncode, expected, f"{example}\n{result.stderr}\n{result.stdout[-2000:]}")

    def test_every_example(self):
        ran, skipped = 0, []
        for command in commands():
            text = redag(*command, "--help").stdout
            options, examples = text.split("\nExamples:\n")
            for option in re.findall(r"(?<=redag )[^|]*?(--[a-z-]+)", examples):
                self.assertIn(option, text, command)
            one_line_each = re.sub(r" \\\n\s+", " ", examples.strip())
            for example in map(str.strip, one_line_each.splitlines()):
                with self.subTest(example):
                    for file in re.findall(r"\b(?:workloads|evaluation)/\w\S*\.yaml", example):
                        self.assertTrue((SOURCE / file).exists(), example)
                    reason = self.lacking(command, example)
                    if reason:
                        skipped.append(f"{example}: {reason}")
                        continue
                    begin = time.monotonic()
                    self.run_example(command, example)
                    print(f"{time.monotonic() - begin:5.1f} s  {example}", flush=True)
                    ran += 1
        print(f"{ran} examples ran; not run here:", *(skipped or ["none"]), sep="\n  ", flush=True)
        self.assertGreater(ran, 40)


if __name__ == "__main__":
    main()
