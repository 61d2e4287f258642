#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests the commands that read results: `redag diff`, `check-trace`, `report`, `tune`.

Usage: results.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import re
import subprocess

from program import CART, MISTAKEN, PROGRAM, SOURCE, Case, body, interrupt, main, redag


class Diff(Case):
    def results(self, name, *arguments, file=None):
        folder = self.folder / name
        self.expect(redag("simulate", file or self.cart, "--duration", "20s", "--out", folder, *arguments), 0)
        return folder

    def test_better_and_worse(self):
        none = self.results("none")
        full = self.results("full", "--preemption", "os")
        result = self.expect(redag("diff", none, full), 0)
        self.assertIn("differs preemption: none -> os", result.stdout)
        self.assertIn("better fast.sense: missed 200 (10.0 %) -> 0", result.stdout)
        self.assertIn("worse slow.plan: p50 27ms -> 33ms", result.stdout)
        self.assertNotIn("correlated beyond the blocks", result.stdout)
        self.expect(redag("diff", none, full, "--check"), 1)
        self.expect(redag("diff", none, none, "--check"), 0)
        self.assertIn("no figure differs", redag("diff", none, none).stdout)
        document = self.document(redag("diff", none, full, "--json"), "redag.difference/2")
        self.assertEqual(document["changes"], [{"kind": "setting", "what": "preemption", "a": "none", "b": "os"}])
        self.assertEqual([row["task"] for row in document["rows"]], [None, None, "sense", "act", None, "plan"])
        self.assertTrue(document["worse"] and document["better"])
        self.assertEqual(body(redag("diff", none, full, "--json").stdout), body(redag("diff", none, full, "--json").stdout))

    def test_repetitions(self):
        file = self.write("random.yaml", CART.replace("wcet: 1ms, period", "wcet: 1ms, bcet: 1us, period"))
        folder = self.folder / "cmp"
        self.expect(redag("compare", file, "--simulate", "--duration", "20s", "--repeat", "3", "--executors",
                          "redag,mte", "--out", folder), 0)
        result = redag("diff", folder / "mte", folder / "redag", "--json")
        self.assertEqual(self.document(result, "redag.difference/2")["a"]["seeds"], [1, 2, 3])
        self.expect(redag("diff", folder, folder / "mte"), 2, "holds runs of several kinds: redag, mte", "name one of them")
        # Repetitions in folders of other names, as run_workload of redag_rclcpp_lab writes them.
        for n in 1, 2, 3:
            (folder / "redag" / f"repetition-{n}").rename(folder / "redag" / str(n))
        again = self.document(redag("diff", folder / "mte", folder / "redag", "--json"), "redag.difference/2")
        self.assertEqual(again["b"]["seeds"], [1, 2, 3])
        self.assertEqual(again["rows"], json.loads(result.stdout)["rows"])

    def test_other_workload(self):
        one = self.results("one")
        other = self.results("other", file=self.write("other.yaml", CART.replace("25ms", "20ms")))
        self.expect(redag("diff", one, other), 2, "different workloads: wcet of slow.plan: 25ms -> 20ms", "--different")
        result = self.expect(redag("diff", one, other, "--different"), 0)
        self.assertIn("caution: the two sides ran different workloads", result.stdout)

    def test_what_else_differs(self):
        simulated = self.results("simulated")
        slowed = self.results("slowed", "--overhead-dispatch", "100us")
        self.assertIn("caution: the sides were charged different overheads: none, and release 0s, dispatch 0.1ms, preempt 0s",
                      self.expect(redag("diff", simulated, slowed), 0).stdout)
        on_threads = self.folder / "threads"
        self.expect(redag("run", self.cart, "--duration", "500ms", "--out", on_threads), 0)
        text = self.expect(redag("diff", simulated, on_threads), 0).stdout
        self.assertIn("caution: one side comes from 'simulator', the other from 'threads'", text)
        self.assertIn("caution: one side has a single run", text)
        info, *events = (on_threads / "events.jsonl").read_text().splitlines(keepends=True)
        (self.folder / "elsewhere").mkdir()
        changed = json.loads(info)
        changed["run"]["machine"]["kernel"] += "-other"
        (self.folder / "elsewhere" / "events.jsonl").write_text("".join([json.dumps(changed) + "\n", *events]))
        self.assertIn("caution: the sides ran on different machines or kernels",
                      self.expect(redag("diff", on_threads, self.folder / "elsewhere"), 0).stdout)

    def test_bad_input(self):
        one = self.results("one")
        self.expect(redag("diff", one), 2, "B is required")
        self.expect(redag("diff", one, self.folder / "nowhere"), 2, "nowhere")
        (self.folder / "empty").mkdir()
        self.expect(redag("diff", one, self.folder / "empty"), 2, "no events.jsonl")
        self.expect(redag("diff", one, one, "--tolerance", "2"), 2, "--tolerance: '2' is not a number from 0 to 0.99")
        self.expect(redag("diff", one, one, "--replicates", "1"), 2, "--replicates")


class CheckTrace(Case):
    def trace(self):
        out = self.folder / "out"
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", out), 0)
        return out / "events.jsonl"

    def test_damaged_traces(self):
        trace = self.trace()
        self.assertIn("trace check: ok", self.expect(redag("check-trace", trace), 0).stdout)
        lines = trace.read_text().splitlines(keepends=True)
        cut = self.write("cut.jsonl", "".join(lines[: len(lines) // 2]))
        self.expect(redag("check-trace", cut), 2, "cut.jsonl")
        self.expect(redag("check-trace", "--json", cut, trace), 2)
        self.expect(redag("check-trace", self.write("no.jsonl", "no trace\n")), 2, "no.jsonl:1")
        self.expect(redag("check-trace", "/dev/null"), 2)

    def test_a_lie_is_found(self):
        trace = self.trace()
        text = trace.read_text()
        # The same events under another policy: a job was chosen against the rules.
        lie = text.replace('"policy":"rate_monotonic"', '"policy":"fifo"', 1)
        self.assertNotEqual(lie, text)
        result = self.expect(redag("check-trace", self.write("lie.jsonl", lie)), 1)
        self.assertIn("violations", result.stdout)
        document = self.document(redag("check-trace", "--json", self.folder / "lie.jsonl"), "redag.check-trace/1", 1)
        self.assertGreater(document["traces"][0]["check"]["violation_count"], 0)

        # Nodes record no decisions: the checker must not judge them.
        nodes = lie.replace('"driver":"simulator"', '"driver":"ros_nodes"', 1)
        self.assertNotEqual(nodes, lie)
        self.expect(redag("check-trace", self.write("nodes.jsonl", nodes)), 0)

    def test_folder_without_traces(self):
        self.expect(redag("check-trace", self.folder), 2, "no events.jsonl")


class Report(Case):
    def results(self, name, *arguments):
        out = self.folder / name
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", out, *arguments), 0)
        return out

    def test_one_run(self):
        out = self.results("out")
        result = self.expect(redag("report", out), 0)
        self.assertRegex(result.stdout, r"missed their deadline .*\n.*report\.html: [\d.]+ MB")
        page = (out / "report.html").read_text()
        self.assertTrue(page.startswith("<!doctype html>") and page.rstrip().endswith("</html>"))
        self.expect(redag("report", out, "-o", self.folder / "again.html"), 0)
        again = (self.folder / "again.html").read_text()
        without = lambda text: re.sub(r'"format":"redag.report/\d","provenance":\{.*?\},"version"', "", text)
        self.assertNotEqual(without(page), page)
        self.assertEqual(without(again), without(page), "equal results make equal bytes")
        data = json.loads(re.search(r'id="data">(.*?)</script>', page)[1])
        self.assertIn("report", data["provenance"]["command"])
        self.assertIn("simulate", data["groups"][0]["runs"][0]["provenance"]["command"])
        # An existing page does not prevent the next run from writing into the folder.
        self.results("out")

    def test_data(self):
        document = self.document(redag("report", self.results("out"), "--json"), "redag.report/2")
        group = document["groups"][0]
        self.assertEqual(group["label"], "redag")
        summary = json.loads((self.folder / "out" / "summary.json").read_text())
        for key in ["released", "finished", "late", "skipped", "missed", "in_flight", "max_lateness_ns"]:
            self.assertEqual(group["total"][key], summary["total"][key], key)
        for dag, expected in zip(group["dags"], summary["dags"]):
            self.assertEqual(dag["end_to_end"]["response"], dag["end_to_end"]["response"] | expected["end_to_end"]["response"])
            self.assertNotIn("response", dag["jobs"], "of jobs of several tasks")
        self.assertFalse((self.folder / "out" / "report.html").exists(), "--json alone writes no page")

    def test_run_and_report_give_the_same_verdict(self):
        for executor in ["redag", "ste"]:
            out = self.folder / executor
            shown = self.expect(redag("simulate", self.cart, "--executor", executor, "--duration", "2s", "--out", out), 0).stdout
            said = self.expect(redag("report", out), 0).stdout.splitlines()[0]
            verdict = next(line for line in shown.splitlines() if "deadline was met" in line or "missed their deadline" in line)
            self.assertTrue(said.startswith(verdict), f"{said}\n{verdict}")

    def test_comparison(self):
        out = self.folder / "cmp"
        self.expect(redag("compare", self.cart, "--simulate", "--executors", "ste,redag", "--repeat", "2", "--duration", "1s",
                          "--out", out), 0)
        document = self.document(redag("report", out, "--json"), "redag.report/2")
        self.assertEqual([group["label"] for group in document["groups"]], ["ste", "redag"], "as they were listed")
        self.assertEqual([len(group["runs"]) for group in document["groups"]], [2, 2])
        self.assertEqual([row["name"] for row in document["comparison"]["dags"]], ["fast", "slow"])

    def test_folders_are_told_apart_by_name(self):
        first, second = self.results("before/redag"), self.results("after/redag", "--executor", "mte")
        document = self.document(redag("report", first, second, first, "--json"), "redag.report/2")
        self.assertEqual([group["label"] for group in document["groups"]], ["before/redag", "after/redag"])

    def test_mistakes(self):
        self.expect(redag("report"), 2, "DIR")
        self.expect(redag("report", self.folder), 2, "no events.jsonl", "--out")
        self.expect(redag("report", self.folder / "nowhere"), 2, "nowhere")
        out = self.results("out")
        self.expect(redag("report", out, "-o", "/nowhere/report.html"), 2, "/nowhere/report.html")
        (out / "comparison.json").write_text("{}")
        self.expect(redag("report", out), 2, "comparison.json:1", "was not written by 'redag compare'")
        (out / "comparison.json").unlink()
        events = (out / "events.jsonl").read_text().splitlines(keepends=True)
        (out / "events.jsonl").write_text("".join(events[:-1]))
        self.expect(redag("report", out), 2, f"events.jsonl:{len(events) - 1}", "file is incomplete")

    def test_repetitions_of_different_things(self):
        self.results("out/repetition-1")
        self.results("out/repetition-2", "--executor", "mte")
        self.expect(redag("report", self.folder / "out"), 2, "repetition-2/events.jsonl is not a repetition")


class Tune(Case):
    WIDE = """\
name: wide
platform: {workers: 2, preemption: none}
dags:
  - name: wide
    tasks: [{name: s, wcet: 5ms, bcet: 1ms, period: 100ms}%s]
  - name: quick
    tasks: [{name: t, wcet: 1ms, bcet: 500us, period: 10ms}]
""" % "".join(f", {{name: f{i}, wcet: 30ms, bcet: 20ms, activation: data, after: s}}" for i in range(2))

    def test_max_active(self):
        file = self.write("wide.yaml", self.WIDE)
        tuned = self.folder / "tuned.yaml"
        result = self.expect(redag("tune", file, "--simulator-only", "-o", tuned), 0, "wrote")
        self.assertIn("change max_active of wide: none -> 1", result.stdout)
        self.assertRegex(result.stdout, r"misses, on unseen seeds: [\d ]+ \([\d.]+ %\) -> none")
        self.assertIn("seed by seed: 10 better, 0 equal, 0 worse", result.stdout)
        self.expect(redag("validate", "--strict", tuned), 0)
        self.assertIn("bcet: 20ms", tuned.read_text())
        self.assertRegex(tuned.read_text(), r'^# created: "2\d{3}-.*\n(# .*\n)*# command: ".* tune .*"\n')
        again = self.expect(redag("tune", tuned, "--simulator-only", "--check"), 0)
        self.assertIn("nothing to change", again.stdout)
        self.expect(redag("tune", file, "--simulator-only", "--vary", "workers", "--check"), 1)
        before = self.folder / "before"
        after = self.folder / "after"
        for name, folder in (file, before), (tuned, after):
            self.expect(redag("simulate", name, "--duration", "20s", "--seed", "77", "--out", folder), 0)
        differs = self.expect(redag("diff", before, after), 0).stdout
        self.assertIn("differs max_active of wide: none -> 1", differs)
        self.assertIn("better quick: missed", differs)

    def test_objectives(self):
        file = self.write("wide.yaml", self.WIDE.replace("name: quick", "name: quick\n    criticality: high"))
        options = ["--simulator-only", "--duration", "2s", "--seeds", "2"]
        text = self.expect(redag("tune", file, "--objective", "max_lateness", "--per-criticality", *options), 0).stdout
        self.assertIn("objective: max_lateness, the most critical DAGs first", text)
        self.assertRegex(text, r"criticality high: \d+ lost, [\d.]+us -> 0 lost, -9ms")
        self.assertRegex(text, r"criticality normal: 0 lost, ")
        text = self.expect(redag("tune", file, "--objective", "slack", "--exhaustive", "1", *options), 0).stdout
        self.assertRegex(text, r"slack, on unseen seeds: \d+ lost, -[\d.]+ % -> 0 lost, [\d.]+ %")
        self.assertIn("local search (seed 1), not all combinations were tried", text)

    def test_json_is_the_same_for_every_number_of_processors(self):
        file = self.write("wide.yaml", self.WIDE)
        one = redag("tune", file, "--jobs", "1", "--duration", "2s", "--json")
        document = self.document(one, "redag.tuning/1")
        self.assertEqual(body(one.stdout), body(redag("tune", file, "--jobs", "3", "--duration", "2s", "--json").stdout))
        self.assertEqual(document["best"]["max_active"], {"wide": 1, "quick": 0})
        self.assertEqual(len(document["best"]["held_out_runs"]), 10)

    def test_pairs(self):
        paper = SOURCE / "workloads" / "paper" / "harmonic_u08.yaml"
        result = redag("tune", paper, "--vary", "max_active", "--caps", "2-5", "--simulator-only", "--duration", "2s",
                       "--seeds", "1", "--held-out", "1", "--json")
        trials = self.document(result, "redag.tuning/1")["trials"]
        pairs = sorted((trial["max_active"]["dag1"], trial["max_active"]["dag2"]) for trial in trials)
        self.assertEqual(pairs, [(a, b) for a in range(2, 6) for b in range(2, 6)])

    def test_interrupted(self):
        file = self.write("wide.yaml", self.WIDE)
        process = subprocess.Popen([PROGRAM, "tune", file, "--duration", "100000s", "--held-out", "0", "--seeds", "1",
                                    "--jobs", "1", "--simulator-only"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        interrupt(process, 0.5)
        out, err = process.communicate(timeout=250)
        self.assertIn("interrupted", err)
        self.assertIn(process.returncode, (0, 2))  # 2: not even the given workload was judged yet
        self.assertEqual(process.returncode == 0, "stopped after" in out)

    def test_bad_input(self):
        self.expect(redag("tune"), 2, "FILE is required")
        self.expect(redag("tune", self.write("bad.yaml", MISTAKEN)), 2, "bad.yaml:6")
        self.expect(redag("tune", self.cart, "--objective", "misess"), 2, "did you mean 'misses'?")
        self.expect(redag("tune", self.cart, "--vary", "worker"), 2, "did you mean 'workers'?")
        self.expect(redag("tune", self.cart, "--caps", "5-2"), 2, "write it as 2-5")
        self.expect(redag("tune", self.cart, "--seeds", "0"), 2, "--seeds")
        self.expect(redag("tune", self.cart, "-o", self.folder / "no" / "where.yaml"), 2)


if __name__ == "__main__":
    main()
