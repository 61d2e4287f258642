#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests that time and memory of the program are bounded: the cost of large workloads and long runs, and their limits.

Usage: bounded.py PROGRAM SOURCE_DIR. Uses the standard library only. Judges peak memory and
messages, never seconds.
"""
import json
import os
import subprocess
import tempfile
import unittest

from program import PROGRAM, SANITIZED, Case, interrupt, main, redag

MIB = 1 << 20
MANY = 1500


def independent(count, workers=1, policy="rate_monotonic"):
    """Returns a workload of tasks with three periods, which use half of the workers."""
    lines = ["name: many", f"platform: {{workers: {workers}, preemption: auto}}", f"policy: {policy}", "dags:"]
    for i in range(count):
        period = 10_000_000 * (i % 3 + 1)
        lines.append(f"  - {{name: d{i}, tasks: [{{name: t, period: {period}ns, wcet: {period * workers // 2 // count}ns}}]}}")
    return "\n".join(lines) + "\n"


def peak(*arguments):
    """Runs `redag`. Returns its exit status, its standard output, and its peak memory in bytes."""
    with tempfile.TemporaryFile("w+") as out:
        process = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=out, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        return process.returncode, out.read(), usage.ru_maxrss * 1024


@unittest.skipIf(SANITIZED, "a sanitizer's memory is not ours")
class Memory(Case):
    def test_an_analysis_is_linear_in_the_tasks(self):
        """An earlier version kept all terms: 1,000 tasks took 162 MiB, and 2,000 took 621 MiB."""
        for workers in (1, 2):
            few, many = (peak("analyze", self.write(f"{count}.yaml", independent(count, workers)), "--json")[2]
                         for count in (500, 1500))
            self.assertLess(many - few, 24 * MIB, f"{workers} workers")

    def test_a_simulation_does_not_grow_with_its_length(self):
        """Simulates two tasks with a job per microsecond each. An earlier version kept 32 bytes for each job."""
        fast = self.write("fast.yaml", "name: fast\nplatform: {workers: 2}\ndags:\n" + "".join(
            f"  - {{name: d{i}, tasks: [{{name: t, period: 1us, wcet: 300ns, bcet: 100ns}}]}}\n" for i in range(2)))
        sizes = []
        for duration in ("300ms", "900ms"):
            status, out, size = peak("simulate", fast, "--duration", duration, "--max-events", 10_000, "--json")
            self.assertEqual(status, 0)
            sizes.append(size)
        summary = json.loads(out)
        self.assertEqual(summary["total"]["finished"], 1_800_000)
        for task in summary["tasks"]:
            self.assertEqual(task["response"]["percentile_error"], 1 / 256)
        self.assertLess(sizes[1] - sizes[0], 16 * MIB)

    def test_files_of_long_runs_are_written_and_read_in_bounded_memory(self):
        """Twice the events, 2.5 and 5 million: their 32 bytes each would be 80 MB more."""
        fast = self.write("fast.yaml", "name: fast\nplatform: {workers: 2}\ndags:\n" + "".join(
            f"  - {{name: d{i}, tasks: [{{name: t, period: 1us, wcet: 300ns, bcet: 100ns}}]}}\n" for i in range(2)))
        sizes = {"simulate": [], "events --check": [], "events": []}
        for duration in ("300ms", "600ms"):
            out = self.folder / duration
            commands = {"simulate": [fast, "--duration", duration, "--max-events", 1_000_000_000, "--out", out],
                        "events --check": [out], "events": [out, "-o", self.folder / "events.jsonl"]}
            for command, arguments in commands.items():
                status, text, size = peak(*command.split(), *arguments)
                self.assertEqual(status, 0, text)
                sizes[command].append(size)
        for command, (short, long) in sizes.items():
            self.assertLess(long - short, 16 * MIB, command)

    def test_a_workload_in_nanoseconds_ends(self):
        tiny = self.write("tiny.yaml", "name: tiny\nplatform: {workers: 1}\ndags:\n"
                                       "  - {name: d, tasks: [{name: t, period: 10ns, wcet: 3ns}]}\n")
        status, out, size = peak("simulate", tiny, "--json")
        self.assertEqual(status, 0)
        self.assertEqual(json.loads(out)["total"]["released"], 4_000_000)
        self.assertLess(size, 600 * MIB)


class Limits(Case):
    def test_a_method_gives_up_and_the_others_answer(self):
        many = self.write("many.yaml", independent(MANY, 2, "edf"))
        text = self.expect(redag("analyze", many, "--effort", 1), 0).stdout
        self.assertIn("schedulable: every deadline is met, by edf_global_density", text)
        self.assertIn("gave up on edf_global_response: more than 1 million steps\n", text)
        self.assertIn("--effort and --time-limit set these limits", text)
        document = json.loads(self.expect(redag("analyze", many, "--effort", 1, "--json"), 0).stdout)
        gave_up = {method["name"]: method["reason"] for method in document["methods"] if method["gave_up"]}
        self.assertEqual(gave_up["edf_global_response"], "more than 1 million steps")
        self.assertNotIn("edf_global_density", gave_up)
        self.assertTrue(document["schedulable"])

    def test_a_time_limit(self):
        many = self.write("many.yaml", independent(MANY, 2))
        text = self.expect(redag("analyze", many, "--time-limit", "1ns"), 0).stdout
        self.assertIn("gave up on dag_bounded: the time limit of 1ns has passed\n", text)
        result = self.expect(redag("analyze", "--sensitivity", many, "--time-limit", "1ns", "--json"), 0,
                             "the time limit of 1ns has passed: these are 0 of")
        self.assertFalse(json.loads(result.stdout)["sensitivity"]["complete"])

    def test_terms_of_a_large_workload_come_on_demand(self):
        many = self.write("many.yaml", independent(200))
        document = json.loads(self.expect(redag("analyze", many, "--json"), 0).stdout)
        self.assertTrue(all(task["terms"] is None for task in document["tasks"]))
        text = self.expect(redag("analyze", many, "--explain", "d199.t"), 0).stdout
        self.assertRegex(text, r"d0\.t +\d+ ")
        few = json.loads(self.expect(redag("analyze", self.write("few.yaml", independent(100)), "--json"), 0).stdout)
        for task in few["tasks"]:
            self.assertEqual(sum(term["amount_ns"] for term in task["terms"]), task["bound_ns"])

    def test_interrupt_keeps_what_was_found(self):
        many = self.write("many.yaml", independent(6_000, 2, "edf"))
        process = subprocess.Popen([PROGRAM, "analyze", many, "--effort", "0", "--json"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        interrupt(process, 4)
        out, err = process.communicate(timeout=300)
        self.assertEqual(process.returncode, 0, err)
        document = json.loads(out)
        self.assertIn("interrupted", {method["reason"] for method in document["methods"]})
        self.assertTrue(document["schedulable"], "edf_global_density takes no time")


if __name__ == "__main__":
    main()
