#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag why`: its screens and JSON, and mistakes.

Usage: why.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import re
import sys

from program import CART, SOURCE, Case, in_terminal, main, redag


class Why(Case):
    def simulated(self, *arguments, file="robot.yaml"):
        folder = self.folder / "result"
        self.expect(redag("simulate", SOURCE / "workloads" / file, "--duration", "2s", "--out", folder, *arguments), 0)
        return folder

    def test_the_page_shows_what_the_program_says(self):
        """Each block of docs/why.md that follows a command is the output of this command."""
        page = (SOURCE / "docs" / "why.md").read_text(encoding="utf-8")
        (self.folder / "workloads").symlink_to(SOURCE / "workloads")
        ran = 0
        for block in re.findall(r"(?s)```console\n(.*?)```", page):
            command, _, shown = block.partition("\n")
            words = command.removeprefix("$ redag ").split()
            if "run" in words:
                continue  # other on every machine
            result = self.expect(redag(*words, cwd=self.folder), 0)
            if words[0] == "why":
                self.assertEqual(result.stdout, shown)
                ran += 1
        self.assertGreaterEqual(ran, 2)

    def test_parts_sum_to_the_response(self):
        folder = self.simulated("--preemption", "none")
        document = self.document(redag("why", folder, "--json", "--all"), "redag.why/1")
        self.assertGreater(document["misses"], 5)
        self.assertEqual(len(document["jobs"]), document["misses"])
        rows = {(row["dag"] + "." + row["task"] + "#" + row["job"]): row for row in self.jobs(folder)}
        for job in document["jobs"]:
            self.assertEqual(sum(part["length_ns"] for part in job["parts"]), job["length_ns"])
            row = rows[job["job"]]
            begin = row["origin_ns"] if job["end_to_end"] else row["release_ns"]
            self.assertEqual(job["length_ns"], int(row["finish_ns"]) - int(begin))
        self.assertEqual(sum(cause["main"] for cause in document["causes"]),
                         sum(1 for job in document["jobs"] if job["parts"]))

    @staticmethod
    def jobs(folder):
        head, *lines = (folder / "jobs.csv").read_text().splitlines()
        return [dict(zip(head.split(","), line.split(","))) for line in lines]

    def test_screens_fit_the_terminal(self):
        folder = self.simulated("--preemption", "none")
        for arguments in [[], ["control.controller"], ["control.imu", "--end-to-end"]]:
            for columns in 80, 120:
                status, text = in_terminal("why", folder, *arguments, columns=columns, NO_COLOR="1")
                self.assertEqual(status, 0, text)
                long = [line for line in text.splitlines() if len(line) > columns and str(folder) not in line]
                self.assertEqual(long, [])

    def test_without_a_miss(self):
        folder = self.simulated(file="contention.yaml")
        text = self.expect(redag("why", folder), 0).stdout
        self.assertIn("no deadline was missed; the jobs that came closest", text)
        self.assertIn("met its deadline", self.expect(redag("why", folder, "planning.plan"), 0).stdout)

    def test_many_parts_are_summed_up(self):
        dags = "".join(f"  - {{name: d{i}, tasks: [{{name: t, wcet: 10us, period: 1ms}}]}}\n" for i in range(60))
        file = self.write("many.yaml", "platform: {workers: 1, preemption: os}\ndags:\n" + dags +
                          "  - {name: slow, tasks: [{name: t, wcet: 2ms, period: 50ms}]}\n")
        folder = self.folder / "many"
        self.expect(redag("simulate", file, "--duration", "100ms", "--out", folder), 0)
        short, whole = (self.expect(redag("why", folder, "slow.t#0", *more), 0).stdout for more in ([], ["--all"]))
        self.assertLess(len(short.splitlines()), 50)
        self.assertIn("shorter parts, mainly ", short)
        self.assertIn("--all shows all", short)
        self.assertGreater(len(whole.splitlines()), 200)
        for more, least, most in ([], 20, 40), (["--all"], 200, 10_000):
            job, = json.loads(self.expect(redag("why", folder, "slow.t#0", "--json", *more), 0).stdout)["jobs"]
            self.assertTrue(least <= len(job["parts"]) <= most, len(job["parts"]))
            self.assertEqual(sum(part["length_ns"] for part in job["parts"]), job["length_ns"])
            for part in job["parts"]:
                self.assertEqual(part["cause"] is None, "shorter parts" in part["text"], part)

    def test_a_document_is_short_however_many_missed(self):
        """Its size does not grow with the misses and their parts, of which there are some 100 000 here."""
        file = self.write("missed.yaml", "platform: {workers: 1, preemption: os}\ndags:\n"
                          "  - {name: a, tasks: [{name: t, wcet: 90us, period: 200us}]}\n"
                          "  - {name: b, deadline: 100ms, tasks: [{name: t, wcet: 150ms, period: 400ms}]}\n")
        folder = self.folder / "missed"
        self.expect(redag("simulate", file, "--duration", "12s", "--out", folder), 0)
        result = self.expect(redag("why", folder, "--json"), 0)
        document = json.loads(result.stdout)
        self.assertEqual((document["misses"], len(document["jobs"])), (30, 20))
        self.assertLess(len(result.stdout), 400_000)

    def test_mistakes(self):
        folder = self.simulated()
        self.expect(redag("why", self.folder / "none"), 2, "no such file or folder")
        self.expect(redag("why", folder, "control.contoller"), 2, "did you mean 'control.controller'?")
        self.expect(redag("why", folder, "control.controller#9999"), 2, "its jobs are 0 to")
        self.expect(redag("why", folder, "control.controller#x"), 2, "has no job 'x'")
        for command in ("why", "events", "report"):
            self.expect(redag(command, self.cart), 2, "this is a workload, and not a recorded run", "redag simulate")

    def test_of_a_comparison_the_worst_repetition(self):
        file = self.write("random.yaml", CART.replace("wcet: 25ms", "wcet: 25ms, bcet: 5ms"))
        many = self.folder / "many"
        self.expect(redag("compare", file, "--simulate", "--duration", "2s", "--repeat", "4", "--executors", "redag-none,mte",
                          "--out", many), 0)
        missed = {path.parent: json.loads(path.read_text())["total"]["missed"]
                  for path in sorted(many.glob("redag-none/*/summary.json"))}
        worst = max(missed, key=missed.get)
        self.assertNotEqual(worst, min(missed), "another one than the first")
        note = f"{many} holds 8 runs; this is {worst}, in which redag-none missed most deadlines ({missed[worst]})\n"
        why = self.expect(redag("why", many), 0)
        self.assertEqual((why.stdout, why.stderr), (redag("why", worst).stdout.replace(str(worst), str(many)), note))
        self.assertEqual(redag("events", many).stdout, redag("events", worst).stdout)
        self.assertEqual(redag("events", many).stderr, note)
        self.expect(redag("why", many / "mte"), 0, "holds 4 runs; this is ")
        (many / "comparison.json").unlink()
        self.expect(redag("why", many), 2, "holds 8 runs", f"name one of them, such as '{many / 'mte'}")


if __name__ == "__main__":
    main()
