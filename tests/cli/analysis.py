#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag analyze` and `tune --judge bounds`.

Usage: analysis.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import re
import subprocess

from program import CART, MISTAKEN, PROGRAM, SANITIZED, SOURCE, Case, body, in_terminal, interrupt, main, redag

# Harmonic, U = 1/4 + 1/8 + 1/8: on one worker, rate-monotonic priorities schedule everything up to U = 1.
HARMONIC = """\
name: harmonic
platform: {workers: 1, preemption: os}
dags:
  - name: a
    tasks: [{name: t, wcet: 1ms, period: 4ms}]
  - name: b
    tasks: [{name: t, wcet: 1ms, period: 8ms}]
  - name: c
    tasks: [{name: t, wcet: 2ms, period: 16ms}]
"""
# With priorities by rate, b answers after 5 ms; with priorities by deadline, after 2 ms.
SHORT_DEADLINE = """\
name: short
platform: {workers: 1, preemption: os}
# a comment, which is kept
dags:
  - name: a
    tasks: [{name: t, wcet: 3ms, bcet: 1ms, period: 10ms}]
  - name: b
    tasks: [{name: t, wcet: 2ms, period: 20ms, deadline: 4ms, group: bus}]
"""

CLUSTERS = """\
name: clusters
platform:
  clusters:
    - {name: left, cpus: 0}
    - {name: right, cpus: 1}
dags:
  - {name: a, cluster: left, period: 10ms, tasks: [{name: t, wcet: 6ms, region: 1ms}]}
  - {name: b, cluster: right, period: 10ms, tasks: [{name: t, wcet: 5ms, region: 1ms}]}
  - {name: c, cluster: left, period: 20ms, tasks: [{name: t, wcet: 3ms, region: 1ms}]}
"""


class Clusters(Case):
    def setUp(self):
        super().setUp()
        self.clusters = self.write("clusters.yaml", CLUSTERS)

    def test_are_analysed_one_by_one(self):
        text = self.expect(redag("analyze", self.clusters, "--check"), 0).stdout
        self.assertRegex(text, r"(?s)^cluster left: worker 0, processors 0\nclusters: schedulable: .*\n\n"
                               r"cluster right: worker 1, processors 1\nclusters: schedulable: ")
        document = self.document(redag("analyze", self.clusters, "--json"), "redag.cluster_analysis/1")
        self.assertTrue(document["schedulable"])
        self.assertEqual([cluster["name"] for cluster in document["clusters"]], ["left", "right"])
        tasks = [task["name"] for cluster in document["clusters"] for task in cluster["analysis"]["tasks"]]
        self.assertEqual(tasks, ["a.t", "c.t", "b.t"])
        late = self.write("late.yaml", CLUSTERS.replace("wcet: 5ms", "wcet: 11ms"))
        self.expect(redag("analyze", late, "--check"), 1)

    def test_one_task_of_a_cluster(self):
        text = self.expect(redag("analyze", self.clusters, "--explain", "b.t"), 0).stdout
        self.assertTrue(text.startswith("b.t: response time at most 5ms"), text)
        self.expect(redag("analyze", self.clusters, "--explain", "d.t"), 2, "there is no task or DAG 'd.t'")
        self.expect(redag("analyze", self.clusters, "--explain", "b.tt"), 2, "did you mean 'b.t'?")
        self.expect(redag("analyze", self.clusters, "--chain", "a.t,b.t"), 2,
                    "--chain: 'a.t' is in cluster 'left', and 'b.t' in cluster 'right'", "within one cluster")
        self.expect(redag("analyze", self.clusters, "--chain", "b.t,d.t"), 2, "there is no task or DAG 'd.t'")
        self.assertIn("b.t", self.expect(redag("analyze", self.clusters, "--chain", "b.t"), 0).stdout)
        self.assertIn("a.t > c.t", self.expect(redag("analyze", self.clusters, "--chain", "a.t,c.t"), 0).stdout)

    def test_run_without_a_miss(self):
        for command in ("simulate", "--executor", "redag"), ("simulate", "--executor", "redag-none"):
            document = self.document(redag(command[0], self.clusters, *command[1:], "--duration", "1s", "--json"),
                                     "redag.summary/2")
            self.assertTrue(document["check"]["ok"])
        compared = redag("compare", self.clusters, "--simulate", "--executors", "redag,mte,ste", "--duration", "1s", "--json")
        self.assertEqual(len(self.document(compared, "redag.comparison/3")["executors"]), 3)

    def test_commands_that_refuse(self):
        self.expect(redag("simulate", self.clusters, "--workers", "2"), 2, "--workers: the platform has clusters")
        self.expect(redag("tune", self.clusters), 2, "tune cannot use a workload with clusters")


class Analyze(Case):
    def test_table_and_verdict(self):
        result = self.expect(redag("analyze", self.cart, "--all"), 0)
        # One worker, run to completion: plan (25 ms) blocks fast, whose period is 10 ms.
        self.assertRegex(result.stdout, r"fast\.sense +10ms +29ms +- +may lose jobs +by_demand")
        self.assertRegex(result.stdout, r"slow\.plan +100ms +\S+ms +\S+ms +ok +rta_nonpreemptive")
        self.assertIn("preemption: none\n", result.stdout)
        self.assertIn("not shown schedulable: 2 tasks whose jobs can be lost", result.stdout)
        self.assertRegex(result.stdout, r"methods that do not apply:\n(.*\n)*  \S.*\n    .*\bdag_bounded\b")

    def test_three_lines(self):
        lines = self.expect(redag("analyze", self.cart), 0).stdout.splitlines()
        self.assertEqual(lines[0].split(":")[:2], ["cart", " not shown schedulable"])
        self.assertRegex(lines[1], r"^weakest: fast\.\w+, deadline 10ms, jobs can be lost: ")
        self.assertEqual(lines[2], "suggested change: preemption: os, so that urgent jobs do not wait for others to end; "
                                   "then every deadline is shown to be met")
        self.assertRegex(lines[4], r"^--all shows every task and method; --explain fast\.\w+ explains")
        self.assertEqual((lines[3], len(lines)), ("preemption: none", 5))
        lines = self.expect(redag("analyze", self.cart, "--preemption", "os"), 0).stdout.splitlines()
        self.assertTrue(lines[0].startswith("cart: schedulable: every deadline is met, by "), lines)
        self.assertRegex(lines[1], r"^weakest: \S+, deadline \S+, bound \S+, slack \S+ \(\d+\.\d %\), by \w+$")
        self.assertEqual(len(lines), 4)

    def test_suggestion_holds(self):
        # A task of a lower rate holds the shared group too long for the task of the higher rate.
        text = """\
name: shared
platform: {workers: 2, preemption: os}
dags:
  - name: quick
    tasks: [{name: t, wcet: 4ms, period: 10ms, group: device}]
  - name: slow
    tasks: [{name: t, wcet: 6.3ms, period: 50ms, group: device}]
"""
        file = self.write("shared.yaml", text)
        output = self.expect(redag("analyze", file), 0).stdout
        found = re.search(r"suggested change: wcet of slow\.t: (\S+) instead of 6\.3ms; then every deadline", output)
        self.assertTrue(found, output)
        self.expect(redag("analyze", self.write("s.yaml", text.replace("6.3ms", found[1])), "--check"), 0)
        explained = self.expect(redag("analyze", file, "--explain", "quick.t"), 0).stdout
        self.assertIn("suggested change: wcet of slow.t: " + found[1], explained)

    def test_robot_has_every_bound(self):
        # Two pipelines share an accelerator. The faster one answers later than its period, but before its deadline.
        robot = json.loads(self.expect(redag("analyze", SOURCE / "workloads" / "robot.yaml", "--json", "--check"), 0).stdout)
        self.assertTrue(all(row["bound_ns"] is not None for row in robot["tasks"] + robot["dags"]))

    def test_the_page_names_every_method(self):
        page = (SOURCE / "docs" / "analysis.md").read_text(encoding="utf-8")
        table = page[page.index("## Which method speaks when"):page.index("## One worker")]
        named = {name for row in re.findall(r"^\| (`.*?) \|", table, re.M) for name in re.findall("`([a-z_]+)`", row)}
        listed = {method["name"] for method in json.loads(redag("analyze", "--methods", "--json").stdout)["methods"]}
        self.assertEqual(named - listed, set(), "methods that are no more")
        for name in listed - named:
            self.assertTrue(name.startswith("paper_") or f"`{name}`" in page, name)

    def test_methods_of_choice(self):
        once = json.loads(self.expect(redag("analyze", self.cart, "--json", "--methods", "--method", "isolated", "--method",
                                            "rta_nonpreemptive"), 0).stdout)
        self.assertEqual([method["name"] for method in once["methods"]], ["rta_nonpreemptive", "isolated"])
        every = json.loads(redag("analyze", self.cart, "--json", "--methods", "--preemption", "os").stdout)
        tightest = {}
        for method in every["methods"]:
            if not method["applies"]:
                self.assertTrue(method["reason"])
                self.assertEqual(method["tasks"], [])
            for task in method["tasks"]:
                self.assertEqual(task["bound_ns"] is None, task["reason"] != "", (method["name"], task))
                if task["bound_ns"] is not None and method["sound"]:
                    tightest[task["name"]] = min(task["bound_ns"], tightest.get(task["name"], task["bound_ns"]))
        self.assertEqual(tightest, {task["name"]: task["bound_ns"] for task in every["tasks"]})
        self.expect(redag("analyze", self.cart, "--method", "isolatd"), 2, "did you mean 'isolated'?")
        self.expect(redag("analyze", self.cart, "--method", "quite_another"), 2, "one of ")
        self.assertNotIn("tasks", json.loads(redag("analyze", self.cart, "--json").stdout)["methods"][0])

    def test_methods_without_a_workload(self):
        methods = self.document(redag("analyze", "--methods", "--json"), "redag.methods/1")["methods"]
        shown = [line.split(" (")[0] for line in redag("analyze", "--methods").stdout.splitlines() if re.match(r"\w+ \(", line)]
        self.assertEqual([method["name"] for method in methods], shown)
        self.assertTrue(all(method["cite"] and method["complexity"] for method in methods))
        stated = re.search(r"by (\d+) published and derived methods", (SOURCE / "README.md").read_text())
        self.assertEqual(int(stated[1]), len(methods), "README.md")
        self.expect(redag("analyze", "--methods", "--json", "--explain", "a.x"), 2, "FILE is required")

    def test_overrides_and_check(self):
        self.expect(redag("analyze", self.cart, "--check"), 1)
        preempted = self.expect(redag("analyze", self.cart, "--check", "--preemption", "os"), 0)
        self.assertIn("schedulable: every deadline is met, by ", preempted.stdout)
        self.expect(redag("analyze", self.cart, "--check", "--preemption", "os", "--policy", "fixed", "--ties", "fixed"), 0)
        self.expect(redag("analyze", self.cart, "--check", "--preemption", "os", "--workers", "2"), 0)
        self.expect(redag("analyze", self.cart, "--check", "--preemption", "os", "--overhead-dispatch", "5ms"), 1)

    def test_edges_between_rates_are_analysed(self):
        contention = SOURCE / "workloads" / "contention.yaml"
        self.expect(redag("analyze", contention, "--check"), 0)
        self.assertIn("waiting for data of other rates",
                      self.expect(redag("analyze", contention, "--explain", "perception"), 0).stdout)

    def test_auto_is_said(self):
        self.assertIn("auto is analysed as os", redag("analyze", SOURCE / "workloads" / "hello.yaml").stdout)
        text = redag("analyze", SOURCE / "workloads" / "hello.yaml", "--preemption", "cooperative", "--all").stdout
        self.assertIn("preemption: cooperative (no task has a region, so this equals none)", text)

    def test_overload_is_certain(self):
        text = redag("analyze", self.write("over.yaml", CART.replace("25ms", "99ms")), "--all").stdout
        self.assertIn("\nnot schedulable: the utilization, 1.190, exceeds the capacity of 1 worker", text)

    def test_explanation(self):
        text = self.expect(redag("analyze", self.cart, "--preemption", "os", "--explain", "slow.plan"), 0).stdout
        # 25 ms of its own, and four times the 2 ms of fast, which is released at 0, 10, 20 and 30 ms.
        self.assertIn("slow.plan: response time at most 33ms, deadline 100ms: ok", text)
        self.assertRegex(text, r"own execution +slow.plan +1 +25ms +75\.8 %")
        self.assertRegex(text, r"interference by +fast +4 +8ms +24\.2 %")
        self.assertIn("the largest contribution is 25ms of 33ms (75.8 %); nothing needs to change", text)
        text = self.expect(redag("analyze", self.cart, "--explain", "fast"), 0).stdout
        self.assertIn("fast: no bound", text)
        self.assertIn("the time after which the next release would skip a job", text)

    def test_chains(self):
        chain = ("--preemption", "os", "--chain", "fast.sense,fast.act,slow.plan", "--chain", "slow.plan")
        text = self.expect(redag("analyze", self.cart, *chain), 0).stdout
        self.assertRegex(text, r"chain +reaction +age +LET\n")
        self.assertIn("\n  fast.sense to fast.act adds ", text)
        document = json.loads(redag("analyze", self.cart, "--json", *chain).stdout)
        first, second = document["chains"]
        self.assertEqual(first["age_ns"], sum(part["period_ns"] + part["response_ns"] for part in first["segments"]))
        self.assertLessEqual(first["reaction_ns"], first["age_ns"])
        # Input that arrives right after the read at 0 is read at 100 ms, and written at that job's deadline.
        self.assertEqual((second["age_ns"], second["let_ns"]), (133_000_000, 200_000_000))
        self.expect(redag("analyze", self.cart, "--chain", "fast.sense,slow.plam"), 2, "did you mean 'slow.plan'?")
        self.expect(redag("analyze", self.cart, "--chain", "fast"), 2, "'fast' is a DAG")
        self.expect(redag("analyze", self.cart, "--chain", "fast.act", "--executor", "ste"), 2, "available for ReDAG-RT only")

    def test_edges_between_rates(self):
        text = CART + "  - name: mixed\n    tasks: [{name: a, wcet: 1ms, period: 50ms}, {name: b, wcet: 1ms, period: 100ms, after: a}]\n"
        mixed = self.write("mixed.yaml", text)
        bounded = json.loads(self.expect(redag("analyze", mixed, "--preemption", "os", "--json", "--chain", "fast.sense,fast.act",
                                               "--chain", "mixed.a,mixed.b"), 0).stdout)["chains"]
        self.assertIsNotNone(bounded[0]["reaction_ns"])
        self.assertEqual([part["first"] for part in bounded[1]["segments"]], ["mixed.a", "mixed.b"])
        self.assertEqual(bounded[1]["age_ns"], sum(part["adds_ns"] for part in bounded[1]["segments"]))

    def test_unknown_task(self):
        self.expect(redag("analyze", self.cart, "--explain", "slow.plam"), 2, "did you mean 'slow.plan'?")
        self.expect(redag("analyze", self.cart, "--explain", "act"), 2, "did you mean 'fast.act'?")
        self.assertEqual(redag("analyze", self.cart, "--json", "--explain", "nobody").stdout, "")

    def test_json(self):
        document = self.document(redag("analyze", self.cart, "--preemption", "os", "--json"), "redag.analysis/1")
        self.assertTrue(document["schedulable"])
        self.assertEqual([task["name"] for task in document["tasks"]], ["fast.sense", "fast.act", "slow.plan"])
        for row in document["tasks"] + document["dags"]:
            self.assertEqual(row["bound_ns"], sum(term["amount_ns"] for term in row["terms"]))
        plan = document["tasks"][2]
        self.assertEqual((plan["bound_ns"], plan["slack_ns"], plan["verdict"]), (33_000_000, 67_000_000, "ok"))
        listed = redag("analyze", "--methods").stdout
        for method in document["methods"]:
            self.assertIn(f"\n{method['name']} (", "\n" + listed)
            if method["paper"] and not method["sound"]:
                self.assertNotIn(method["name"], document["by"])
        explained = json.loads(redag("analyze", self.cart, "--json", "--explain", "slow").stdout)
        self.assertEqual(explained["explanation"]["name"], "slow")

    def test_an_option_that_takes_the_file_for_its_value(self):
        for option in "--explain", "--chain", "--method":
            self.expect(redag("analyze", option, self.cart), 2,
                        f"FILE is required, and {option} has taken '{self.cart}' as its value")
        self.expect(redag("simulate", "--out", self.cart), 2, f"and --out has taken '{self.cart}'")

    def test_bad_input(self):
        self.expect(redag("analyze"), 2, "FILE is required")
        self.expect(redag("analyze", self.write("bad.yaml", MISTAKEN)), 2, "did you mean 'wcet'?")
        self.expect(redag("analyze", self.cart, "--preemption", "os", "--policy", "edf"), 2, "static policy")
        self.expect(redag("analyze", self.cart, "--overhead-release", "-1us"), 2, "--overhead-release")

    def test_no_simulated_response_is_above_its_bound(self):
        bounded = 0
        for seed in range(1, 9 if SANITIZED else 25):
            text = redag("generate", "--seed", seed, "--dags", 3, "--utilization", "1.1", "--workers", 1 + seed % 2).stdout
            for mode in ("none", "os"):
                analysis = json.loads(redag("analyze", "-", "--preemption", mode, "--json", text=text).stdout)
                run = json.loads(redag("simulate", "-", "--preemption", mode, "--duration", "2s", "--json", text=text).stdout)
                for task, seen in zip(analysis["tasks"], run["tasks"]):
                    if task["bound_ns"] is not None and seen["response"]["count"] > 0:
                        bounded += 1
                        self.assertLessEqual(seen["response"]["max_ns"], task["bound_ns"], (seed, mode, task["name"]))
        self.assertGreater(bounded, 20)

    def test_workloads_of_the_repository(self):
        for file in sorted((SOURCE / "workloads").rglob("*.yaml")):
            self.expect(redag("analyze", file), 0)
            self.expect(redag("analyze", file, "--preemption", "none"), 0)

    def test_workloads_of_the_ros_package(self):
        files = sorted((SOURCE / "ros" / "redag_rclcpp" / "config").rglob("*.yaml"))
        self.assertGreaterEqual(len(files), 2)
        for file in files:
            self.expect(redag("validate", "--strict", file), 0)

    def test_narrow_terminal(self):
        status, text = in_terminal("analyze", self.cart, "--all", columns=50, NO_COLOR="1")
        self.assertEqual(status, 0, text)
        rows = [line for line in text.splitlines() if re.match(r"(fast|slow|dag_bounded)", line)]
        self.assertLessEqual(max(map(len, rows)), 50, text)


class Sensitivity(Case):
    def limits(self, *arguments):
        document = self.document(redag("analyze", "--sensitivity", *arguments, "--json"), "redag.analysis/1")
        self.assertTrue(document["sensitivity"]["complete"])
        return {row["name"]: row for row in document["sensitivity"]["limits"]}

    def test_harmonic_periods(self):
        file = self.write("harmonic.yaml", HARMONIC)
        text = self.expect(redag("analyze", "--sensitivity", file), 0).stdout
        self.assertIn("schedulable: every deadline is met", text)
        self.assertRegex(text, r"all wcets +- +- +2\.0000 +the utilization exceeds 1")
        self.assertRegex(text, r"wcet of b\.t +1ms +5ms +5\.0000")
        self.assertEqual(self.limits(file)["wcet of b.t"]["limit_ns"], 5_000_000)

    def test_what_has_to_shrink(self):
        file = self.write("heavy.yaml", HARMONIC.replace("wcet: 2ms", "wcet: 14ms"))  # U = 5/4
        text = self.expect(redag("analyze", "--sensitivity", file), 0).stdout
        self.assertRegex(text, r"all wcets +- +- +0\.8000 ")
        self.assertRegex(text, r"wcet of c\.t +14ms +10ms +0\.7142 ")
        self.expect(redag("analyze", "--sensitivity", file, "--check"), 1)
        hopeless = self.write("hopeless.yaml", HARMONIC.replace("wcet: 2ms", "wcet: 17ms").replace("1ms", "9ms"))
        self.assertRegex(redag("analyze", "--sensitivity", hopeless).stdout, r"wcet of c\.t +17ms +none +none ")

    def test_of_many_those_with_the_least_room_are_shown(self):
        tasks = "".join(f"      - {{name: t{i:02}, wcet: {1 + i % 7}us, period: 10ms}}\n" for i in range(52))
        file = self.write("many.yaml", f"name: many\nplatform: {{workers: 1}}\ndags:\n  - name: d\n    tasks:\n{tasks}")
        text = self.expect(redag("analyze", "--sensitivity", file), 0).stdout
        shown, of = map(int, re.search(r"\(the (\d+) of (\d+) that can grow least; --all-tasks shows all\)", text).groups())
        self.assertLess(shown, of)
        row = r"(?m)^(?:all|wcet of) \S+ +[\d-]"
        self.assertEqual((len(re.findall(row, text)), shown), (50, 50))
        self.assertEqual(len(re.findall(row, redag("analyze", "--sensitivity", file, "--all-tasks").stdout)), of)

    def test_limits_hold_in_the_analysis(self):
        limit = self.limits(self.cart, "--preemption", "os")["wcet of slow.plan"]["limit_ns"]
        for wcet, status in ((limit, 0), (limit + 1, 1)):
            changed = self.write("changed.yaml", CART.replace("25ms", f"{wcet}ns"))
            self.expect(redag("analyze", changed, "--preemption", "os", "--check"), status)

    def test_clusters_have_limits_of_their_own(self):
        text = self.expect(redag("analyze", "--sensitivity", self.write("clusters.yaml", CLUSTERS)), 0).stdout
        self.assertEqual(text.count("all wcets "), 2)

    def test_interrupt_keeps_what_was_found(self):
        many = redag("generate", "--seed", 3, "--dags", 60, "--shape", "independent", "--utilization", "2.4",
                     "--workers", 4, "--preemption", "os").stdout
        process = subprocess.Popen([PROGRAM, "analyze", "-", "--sensitivity", "--json"],
                                   stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        process.stdin.write(many)
        process.stdin.close()
        interrupt(process, 2)
        out, err = process.stdout.read(), process.stderr.read()
        self.assertEqual(process.wait(timeout=60), 0, err)
        process.stdout.close()
        process.stderr.close()
        self.assertIn("interrupted", err)
        self.assertFalse(json.loads(out)["sensitivity"]["complete"])


BY_BOUNDS = ["tune", "--judge", "bounds"]


class TuneByBounds(Case):
    def test_by_deadline(self):
        file = self.write("short.yaml", SHORT_DEADLINE)
        tuned = self.folder / "tuned.yaml"
        result = self.expect(redag(*BY_BOUNDS, file, "-o", tuned), 0, "wrote")
        self.assertIn("change policy: rate_monotonic -> deadline_monotonic", result.stdout)
        self.assertIn("gain: the bounds now prove that every deadline is met", result.stdout)
        self.assertIn("least slack, by the bounds: 0 without a bound, -25.0 % -> 0 without a bound, 50.0 %", result.stdout)
        self.expect(redag("analyze", file, "--check"), 1)
        self.expect(redag("analyze", tuned, "--check"), 0)
        self.expect(redag("validate", "--strict", tuned), 0)
        self.assertIn("bcet: 1ms", tuned.read_text())
        self.assertIn("group: bus", tuned.read_text())
        again = self.expect(redag(*BY_BOUNDS, tuned, "--check"), 0)
        self.assertIn("nothing to change", again.stdout)

    def test_changes_the_file_in_place(self):
        text = "# By hand.\n" + SHORT_DEADLINE.replace("dags:\n", "dags:  # all of them\n")
        tuned = self.folder / "tuned.yaml"
        self.expect(redag(*BY_BOUNDS, self.write("short.yaml", text), "-o", tuned), 0, "wrote")
        written = tuned.read_text()
        body_of = [line for line in written.splitlines() if not re.match("# [a-z]+: \"", line)]
        self.assertEqual([line for line in body_of if not line.startswith("policy:")],
                         [line for line in text.splitlines() if not line.startswith("policy:")])
        self.assertIn("policy: deadline_monotonic", body_of)
        again = self.folder / "again.yaml"
        self.expect(redag(*BY_BOUNDS, tuned, "-o", again), 0, f"wrote {again}: the unchanged workload")
        self.assertEqual(again.read_bytes(), tuned.read_bytes())
        self.expect(redag(*BY_BOUNDS, tuned, "--ties", "fixed", "-o", again), 0)
        self.assertEqual(again.read_text().count("# created: "), 1)
        self.assertIn("ties: fixed\n", again.read_text())

    def test_an_unchanged_workload_is_the_same_file(self):
        written = "# Cart.\n" + self.cart.read_text().replace("wcet: 25ms", "wcet: 25.0ms")
        file = self.write("cart2.yaml", written)
        for command in (BY_BOUNDS, ["tune", "--vary", "max_active"]):
            same = self.folder / "same.yaml"
            self.expect(redag(*command, file, "-o", same), 0, f"wrote {same}: the unchanged workload")
            self.assertEqual(same.read_text(), written)

    def test_max_active(self):
        wide = "".join(f", {{name: f{i}, wcet: 40ms, activation: data, after: s}}" for i in range(4))
        file = self.write("wide.yaml", f"""\
name: wide
platform: {{workers: 3, preemption: none}}
dags:
  - name: quick
    tasks: [{{name: t, wcet: 2ms, period: 20ms}}]
  - name: wide
    tasks: [{{name: s, wcet: 40ms, period: 400ms}}{wide}]
""")
        document = self.document(redag(*BY_BOUNDS, file, "--json"), "redag.tuning/4")
        self.assertEqual(document["changes"], ["max_active of wide: none -> 2"])
        self.assertTrue(document["exhaustive"])
        trials = [trial for trial in document["trials"] if trial["priorities"] == "present"]
        self.assertEqual([trial["max_active"]["wide"] for trial in trials], [0, 1, 2, 3])
        self.assertEqual([trial["proven"] for trial in trials], [False, True, True, False])
        kept = self.document(redag(*BY_BOUNDS, file, "--vary", "priorities", "--json"), "redag.tuning/4")
        self.assertFalse(kept["best"]["searched"]["proven"])
        self.expect(redag(*BY_BOUNDS, file, "--vary", "priorities", "--check"), 1)

    def test_bad_input(self):
        self.expect(redag(*BY_BOUNDS), 2, "FILE is required")
        self.expect(redag(*BY_BOUNDS, self.write("bad.yaml", MISTAKEN)), 2, "bad.yaml:6")
        self.expect(redag(*BY_BOUNDS, self.cart, "-o", self.folder / "no" / "where.yaml"), 2)

    def test_workloads_of_the_repository(self):
        for file in sorted((SOURCE / "workloads").rglob("*.yaml")):
            tuned = self.folder / "tuned.yaml"
            if "clusters:" in file.read_text():
                self.expect(redag(*BY_BOUNDS, file), 2, "clusters")
                continue
            result = redag(*BY_BOUNDS, file, "--preemption", "none", "--vary", "priorities", "-o", tuned)
            self.expect(result, 0)
            self.expect(redag("validate", tuned), 0)


if __name__ == "__main__":
    main()
