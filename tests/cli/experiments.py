#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag experiment` from outside: the way in which it runs does not change its results.

Usage: experiments.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import contextlib
import csv
import json
import os
import re
import signal
import sqlite3
import subprocess
import unittest
import xml.etree.ElementTree

from program import CART, PROGRAM, SANITIZED, SOURCE, Case, changed_run, in_terminal, interrupt, main, redag, units,\
    wait_for_units

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


def start(case, folder, *arguments):
    """Starts an experiment that takes some seconds. Returns it once it has written units."""
    runs = folder / "runs.jsonl"
    begins = runs.read_text().count('"event":"begin"') if runs.exists() else 0
    process = subprocess.Popen([PROGRAM, "experiment", *map(str, arguments), "--out", folder],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for_units(case, process, folder, begins + 1)
    return process


def change_units(folder, statement, *values):
    with contextlib.closing(sqlite3.connect(folder / "units.db")) as database:
        database.execute(statement, values)
        database.commit()


class Acceptance(Case):
    """`redag experiment acceptance`."""
    PLAN = ["--dags", "6", "--workers", "2", "--utilization", "0.2:0.8:0.2", "--methods", "any,simulation,melani"]

    def acceptance(self, name, *arguments, status=0):
        return self.expect(redag("experiment", "acceptance", *self.PLAN, "--out", self.folder / name, *arguments), status)

    def results(self, name):
        texts = [(self.folder / name / file).read_text() for file in ("acceptance.csv", "acceptance.svg")]
        return [texts[0], units(self.folder / name), texts[1]]

    def start(self, name, *arguments):
        return start(self, self.folder / name, "acceptance", *self.PLAN, *arguments)

    def test_same_results_for_any_number_of_jobs_and_shards(self):
        self.acceptance("one", "--sets", "20", "-j1")
        self.acceptance("two", "--sets", "20", "-j2")
        self.assertEqual(self.results("one"), self.results("two"))
        for shard in ("1", "2", "3"):
            self.acceptance(f"shard{shard}", "--sets", "20", "--shard", f"{shard}/3")
        folders = [self.folder / f"shard{shard}" for shard in (3, 1, 2)]
        self.expect(redag("experiment", "merge", *folders, "-o", self.folder / "merged"), 0)
        self.assertEqual(self.results("one"), self.results("merged"))
        runs = json.loads((self.folder / "merged" / "acceptance.json").read_text())["runs"]
        self.assertEqual([run["shard"] for run in runs if run["event"] == "begin"], ["3/3", "1/3", "2/3"])
        self.assertTrue(runs[0]["machine"]["kernel"])

        rows = list(csv.DictReader(self.results("one")[0].splitlines()))
        self.assertEqual(len(rows), 2 * 4 * 3)
        self.assertTrue(all(row["sets"] == "20" for row in rows))
        self.acceptance("other", "--sets", "20", "--seed", "6")
        self.assertNotEqual(self.results("one")[1], self.results("other")[1])

    def test_merging_what_is_not_all_there(self):
        self.acceptance("first", "--sets", "4", "--shard", "1/2")
        result = redag("experiment", "merge", self.folder / "first", self.folder / "first", "-o", self.folder / "merged")
        self.expect(result, 0, "16 of 32 workloads are missing from the folders")
        self.assertIn("16 of 32 workloads are done", result.stdout)
        plan = self.folder / "merged" / "plan.yaml"
        self.expect(redag("experiment", "acceptance", plan, "--out", self.folder / "merged"), 0)
        self.acceptance("whole", "--sets", "4")
        self.assertEqual(self.results("whole")[0], self.results("merged")[0])
        again = redag("experiment", "merge", self.folder / "first", "-o", self.folder / "merged")
        self.expect(again, 2, "already holds results")

        self.acceptance("other", "--sets", "5")
        result = redag("experiment", "merge", self.folder / "first", self.folder / "other", "-o", self.folder / "x")
        self.expect(result, 2, "another plan: 'sets: 5' there, 'sets: 4' now")

    def test_killed_and_gone_on(self):
        size = ["--sets", "40", "--simulation-periods", "40", "-j1"]
        for _ in range(2):
            process = self.start("killed", *size)
            process.kill()
            process.communicate()
        result = self.acceptance("killed", *size)
        self.assertRegex(result.stderr, r"\d+ of 320 workloads are done already")
        self.acceptance("whole", *size[:-1], "-j2")
        self.assertEqual(self.results("killed"), self.results("whole"))
        document = json.loads((self.folder / "killed" / "acceptance.json").read_text())
        self.assertEqual([run["event"] for run in document["runs"]], ["begin", "begin", "begin", "end"])
        self.assertTrue(document["complete"])

    def test_ctrl_c_keeps_what_is_done(self):
        size = ["--sets", "2000", "--simulation-periods", "40"]
        process = self.start("stopped", *size)
        second = redag("experiment", "acceptance", *self.PLAN, *size, "--out", self.folder / "stopped")
        self.expect(second, 2, "another process is writing to this folder")
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, error)
        self.assertIn("interrupted", error)
        self.assertIn("workloads are done", out)
        document = json.loads((self.folder / "stopped" / "acceptance.json").read_text())
        self.assertFalse(document["complete"])
        self.assertEqual(document["done"], len(self.results("stopped")[1]))
        self.assertTrue(document["runs"][-1]["interrupted"])

    def test_report(self):
        """The page counts the units of the folder, also those of a run that was killed and wrote no results."""
        self.acceptance("first", "--sets", "4", "--shard", "1/2")
        self.acceptance("second", "--sets", "4", "--shard", "2/2")
        self.expect(redag("experiment", "merge", self.folder / "first", self.folder / "second", "-o",
                          self.folder / "merged"), 0)
        for file in ("acceptance.csv", "acceptance.json"):
            (self.folder / "merged" / file).unlink()
        result = self.expect(redag("report", self.folder / "merged"), 0)
        self.assertIn("acceptance: 32 of 32 workloads, 0 violations", result.stdout)
        page = (self.folder / "merged" / "report.html").read_text()
        for words in ("<title>acceptance - ReDAG-RT report</title>", "<svg", "<td>1/2</td>", "<td>2/2</td>"):
            self.assertIn(words, page)
        document = self.document(redag("report", self.folder / "merged", "--json"), "redag.experiment.acceptance/1")
        self.assertEqual((document["done"], len(document["points"])), (32, 8))
        self.expect(redag("report", self.folder / "merged", self.folder / "first"), 2, "name this folder alone")
        (self.folder / "merged" / "units.db").write_text("")
        self.expect(redag("report", self.folder / "merged"), 2, "units.db")

    def test_another_plan_is_refused(self):
        self.acceptance("done", "--sets", "2")
        before = self.results("done")
        result = self.acceptance("done", "--sets", "3", status=2)
        self.assertIn("plan.yaml:4:1: error: the folder holds results of another plan: 'sets: 2' there, 'sets: 3' now",
                      result.stderr)
        self.assertIn("choose another folder", result.stderr)
        self.assertEqual(before, self.results("done"))

    def test_plan_file_and_options(self):
        plan = self.write("plan.yaml", "experiment: acceptance\nname: mine\ndags: 3\nworkers: 2\nsets: 2\n"
                          "utilization: [0.1, 0.5]\nworkload: {tasks: {min: 2, max: 4}}\n")
        document = self.document(redag("experiment", "acceptance", plan, "--sets", "3", "--json"),
                                 "redag.experiment.acceptance/1")
        self.assertEqual((document["name"], document["done"], document["complete"]), ("mine", 12, True))
        self.assertIn("sets: 3\n", document["plan"])
        self.assertEqual(document["violations"], [])
        self.expect(redag("experiment", "acceptance", plan, "--out", self.folder / "out"), 0)
        picture = xml.etree.ElementTree.parse(self.folder / "out" / "acceptance.svg").getroot()
        texts = [text.text for text in picture.iter("{http://www.w3.org/2000/svg}text")]
        self.assertIn("mine: schedulable workloads", texts)
        self.assertIn("3 DAGs, 2 workers, full preemption", texts)

    def test_violation_is_an_error_with_a_replay(self):
        """A miss is changed to look as if a bound had accepted the workload."""
        self.acceptance("forged", "--sets", "2")
        number, missed = next(row for row in units(self.folder / "forged") if row[1].startswith("00"))
        change_units(self.folder / "forged", "UPDATE units SET result = ? WHERE unit = ?", "1" + missed[1:], number)
        result = self.acceptance("forged", "--sets", "2", status=1)
        self.assertIn(f"error: unit {number} (6 DAGs, 2 workers, ", result.stderr)
        self.assertIn("misses a deadline in simulation, although it is accepted by any", result.stderr)
        replay = self.folder / "forged" / f"violation-{number}.yaml"
        options = re.search(r"^# redag simulate THIS_FILE (.*)$", replay.read_text(), re.M)[1].split()
        self.expect(redag("simulate", replay, *options, "--check"), 1)

    def test_bad_input(self):
        bad = self.write("bad.yaml", "experiment: acceptance\nworkers: two\nmethods: [gaun]\n")
        self.expect(redag("experiment", "acceptance", bad), 2, "bad.yaml:2:10: error: workers must be a whole number")
        for arguments, words in [(["--methods", "gaun"], "did you mean 'guan'?"), (["--shard", "3/2"], "--shard: '3/2'"),
                                 (["--shard", "auto"], "--shard: 'auto' is the share of a task of Slurm"),
                                 (["--utilization", "1:0:1"], "--utilization: '1:0:1'"), (["--sets", "0"], "--sets: '0' is not a whole number from 1"),
                                 (["--workers", "0"], "--workers: '0'"), (["--dags", "2"], "2 DAGs, 4 workers"),
                                 (["--preemption", "auto"], "choose none or os"), (["--set", "1"], "--sets"),
                                 (["/no/such.yaml"], "/no/such.yaml")]:
            self.expect(redag("experiment", "acceptance", *arguments), 2, words)
        self.expect(redag("experiment"), 2, "redag experiment --help")
        self.expect(redag("experiment", "merge", self.folder, "-o", self.folder / "x"), 2, "plan.yaml")
        self.expect(redag("experiment", "acceptance", *self.PLAN, "--out", self.folder), 2, "is not a result of redag")
        damaged = self.folder / "damaged"
        self.acceptance("damaged", "--sets", "1")
        change_units(damaged, "UPDATE units SET result = 'x' WHERE unit = 2")
        self.assertIn("the plan has no unit 2 with result 'x'", self.acceptance("damaged", "--sets", "1", status=2).stderr)
        (damaged / "units.db").write_text("unit,result\n" * 50)
        self.assertIn("units.db: error: is damaged or no database", self.acceptance("damaged", "--sets", "1",
                                                                                    status=2).stderr)
        (damaged / "units.db").rename(damaged / "units.csv")
        self.assertIn("units.csv: error: holds results of an earlier version", self.acceptance(
            "damaged", "--sets", "1", "--force", status=2).stderr)

    def test_progress_on_a_terminal(self):
        status, text = in_terminal("experiment", "acceptance", *self.PLAN, "--sets", "300", columns=100)
        self.assertEqual(status, 0, text)
        self.assertRegex(text, r"\d+ %  [\d ]+ of 2 400, \d+/s, \S+ left")


class Jobs(Case):
    """`redag experiment cost` and `submit`, with a substitute for sbatch. slurm.py has the real one."""
    def setUp(self):
        super().setUp()
        self.plan = self.write("plan.yaml", "# What is asked.\nexperiment: acceptance\nname: small\nsets: 10\n"
                               "utilization: [0.2, 0.5]\ndags: 4\nworkers: 2\npreemption: none\n")

    def submit(self, plan, *options, status=0, sbatch="echo 17"):
        script = self.write("sbatch", f"#!/bin/sh\necho \"$@\" >>{self.folder}/calls\n{sbatch}\n")
        script.chmod(0o755)
        environment = os.environ | {"PATH": f"{self.folder}:{os.environ['PATH']}"}
        return self.expect(redag("experiment", "submit", plan, "--out", self.folder / "jobs", *options, env=environment),
                           status)

    def test_cost(self):
        result = self.expect(redag("experiment", "cost", self.plan), 0)
        self.assertRegex(result.stdout, r"^20 workloads, \S+ each \(\+- \S+; 20 of them measured\): \S+ hours of a processor")
        self.expect(redag("experiment", "cost", "/no/such.yaml"), 2, "/no/such.yaml")
        threads = self.write("threads.yaml", "experiment: factorial\nworld: threads\nexecutors: [redag]\n"
                             "workloads: [cart.yaml]\n")
        self.expect(redag("experiment", "cost", threads), 2, "only simulated experiments can be shared")

    def test_submit(self):
        result = self.submit(self.plan, "--slurm")
        self.assertIn("1 shard, and a job that merges them", result.stdout)
        self.assertIn("submit them with: sh ", result.stdout)
        self.assertFalse((self.folder / "calls").exists())
        # The same command goes on; --now submits.
        result = self.submit(self.plan, "--slurm", "--now")
        self.assertIn("go on where they ended", result.stdout)
        self.assertIn("array job 17, merge job 17", result.stdout)
        self.assertEqual((self.folder / "calls").read_text(),
                         "--parsable shard.sbatch\n--parsable --dependency=afterany:17 merge.sbatch\n")
        # The scripts work without Slurm, too.
        for script, variables in (("shard.sbatch", {"SLURM_ARRAY_TASK_ID": "1"}), ("merge.sbatch", {})):
            subprocess.run(["sh", script], cwd=self.folder / "jobs", env=os.environ | variables, check=True,
                           capture_output=True)
        self.assertEqual(len(units(self.folder / "jobs" / "merged")), 20)

    def test_bad_input(self):
        self.assertIn("add --slurm", self.submit(self.plan, status=2).stderr)
        result = self.submit(self.plan, "--slurm", "--shards", "4", "--now", status=2, sbatch="echo no partition >&2; exit 1")
        self.assertIn("no partition", result.stderr)
        self.assertIn("Slurm did not take the jobs", result.stderr)
        other = self.write("other.yaml", self.plan.read_text().replace("sets: 10", "sets: 11"))
        self.assertIn("'sets: 10' there, 'sets: 11' now", self.submit(other, "--slurm", status=2).stderr)
        self.expect(redag("experiment", "submit", self.plan, "--slurm", "--out", self.folder), 2, "not a result of redag")


class Factorial(Case):
    """`redag experiment factorial`."""
    def setUp(self):
        super().setUp()
        self.write("cart.yaml", CART.replace("wcet: 25ms", "wcet: 25ms, bcet: 15ms"))

    def plan(self, repetitions=2, duration="1s", name="plan.yaml"):
        return self.write(name, PLAN.format(repetitions=repetitions, duration=duration))

    def run_plan(self, plan, name, *arguments, status=0):
        return self.expect(redag("experiment", "factorial", plan, "--out", self.folder / name, *arguments), status)

    def results(self, name):
        return [(self.folder / name / file).read_text()
                for file in ("factorial.csv", "observations.csv", "factorial.svg")] + [units(self.folder / name)]

    def start(self, plan, name):
        return start(self, self.folder / name, "factorial", plan, "-j1")

    def test_same_results_for_any_number_of_jobs_and_shards(self):
        plan = self.plan()
        result = self.run_plan(plan, "one", "-j1")
        self.assertIn("no violation of the model; every max_active bound was kept", result.stdout)
        self.assertIn("workers x deadline_scale", result.stdout)
        self.run_plan(plan, "two", "-j2")
        self.assertEqual(self.results("one"), self.results("two"))
        for shard in ("1", "2"):
            self.run_plan(plan, f"shard{shard}", "--shard", f"{shard}/2")
        self.expect(redag("experiment", "merge", self.folder / "shard1", self.folder / "shard2", "-o",
                          self.folder / "merged"), 0)
        self.assertEqual(self.results("one"), self.results("merged"))

        rows = list(csv.DictReader(self.results("one")[0].splitlines()))
        # Factors of ideal and mte: workers x deadlines; of redag and redag-none: bounds as well; of ste: deadlines.
        # Each has two DAGs and the total.
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
        self.expect(redag("report", self.folder / "done", self.folder / "done"), 2, "name this folder alone")
        (self.folder / "done" / "factorial.json").write_text("{}")
        self.expect(redag("report", self.folder / "done"), 2, "factorial.json: error: is not a redag.experiment.factorial/2")
        self.run_plan(self.folder / "done" / "plan.yaml", "done")  # an earlier page is accepted

    def test_plan_in_the_folder_is_whole(self):
        """An experiment can continue in a folder where its workload's file is missing."""
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
        self.assertRegex(self.run_plan(plan, "killed").stderr, r"\d+ of 312 runs are done already")
        self.run_plan(plan, "whole")
        self.assertEqual(self.results("killed"), self.results("whole"))

    def test_ctrl_c_keeps_what_is_done(self):
        process = self.start(self.plan(repetitions=200, duration="20s"), "stopped")
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, error)
        self.assertIn("interrupted: the results so far are kept; run the same command to resume", error)
        self.assertIn("of 5 200 runs are done", out)
        document = json.loads((self.folder / "stopped" / "factorial.json").read_text())
        self.assertFalse(document["complete"])
        self.assertEqual(document["done"], len(self.results("stopped")[3]))

    def test_other_jobs_are_another_plan(self):
        plan = self.plan()
        self.run_plan(plan, "done")
        self.write("cart.yaml", CART.replace("25ms", "26ms"))
        self.assertIn("the folder holds results of another plan", self.run_plan(plan, "done", status=2).stderr)

    def test_damaged_results(self):
        plan = self.plan()
        self.run_plan(plan, "damaged")
        change_units(self.folder / "damaged", "INSERT INTO units VALUES(52, '[]')")
        self.assertIn("unit 52: the plan has no such unit", self.run_plan(plan, "damaged", status=2).stderr)

    def test_bad_input(self):
        bad = self.write("bad.yaml", "experiment: factorial\nworkers: two\nexecutors: [redga]\nworkloads: [cart.yaml]\n")
        self.expect(redag("experiment", "factorial", bad), 2, "bad.yaml:2:10: error: workers must be a whole number")
        bad = self.write("bad.yaml", "experiment: factorial\nexecutors: [redga]\nworkloads: [cart.yaml]\n")
        self.expect(redag("experiment", "factorial", bad), 2, "did you mean 'redag'?")
        self.write("cart.yaml", CART.replace("25ms", "25"))
        result = self.expect(redag("experiment", "factorial", self.plan()), 2, "plan.yaml:5:13: error: the workload")
        self.assertIn("cart.yaml:7:", result.stderr)
        self.write("cart.yaml", (SOURCE / "workloads" / "clusters.yaml").read_text())
        self.expect(redag("experiment", "factorial", self.plan()), 2, "an experiment")
        self.expect(redag("experiment", "factorial"), 2, "PLAN")
        self.expect(redag("experiment", "factorial", "/no/such.yaml"), 2, "/no/such.yaml")
        threads = self.write("threads.yaml", "experiment: factorial\nworld: threads\nexecutors: [redag]\n"
                             "workloads: [{name: a, text: \"" + CART.replace("\n", "\\n") + "\"}]\n")
        self.expect(redag("experiment", "factorial", threads, "--shard", "1/2"), 2, "depend on one machine")

    def test_threads(self):
        """Real runs take turns. The ideal runs beside them in virtual time."""
        plan = self.write("plan.yaml", "experiment: factorial\nworld: threads\nduration: 300ms\nrepetitions: 2\n"
                          "workloads: cart.yaml\nexecutors: [ideal, redag-none, mte]\n")
        result = self.run_plan(plan, "threads", "-j4")
        self.assertIn("a second on 1 processor", result.stderr)
        rows = list(csv.DictReader(self.results("threads")[1].splitlines()))
        self.assertEqual({(row["executor"], row["world"]) for row in rows},
                         {("ideal", "simulator"), ("redag-none", "threads"), ("mte", "threads")})
        fast = [row for row in rows if row["dag"] == "fast"]
        self.assertEqual(len(fast), 6)
        for row in fast:  # 30 releases of sense, and one of act for each that ran
            self.assertGreaterEqual(int(row["released"]), 30)
            self.assertLessEqual(int(row["released"]), 60)

    def test_ros2(self):
        """A substitute for run_workload simulates here. The command line is that of the real program."""
        plan = self.write("plan.yaml", "experiment: factorial\nworld: ros2\nduration: 500ms\nrepetitions: 2\nworkers: [1, 2]\n"
                          "workloads: cart.yaml\nexecutors: [ideal, redag-none, mte, ste]\n")
        program = self.write("run_workload", f"""#!/bin/sh
executor=${{2#--executor=}} duration=${{3#--duration=}} warm_up=${{4#--warm-up=}} seed=${{5#--seed=}} out=${{6#--out=}}
exec "{PROGRAM}" simulate "$1" --executor "$executor" --duration "$duration" --warm-up "$warm_up" --seed "$seed" --out "$out"
""")
        program.chmod(0o755)
        self.run_plan(plan, "ros2", "--run-workload", program)
        rows = [row for row in csv.DictReader(self.results("ros2")[1].splitlines()) if row["dag"] == "total"]
        self.assertEqual(len(rows), (2 + 2 + 2 + 1) * 2)
        self.assertTrue(all(int(row["released"]) > 100 for row in rows))
        program.write_text("#!/bin/sh\necho error: no such thing >&2\nexit 2\n")
        self.assertIn("failed with this message: error: no such thing", self.run_plan(plan, "bad", "--run-workload", program,
                                                                           status=2).stderr)
        self.assertIn("source the workspace", self.run_plan(plan, "worse", "--run-workload", "/no/such", status=2).stderr)

    def test_recorded_runs_become_part_of_an_experiment(self):
        """Creates a substitute for run_workload: it simulates, and reports that nodes ran the workload."""
        cart = self.folder / "cart.yaml"
        self.run_plan(self.write("plan.yaml", "experiment: factorial\nduration: 500ms\nrepetitions: 2\n"
                                 "workloads: cart.yaml\nexecutors: [ideal, mte]\n"), "simulated")
        for run in ("1", "2"):
            place = self.folder / "recorded" / "mte" / run
            self.expect(redag("simulate", cart, "--executor", "mte", "--duration", "500ms", "--seed", run,
                              "--out", place), 0)
            events = place / "events.redag"
            events.write_bytes(changed_run(events.read_bytes(), '"driver":"simulator"', '"driver":"ros_nodes"'))
        both = ("experiment", "merge", self.folder / "simulated", self.folder / "recorded")
        self.expect(redag(*both, "--out", self.folder / "both"), 0)
        rows = {(row["executor"], row["world"]) for row in csv.DictReader(self.results("both")[1].splitlines())}
        self.assertEqual(rows, {("ideal", "simulator"), ("mte", "simulator"), ("ros2/mte", "ros_nodes")})
        self.assertIn("6 of 6", self.expect(redag("report", self.folder / "both", "-o", self.folder / "both.html"), 0).stdout)
        self.assertIn("there are more runs of", self.expect(redag(*both, self.folder / "recorded", "--out", self.folder / "twice"), 2).stderr)
        self.assertIn("name the folder of the experiment", self.expect(
            redag("experiment", "merge", self.folder / "recorded", "--out", self.folder / "alone"), 2).stderr)

    @unittest.skipIf(SANITIZED, "a unit of some plans takes minutes there")
    def test_plans_of_this_repository(self):
        plans = sorted((SOURCE / "experiments" / "paper").glob("*.yaml"))
        self.assertGreater(len(plans), 5)
        for plan in plans:
            if "world: ros2" in plan.read_text():
                continue
            with self.subTest(plan=plan.name):
                process = subprocess.Popen([PROGRAM, "experiment", "factorial", plan, "--out", self.folder / plan.stem],
                                           stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                interrupt(process, 0.3)
                _, error = process.communicate(timeout=120)
                self.assertEqual(process.returncode, 0, error)
                self.assertTrue((self.folder / plan.stem / "factorial.json").exists())


if __name__ == "__main__":
    main()
