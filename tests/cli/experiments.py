#!/usr/bin/env python3
"""`redag experiment factorial` as its users meet it: the same results however it was run.

Usage: experiments.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import csv
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree

PROGRAM = pathlib.Path()
SOURCE = pathlib.Path()
PLAN = """\
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
CART = """\
name: cart
platform: {workers: 1, preemption: none}
dags:
  - name: fast
    tasks: [{name: sense, wcet: 1ms, period: 10ms}, {name: act, wcet: 1ms, activation: data, after: sense}]
  - name: slow
    tasks: [{name: plan, wcet: 25ms, bcet: 15ms, period: 100ms}]
"""


def redag(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=250, check=False)


class Factorial(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory(prefix="redag-experiments-")
        self.addCleanup(directory.cleanup)
        self.folder = pathlib.Path(directory.name)
        self.write("cart.yaml", CART)

    def write(self, name, text):
        (self.folder / name).write_text(text)
        return self.folder / name

    def plan(self, repetitions=2, duration="1s", name="plan.yaml"):
        return self.write(name, PLAN.format(repetitions=repetitions, duration=duration))

    def expect(self, result, status, words=""):
        self.assertEqual(result.returncode, status, result.stdout + result.stderr)
        self.assertIn(words, result.stderr)
        return result

    def run_plan(self, plan, name, *arguments, status=0):
        return self.expect(redag("experiment", "factorial", plan, "--out", self.folder / name, *arguments), status)

    def results(self, name):
        return [(self.folder / name / file).read_text()
                for file in ("factorial.csv", "observations.csv", "units.csv", "factorial.svg")]

    def start(self, plan, name):
        """A run that takes some seconds, once it has more units on file than before."""
        units = self.folder / name / "units.csv"
        lines = units.read_text().count("\n") if units.exists() else 2
        process = subprocess.Popen([PROGRAM, "experiment", "factorial", plan, "--out", self.folder / name, "-j1"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 60
        while not units.exists() or units.read_text().count("\n") <= lines:
            self.assertIsNone(process.poll(), "it ended before it could be disturbed")
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        return process

    def test_same_results_for_any_number_of_jobs_and_shards(self):
        plan = self.plan()
        result = self.run_plan(plan, "one", "-j1")
        self.assertIn("no violation of the model; every bound max_active was kept", result.stdout)
        self.assertIn("workers x deadline_scale", result.stdout)
        self.run_plan(plan, "two", "-j2")
        self.assertEqual(self.results("one"), self.results("two"))
        for shard in ("1", "2"):
            self.run_plan(plan, f"shard{shard}", "--shard", f"{shard}/2")
        self.expect(redag("experiment", "merge", self.folder / "shard1", self.folder / "shard2", "-o",
                          self.folder / "merged"), 0)
        self.assertEqual(self.results("one"), self.results("merged"))

        rows = list(csv.DictReader(self.results("one")[0].splitlines()))
        # ideal, mte: workers x deadlines; redag, redag-none: x bounds; ste: deadlines. Each two DAGs and the total.
        self.assertEqual(len(rows), (4 + 8 + 8 + 4 + 2) * 3)
        total = {(row["executor"], row["workers"], row["deadline_scale"], row["max_active"]): row
                 for row in rows if row["dag"] == "total"}
        self.assertEqual(float(total["ideal", "1", "1.2", ""]["miss_ratio"]), 0)
        self.assertGreater(float(total["ste", "", "0.8", ""]["miss_ratio"]), 0.05)
        self.assertLess(float(total["ste", "", "0.8", ""]["late_ratio"]),
                        float(total["ste", "", "0.8", ""]["paper_miss_ratio"]))
        document = json.loads((self.folder / "one" / "factorial.json").read_text())
        self.assertEqual((document["done"], document["complete"], document["violations"]), (52, True, 0))
        self.assertTrue(document["runs"][0]["machine"]["kernel"])
        names = [text.text for text in xml.etree.ElementTree.parse(self.folder / "one" / "factorial.svg").getroot()
                 .iter("{http://www.w3.org/2000/svg}text")]
        self.assertTrue({"workers", "deadline scale", "max active", "ideal", "ste"} <= set(names), names)

    def test_report(self):
        self.run_plan(self.plan(), "done")
        result = self.expect(redag("report", self.folder / "done"), 0)
        self.assertIn("small: 52 of 52 runs, 26 combinations, 0 violations of the model", result.stdout)
        self.assertIn("<title>small - ReDAG-RT report</title>", (self.folder / "done" / "report.html").read_text())
        document = json.loads(self.expect(redag("report", self.folder / "done", "--json"), 0).stdout)
        self.assertEqual((document["kind"], len(document["points"])), ("factorial", 26))
        self.expect(redag("report", self.folder / "done", self.folder / "done"), 2, "name one folder")
        (self.folder / "done" / "factorial.json").write_text("{}")
        self.expect(redag("report", self.folder / "done"), 2, "factorial.json: error: is no redag.experiment.factorial/1")
        self.run_plan(self.folder / "done" / "plan.yaml", "done")  # a page in the folder is no stranger

    def test_plan_in_the_folder_is_whole(self):
        """A folder can be gone on with where the workload's file is not."""
        self.run_plan(self.plan(), "done")
        (self.folder / "cart.yaml").unlink()
        (self.folder / "elsewhere").mkdir()
        plan = self.folder / "elsewhere" / "plan.yaml"
        plan.write_text((self.folder / "done" / "plan.yaml").read_text())
        self.run_plan(plan, "again")
        self.assertEqual(self.results("done"), self.results("again"))

    def test_killed_and_gone_on(self):
        plan = self.plan(repetitions=12, duration="20s")
        for _ in range(2):
            process = self.start(plan, "killed")
            process.kill()
            process.communicate()
        with open(self.folder / "killed" / "units.csv", "a") as units:
            units.write("311,[1")  # the kill came in the middle of a line
        self.assertRegex(self.run_plan(plan, "killed").stderr, r"\d+ of 312 runs are done already")
        self.run_plan(plan, "whole")
        self.assertEqual(self.results("killed"), self.results("whole"))

    def test_ctrl_c_keeps_what_is_done(self):
        process = self.start(self.plan(repetitions=200, duration="20s"), "stopped")
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, error)
        self.assertIn("interrupted: the results so far are kept; the same command goes on", error)
        self.assertIn("of 5 200 runs are done", out)
        document = json.loads((self.folder / "stopped" / "factorial.json").read_text())
        self.assertFalse(document["complete"])
        self.assertEqual(document["done"], self.results("stopped")[2].count("\n") - 2)

    def test_other_jobs_are_another_plan(self):
        plan = self.plan()
        self.run_plan(plan, "done")
        self.write("cart.yaml", CART.replace("25ms", "26ms"))
        self.assertIn("the folder holds results of another plan", self.run_plan(plan, "done", status=2).stderr)

    def test_damaged_results(self):
        plan = self.plan()
        self.run_plan(plan, "damaged")
        units = self.folder / "damaged" / "units.csv"
        units.write_text(units.read_text() + "52,[]\n")
        self.assertIn("unit 52: the plan has no such unit", self.run_plan(plan, "damaged", status=2).stderr)

    def test_bad_input(self):
        bad = self.write("bad.yaml", "experiment: factorial\nworkers: two\nexecutors: [redga]\nworkloads: [cart.yaml]\n")
        self.expect(redag("experiment", "factorial", bad), 2, "bad.yaml:2:10: error: workers must be a whole number")
        bad = self.write("bad.yaml", "experiment: factorial\nexecutors: [redga]\nworkloads: [cart.yaml]\n")
        self.expect(redag("experiment", "factorial", bad), 2, "did you mean 'redag'?")
        self.write("cart.yaml", CART.replace("25ms", "25"))
        result = self.expect(redag("experiment", "factorial", self.plan()), 2, "plan.yaml:5:13: error: the workload")
        self.assertIn("cart.yaml:7:", result.stderr)
        self.expect(redag("experiment", "factorial"), 2, "PLAN")
        self.expect(redag("experiment", "factorial", "/no/such.yaml"), 2, "/no/such.yaml")
        threads = self.write("threads.yaml", "experiment: factorial\nworld: threads\nexecutors: [redag]\n"
                             "workloads: [{name: a, text: \"" + CART.replace("\n", "\\n") + "\"}]\n")
        self.expect(redag("experiment", "factorial", threads, "--shard", "1/2"), 2, "belong to one machine")

    def test_threads(self):
        """Real runs: one after the other, the ideal beside them in virtual time."""
        plan = self.write("plan.yaml", "experiment: factorial\nworld: threads\nduration: 300ms\nrepetitions: 2\n"
                          "workloads: cart.yaml\nexecutors: [ideal, redag-none, mte]\n")
        result = self.run_plan(plan, "threads", "-j4")
        self.assertIn("on 1 core", result.stderr)
        rows = list(csv.DictReader(self.results("threads")[1].splitlines()))
        self.assertEqual({(row["executor"], row["world"]) for row in rows},
                         {("ideal", "simulator"), ("redag-none", "threads"), ("mte", "threads")})
        fast = [row for row in rows if row["dag"] == "fast"]
        self.assertEqual(len(fast), 6)
        for row in fast:  # 30 releases of sense, and one of act for each that ran
            self.assertGreaterEqual(int(row["released"]), 30)
            self.assertLessEqual(int(row["released"]), 60)

    def test_ros2(self):
        """What stands in for run_workload here simulates; with the real one it is the same command line."""
        plan = self.write("plan.yaml", "experiment: factorial\nworld: ros2\nduration: 500ms\nrepetitions: 2\nworkers: [1, 2]\n"
                          "workloads: cart.yaml\nexecutors: [ideal, redag-none, mte, ste]\n")
        program = self.write("run_workload", f"""#!/bin/sh
executor=${{2#--executor=}} duration=${{3#--duration=}} warm_up=${{4#--warm-up=}} seed=${{5#--seed=}} out=${{6#--out=}}
exec "{PROGRAM}" simulate "$1" --executor "$executor" --duration "$duration" --warmup "$warm_up" --seed "$seed" --out "$out"
""")
        program.chmod(0o755)
        self.run_plan(plan, "ros2", "--run-workload", program)
        rows = [row for row in csv.DictReader(self.results("ros2")[1].splitlines()) if row["dag"] == "total"]
        self.assertEqual(len(rows), (2 + 2 + 2 + 1) * 2)
        self.assertTrue(all(int(row["released"]) > 100 for row in rows))
        program.write_text("#!/bin/sh\necho error: no such thing >&2\nexit 2\n")
        self.assertIn("failed; it said: error: no such thing", self.run_plan(plan, "bad", "--run-workload", program,
                                                                           status=2).stderr)
        self.assertIn("source the workspace", self.run_plan(plan, "worse", "--run-workload", "/no/such", status=2).stderr)

    def test_plans_of_this_repository(self):
        plans = sorted((SOURCE / "experiments" / "paper").glob("*.yaml"))
        self.assertGreater(len(plans), 5)
        for plan in plans:
            if "world: ros2" in plan.read_text():
                continue
            with self.subTest(plan=plan.name):
                process = subprocess.Popen([PROGRAM, "experiment", "factorial", plan, "--out", self.folder / plan.stem],
                                           stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                time.sleep(0.3)
                process.send_signal(signal.SIGINT)
                _, error = process.communicate(timeout=120)
                self.assertEqual(process.returncode, 0, error)
                self.assertTrue((self.folder / plan.stem / "factorial.json").exists())


if __name__ == "__main__":
    PROGRAM, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
