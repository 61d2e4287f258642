#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag experiment` from outside: the way in which it runs does not change its results.

Usage: experiments.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import csv
import json
import re
import signal
import subprocess
import unittest

from program import CART, PROGRAM, SANITIZED, SOURCE, Case, changed_run, in_terminal, interrupt, main, redag, units,\
    wait_for_units

ACCEPTANCE = """\
experiment: acceptance
dags: 6
workers: 2
utilization: {{from: 0.2, to: 0.8, step: 0.2}}
methods: [any, simulation, dag_bounded]
sets: {sets}
seed: {seed}
simulation: {{offsets: 5, periods: {periods}}}
"""
FACTORIAL = """\
experiment: factorial
name: small
repetitions: {repetitions}
duration: {duration}
workloads: [cart.yaml]
workers: [1, 2]
deadline_scale: [0.8, 1.2]
max_active: [unbounded, [1, 2]]
executors: [ideal, redag, redag-none, mte, ste]
"""


class Experiments(Case):
    def run_plan(self, plan, name, *arguments, status=0):
        return self.expect(redag("experiment", plan, "--out", self.folder / name, *arguments), status)

    def results(self, name):
        return (self.folder / name / "results.csv").read_text(), units(self.folder / name)

    def rows(self, name):
        return list(csv.DictReader(self.results(name)[0].splitlines()))

    def json_of(self, name):
        return json.loads((self.folder / name / "results.json").read_text())

    def start(self, plan, name, *arguments):
        """Starts an experiment that takes some seconds. Returns it once it has written units."""
        process = subprocess.Popen([PROGRAM, "experiment", plan, "--out", self.folder / name, *arguments],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        wait_for_units(self, process, self.folder / name)
        return process

    def killed_and_gone_on(self, plan, all_units):
        for _ in range(2):
            process = self.start(plan, "killed", "-j1")
            process.kill()
            process.communicate()
        result = self.run_plan(plan, "killed")
        self.assertRegex(result.stderr, rf"\d+ of {all_units} units are done already")
        self.run_plan(plan, "whole")
        self.assertEqual(self.results("killed"), self.results("whole"))
        self.assertTrue(self.json_of("killed")["complete"])

    def same_for_any_number_of_jobs(self, plan):
        self.run_plan(plan, "one", "-j1")
        self.run_plan(plan, "two", "-j2")
        self.assertEqual(self.results("one"), self.results("two"))


class Acceptance(Experiments):
    """Plans with `experiment: acceptance`."""

    def plan(self, sets=4, seed=5, periods=5):
        return self.write("plan.yaml", ACCEPTANCE.format(sets=sets, seed=seed, periods=periods))

    def test_same_results_for_any_number_of_jobs(self):
        self.same_for_any_number_of_jobs(self.plan(sets=20))
        rows = self.rows("one")
        self.assertEqual(len(rows), 2 * 4 * 3)
        self.assertTrue(all(row["sets"] == "20" for row in rows))
        self.run_plan(self.plan(sets=20, seed=6), "other")
        self.assertNotEqual(self.results("one")[1], self.results("other")[1])

    def test_killed_and_gone_on(self):
        self.killed_and_gone_on(self.plan(sets=40, periods=40), 320)

    def test_ctrl_c_keeps_what_is_done(self):
        plan = self.plan(sets=2000, periods=40)
        process = self.start(plan, "stopped")
        self.run_plan(plan, "stopped", status=2)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, error)
        self.assertIn("interrupted: the results so far are kept; run the same command to resume", error)
        self.assertIn("workloads are done", out)
        document = self.json_of("stopped")
        self.assertFalse(document["complete"])
        self.assertEqual(document["done"], len(self.results("stopped")[1]))

    def test_report(self):
        self.run_plan(self.plan(), "done")
        result = self.expect(redag("report", self.folder / "done"), 0)
        self.assertIn("acceptance: 32 of 32 workloads", result.stdout)
        self.assertIn("\"name\":\"acceptance\"", (self.folder / "done" / "report.html").read_text())
        document = self.document(redag("report", self.folder / "done", "--json"), "redag.experiment/1")
        self.assertEqual((document["done"], len(document["rows"])), (32, 2 * 4 * 3))

    def test_another_plan_is_refused(self):
        self.run_plan(self.plan(), "done")
        before = self.results("done")
        result = self.run_plan(self.plan(sets=5), "done", status=2)
        self.assertIn("units.csv:1:1: error: holds results of another plan or of another version of redag", result.stderr)
        self.assertEqual(before, self.results("done"))
        plan = self.plan()
        plan.write_text("# The same.\n" + plan.read_text())
        self.run_plan(plan, "done")

    def test_violation_is_an_error(self):
        """A miss is changed to look as if a bound had accepted the workload."""
        plan = self.plan(sets=2)
        self.run_plan(plan, "forged")
        file = self.folder / "forged" / "units.csv"
        number, missed = next(row for row in sorted(units(self.folder / "forged").items()) if row[1].startswith("00"))
        fields = f"{number},1{missed[1:]}"
        checksum = 0xcbf29ce484222325
        for byte in fields.encode():
            checksum = (checksum ^ byte) * 0x100000001b3 % 2**64
        file.write_text(re.sub(rf"(?m)^\w+,{number},.*$", f"{checksum:016x},{fields}", file.read_text()))
        result = self.run_plan(plan, "forged", status=1)
        self.assertIn(f"error: unit {number} (dags 6, workers 2, ", result.stderr)
        self.assertIn("misses a deadline in simulation, although it is accepted by any", result.stderr)

    def test_a_damaged_row_is_done_again(self):
        plan = self.plan(sets=2)
        self.run_plan(plan, "damaged")
        before = self.results("damaged")
        file = self.folder / "damaged" / "units.csv"
        lines = file.read_text().splitlines()
        file.write_text("\n".join(lines[:3] + [lines[3][:-1] + "x"] + lines[4:]) + "\n")
        self.assertIn("15 of 16 units are done already", self.run_plan(plan, "damaged").stderr)
        self.assertEqual(before, self.results("damaged"))
        file.write_text("unit,result\n" * 50)
        self.assertIn("units.csv:1:1: error: holds results", self.run_plan(plan, "damaged", status=2).stderr)

    def test_bad_input(self):
        bad = self.write("bad.yaml", "experiment: acceptance\nworkers: two\nmethods: [gaun]\n")
        self.expect(redag("experiment", bad, "--out", self.folder / "x"), 2, "bad.yaml:2:10: error: workers must be a whole number")
        plan = self.plan()
        for text, words in [("methods: [gaun]", "did you mean 'guan'?"), ("utilization: {from: 1, to: 0.5, step: 1}", "utilization is not a range"),
                            ("sets: 0", "sets must be a whole number from 1"), ("workers: 0", "workers must be"),
                            ("dags: 2\nworkload: {tasks: 1}", "dags 2, workers 4"), ("preemption: auto", "preemption must be"),
                            ("set: 1", "did you mean 'sets'?")]:
            bad.write_text(f"experiment: acceptance\n{text}\n")
            self.expect(redag("experiment", bad, "--out", self.folder / "x"), 2, words)
        self.expect(redag("experiment"), 2, "PLAN")
        self.expect(redag("experiment", plan), 2, "--out")
        self.expect(redag("experiment", "/no/such.yaml", "--out", self.folder / "x"), 2, "/no/such.yaml")
        self.assertFalse((self.folder / "x").exists())

    def test_progress_on_a_terminal(self):
        status, text = in_terminal("experiment", self.plan(sets=300), "--out", self.folder / "out", columns=100)
        self.assertEqual(status, 0, text)
        self.assertRegex(text, r"\d+ %  \d+ of 2400 units, \S+ left")


class Factorial(Experiments):
    """Plans with `experiment: factorial`."""

    def setUp(self):
        super().setUp()
        self.write("cart.yaml", CART.replace("wcet: 25ms", "wcet: 25ms, bcet: 15ms"))

    def plan(self, repetitions=2, duration="1s"):
        return self.write("plan.yaml", FACTORIAL.format(repetitions=repetitions, duration=duration))

    def test_same_results_for_any_number_of_jobs(self):
        self.same_for_any_number_of_jobs(self.plan())
        rows = self.rows("one")
        # Factors of ideal and mte: workers x deadlines; of redag and redag-none: bounds as well; of ste: deadlines.
        # Each has two DAGs and the total.
        self.assertEqual(len(rows), (4 + 8 + 8 + 4 + 2) * 3)
        total = {(row["executor"], row["workers"], row["deadline_scale"], row["max_active"]): row
                 for row in rows if row["dag"] == "total"}
        self.assertEqual(float(total["ideal", "1", "1.2", ""]["miss_ratio"]), 0)
        ste = {name: float(total["ste", "", "0.8", ""][name]) for name in ("miss_ratio", "drop_ratio", "paper_miss_ratio")}
        self.assertGreater(ste["miss_ratio"], 0.05)
        self.assertLess(ste["miss_ratio"] - ste["drop_ratio"], ste["paper_miss_ratio"])
        document = self.json_of("one")
        self.assertEqual((document["done"], document["complete"]), (52, True))
        self.assertTrue(all(remark["good"] for remark in document["remarks"]))
        self.assertIn("no violation of the model", document["remarks"][0]["text"])

    def test_report(self):
        self.run_plan(self.plan(), "done")
        result = self.expect(redag("report", self.folder / "done"), 0)
        self.assertIn("small: 52 of 52 runs", result.stdout)
        self.assertIn("\"name\":\"small\"", (self.folder / "done" / "report.html").read_text())
        self.expect(redag("report", self.folder / "done", self.folder / "done"), 2, "name this folder alone")
        (self.folder / "done" / "results.json").write_text("{}")
        self.expect(redag("report", self.folder / "done"), 2, "results.json: is not a redag.experiment/1")
        self.run_plan(self.plan(), "done")  # an earlier page is accepted

    def test_killed_and_gone_on(self):
        self.killed_and_gone_on(self.plan(repetitions=12, duration="20s"), 312)

    def test_ctrl_c_keeps_what_is_done(self):
        process = self.start(self.plan(repetitions=200, duration="20s"), "stopped")
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, error)
        self.assertIn("of 5 200 runs are done", out)
        document = self.json_of("stopped")
        self.assertFalse(document["complete"])
        self.assertEqual(document["done"], len(self.results("stopped")[1]))

    def test_other_jobs_are_another_plan(self):
        plan = self.plan()
        self.run_plan(plan, "done")
        self.write("cart.yaml", CART.replace("25ms", "26ms"))
        self.assertIn("holds results of another plan", self.run_plan(plan, "done", status=2).stderr)

    def test_bad_input(self):
        def refused(plan, words):
            return self.expect(redag("experiment", plan, "--out", self.folder / "out"), 2, words)
        refused(self.write("bad.yaml", "experiment: factorial\nworkers: two\nexecutors: [redga]\nworkloads: [cart.yaml]\n"),
                "bad.yaml:2:10: error: workers must be a whole number")
        refused(self.write("bad.yaml", "experiment: factorial\nexecutors: [redga]\nworkloads: [cart.yaml]\n"), "did you mean 'redag'?")
        self.write("cart.yaml", CART.replace("25ms", "25"))
        self.assertIn("cart.yaml:7:", refused(self.plan(), "plan.yaml:5:13: error: the workload").stderr)
        self.write("cart.yaml", (SOURCE / "workloads" / "clusters.yaml").read_text())
        refused(self.plan(), "an experiment")

    def test_threads(self):
        """Real runs take turns. The ideal runs beside them in virtual time."""
        plan = self.write("plan.yaml", "experiment: factorial\nworld: threads\nduration: 300ms\nrepetitions: 2\n"
                          "workloads: cart.yaml\nexecutors: [ideal, redag-none, mte]\n")
        result = self.run_plan(plan, "threads", "-j4")
        self.assertIn("on 1 processor", result.stderr)
        rows = self.rows("threads")
        self.assertEqual({(row["executor"], row["world"]) for row in rows},
                         {("ideal", "simulator"), ("redag-none", "threads"), ("mte", "threads")})
        for row in rows:  # two runs of 30 releases of sense, and one of act for each that ran
            if row["dag"] == "fast":
                self.assertGreaterEqual(int(row["released"]), 60)
                self.assertLessEqual(int(row["released"]), 120)

    def test_ros2(self):
        """A substitute for run_workload simulates here. The command line is that of the real program."""
        plan = self.write("plan.yaml", "experiment: factorial\nworld: ros2\nduration: 500ms\nrepetitions: 2\nworkers: [1, 2]\n"
                          "workloads: cart.yaml\nexecutors: [ideal, redag-none, mte, ste, simulator/mte]\n")
        program = self.write("run_workload", f"""#!/bin/sh
executor=${{2#--executor=}} duration=${{3#--duration=}} warm_up=${{4#--warm-up=}} seed=${{5#--seed=}} out=${{6#--out=}}
exec "{PROGRAM}" simulate "$1" --executor "$executor" --duration "$duration" --warm-up "$warm_up" --seed "$seed" --out "$out"
""")
        program.chmod(0o755)
        self.run_plan(plan, "ros2", "--run-workload", program)
        rows = [row for row in self.rows("ros2") if row["dag"] == "total"]
        self.assertEqual(len(rows), 2 + 2 + 2 + 1 + 2)
        self.assertTrue(all(int(row["released"]) > 200 for row in rows))
        program.write_text("#!/bin/sh\necho error: no such thing >&2\nexit 2\n")
        self.assertIn("failed with this message: error: no such thing", self.run_plan(plan, "bad", "--run-workload", program,
                                                                           status=2).stderr)
        self.assertIn("source the workspace", self.run_plan(plan, "worse", "--run-workload", "/no/such", status=2).stderr)

    @unittest.skipIf(SANITIZED, "a unit of some plans takes minutes there")
    def test_plans_of_this_repository(self):
        plans = sorted((SOURCE / "evaluation" / "experiments" / "paper").glob("*.yaml"))
        self.assertGreater(len(plans), 5)
        for plan in plans:
            if "world: ros2" in plan.read_text():
                continue
            with self.subTest(plan=plan.name):
                process = subprocess.Popen([PROGRAM, "experiment", plan, "--out", self.folder / plan.stem],
                                           stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                interrupt(process, 0.3)
                _, error = process.communicate(timeout=120)
                self.assertEqual(process.returncode, 0, error)
                self.assertTrue((self.folder / plan.stem / "results.json").exists())


if __name__ == "__main__":
    main()
