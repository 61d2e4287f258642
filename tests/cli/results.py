#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests the commands that read results: `redag compare A B`, `events`, `report`, `tune`.

Usage: results.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import os
import re
import struct
import subprocess
import zlib

from pftrace import Picture
from program import CART, MISTAKEN, PROGRAM, SOURCE, Case, body, changed_run, interrupt, main, redag


class CompareResults(Case):
    def results(self, name, *arguments, file=None):
        folder = self.folder / name
        self.expect(redag("simulate", file or self.cart, "--duration", "20s", "--out", folder, *arguments), 0)
        return folder

    def test_better_and_worse(self):
        none = self.results("none")
        full = self.results("full", "--preemption", "os")
        result = self.expect(redag("compare", none, full), 0)
        self.assertRegex(result.stdout, r"\AB misses fewer deadlines than A: 0 instead of 200 \([\d.]+ %\) of all jobs; "
                                        r"\d+ figures are better, \d+ figures? (is|are) worse\n")
        self.assertIn("differs preemption: none -> os", result.stdout)
        self.assertLess(result.stdout.index("\nbetter "), result.stdout.index("\nworse "), "as the conclusion says")
        self.assertNotIn("caution", result.stdout)
        self.assertRegex(redag("compare", full, none).stdout, r"\AB misses more deadlines than A: 200 ")
        self.assertIn("better fast.sense: missed 200 (10.0 %) -> 0", result.stdout)
        self.assertIn("worse slow.plan: p50 27ms -> 33ms", result.stdout)
        self.expect(redag("compare", none, full, "--check"), 1)
        self.expect(redag("compare", none, none, "--check"), 0)
        equal = redag("compare", none, none)
        self.assertRegex(equal.stdout, r"\AA and B miss equally many deadlines: .*; no figure differs significantly\n")
        self.assertNotIn("plan", equal.stdout)
        self.assertRegex(equal.stdout, r"\(\d+ figures without a difference; --all-tasks shows all\)")
        self.assertIn("same slow.plan: missed 0", redag("compare", none, none, "--all-tasks").stdout)

    def test_repetitions(self):
        file = self.write("random.yaml", CART.replace("wcet: 1ms, period", "wcet: 1ms, bcet: 1us, period"))
        folder = self.folder / "cmp"
        self.expect(redag("compare", file, "--simulate", "--duration", "20s", "--repeat", "3", "--executors",
                          "redag,mte", "--out", folder), 0)
        result = self.expect(redag("compare", folder / "mte", folder / "redag"), 0)
        self.assertEqual(result.stdout.count("3 runs of 20s"), 2)
        self.expect(redag("compare", folder, folder / "mte"), 2, "holds runs of several kinds: redag, mte", "name one of them")
        # Repetitions in folders of other names, as run_workload of redag_rclcpp_lab writes them.
        for n in 1, 2, 3:
            (folder / "redag" / f"repetition-{n}").rename(folder / "redag" / str(n))
        self.assertEqual(self.expect(redag("compare", folder / "mte", folder / "redag"), 0).stdout, result.stdout)

    def test_other_workload(self):
        one = self.results("one")
        other = self.results("other", file=self.write("other.yaml", CART.replace("25ms", "20ms")))
        self.expect(redag("compare", one, other), 2, "different workloads: wcet of slow.plan: 25ms -> 20ms", "--different")
        result = self.expect(redag("compare", one, other, "--different"), 0)
        self.assertIn("caution: the two sides ran different workloads", result.stdout)

    def test_what_else_differs(self):
        simulated = self.results("simulated")
        slowed = self.results("slowed", "--overhead-dispatch", "100us")
        self.assertIn("caution: the sides were charged different overheads: none, and release 0s, dispatch 100us, preempt 0s",
                      self.expect(redag("compare", simulated, slowed), 0).stdout)
        on_threads = self.folder / "threads"
        self.expect(redag("run", self.cart, "--duration", "500ms", "--out", on_threads), 0)
        text = self.expect(redag("compare", simulated, on_threads), 0).stdout
        self.assertIn("caution: one side comes from 'simulator', the other from 'threads'", text)
        self.assertIn("caution: one side has fewer than 5 runs", text)
        elsewhere = self.folder / "elsewhere"
        elsewhere.mkdir()
        changed = changed_run((on_threads / "events.redag").read_bytes(), '"machine":{"cpus":', '"machine":{"cpus":9')
        (elsewhere / "events.redag").write_bytes(changed)
        self.assertIn("caution: the sides ran on different machines or kernels",
                      self.expect(redag("compare", on_threads, self.folder / "elsewhere"), 0).stdout)

    def test_bad_input(self):
        one = self.results("one")
        self.expect(redag("compare", one), 2, "is a folder: name the result to compare it with")
        self.expect(redag("compare", one, one, "--repeat", "2"), 2, "--repeat is for runs")
        self.expect(redag("compare", one, one, "--json"), 2, "--json is for runs")
        self.expect(redag("compare", self.cart, "--different"), 2, "--different")
        self.expect(redag("compare", one, self.folder / "nowhere"), 2, "nowhere")
        (self.folder / "empty").mkdir()
        self.expect(redag("compare", one, self.folder / "empty"), 2, "no events.redag")
        self.expect(redag("compare", one, one, "--tolerance", "2"), 2, "--tolerance: '2' is not a number from 0 to 0.99")


class CheckTrace(Case):
    def trace(self):
        out = self.folder / "out"
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", out), 0)
        return out / "events.redag"

    def changed(self, trace, name, old, new):
        (self.folder / name).write_bytes(changed_run(trace.read_bytes(), old, new))
        return self.folder / name

    def test_damaged_traces(self):
        trace = self.trace()
        self.assertIn("trace check: ok", self.expect(redag("events", "--check", trace), 0).stdout)
        cut = self.folder / "cut.redag"
        cut.write_bytes(trace.read_bytes()[:100])
        self.expect(redag("events", "--check", cut), 2, "cut.redag")
        self.expect(redag("events", "--check", "--json", cut, trace), 2)
        self.expect(redag("events", "--check", self.write("no.redag", "no trace\n")), 2, "no.redag: error: not a file of events")
        self.expect(redag("events", "--check", "/dev/null"), 2)

    def test_a_lie_is_found(self):
        trace = self.trace()
        # The same events under another policy: a job was chosen against the rules.
        lie = self.changed(trace, "lie.redag", '"policy":"rate_monotonic"', '"policy":"fifo"')
        result = self.expect(redag("events", "--check", lie), 1)
        self.assertIn("violations", result.stdout)
        document = self.document(redag("events", "--check", "--json", lie), "redag.check-trace/1", 1)
        self.assertGreater(document["traces"][0]["check"]["violation_count"], 0)

        # Nodes record no decisions: the checker must not judge them.
        nodes = self.changed(lie, "nodes.redag", '"driver":"simulator"', '"driver":"ros_nodes"')
        self.expect(redag("events", "--check", nodes), 0)

    def test_folder_without_traces(self):
        self.expect(redag("events", "--check", self.folder), 2, "no events.redag")


KINDS = ["released", "ready", "deferred", "dispatched", "started", "preempted", "resumed", "finished", "skipped", "aborted",
         "exceeded", "high_mode", "low_mode", "executed"]
REASONS = ["none", "overrun", "precedence", "queue_full", "dag_full", "removed", "exception", "budget", "no_data", "degraded"]


def decoded(code, base):
    """Decodes a block of events by the description in redag/trace/event_codec.hpp alone."""
    place = 0

    def number():
        nonlocal place
        value = shift = 0
        while True:
            byte = code[place]
            place += 1
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
            shift += 7

    def difference():
        folded = number()
        return folded >> 1 if folded % 2 == 0 else -(folded + 1 >> 1)

    count = number()
    kinds = [(KINDS[byte & 15], REASONS[byte >> 4]) for byte in code[place:place + count]]
    place += count
    times = []
    for _ in range(count):
        times.append((times[-1] if times else base) + difference())
    tasks = [number() for _ in range(count)]
    jobs, workers, values, last = [], [], [], {}
    for column, name in (jobs, "job"), (workers, "worker"):
        for task in tasks:
            last[name, task] = last.get((name, task), 0) + difference()
            column.append(last[name, task])
    for (kind, _), time, task in zip(kinds, times, tasks):
        expected = 0
        if kind in ("released", "ready", "dispatched"):
            expected = last.get((kind, task), base)
        elif kind in ("started", "finished", "aborted", "low_mode"):
            expected = time
        values.append(expected + difference())
        last[kind, task] = values[-1]
    assert place == len(code)
    return [[time, kind, task, job, worker - 1, value, reason] for (kind, reason), time, task, job, worker, value in
            zip(kinds, times, tasks, jobs, workers, values)]


def blocks_of(data):
    """Returns the blocks of an events.redag: their kind, time and content."""
    assert data[:16] == b"redag.events/2\r\n"
    blocks, place = [], 16
    while place < len(data):
        crc, kind, length, whole, _, base = struct.unpack_from("<IIIIQq", data, place)
        content = data[place + 32:place + 32 + length]
        assert crc == zlib.crc32(data[place + 4:place + 32 + length])
        blocks.append((kind, base, content if kind == 3 else zlib.decompress(content)))
        assert len(blocks[-1][2]) == whole
        place += 32 + length
    return blocks


class Events(Case):
    def results(self, name, *arguments, duration="2s"):
        out = self.folder / name
        self.expect(redag("simulate", self.cart, "--duration", duration, "--out", out, *arguments), 0)
        return out

    def test_the_documented_layout_is_that_of_the_file(self):
        file = self.write("all.yaml", "name: all\nplatform: {workers: 2, preemption: os}\ndags:\n"
                          "  - name: a\n    max_active: 1\n    tasks: [{name: s, wcet: 3ms, bcet: 1ms, period: 10ms}, "
                          "{name: t, wcet: 2ms, activation: data, after: s}]\n"
                          "  - name: b\n    tasks: [{name: u, wcet: 25ms, bcet: 5ms, period: 40ms}, {name: v, wcet: 4ms, "
                          "period: 5ms, jitter: 1ms}]\n")
        out = self.folder / "out"
        self.expect(redag("simulate", file, "--duration", "60s", "--out", out), 0)
        first, *middle, last = blocks_of((out / "events.redag").read_bytes())
        printed = [json.loads(line) for line in self.expect(redag("events", out), 0).stdout.splitlines()]
        self.assertEqual([kind for kind, _, _ in (first, last)], [1, 3])
        self.assertEqual(json.loads(first[2])["format"], "redag.events/2")
        self.assertEqual(json.loads(first[2])["run"], printed[0]["run"])
        self.assertGreater(len(middle), 1)
        events = [event for _, base, code in middle for event in decoded(code, base)]
        self.assertEqual(events, printed[1:-1])
        self.assertGreaterEqual({event[1] for event in events}, {"released", "ready", "dispatched", "preempted", "finished"})
        self.assertEqual(struct.unpack("<QqQ", last[2]), (len(events), printed[-1]["end_ns"], 0))
        in_file = self.folder / "printed.jsonl"
        self.expect(redag("events", out, "-o", in_file), 0)
        self.assertEqual([json.loads(line) for line in in_file.read_text().splitlines()], printed)

    def test_a_picture_and_jobs_can_be_made_later(self):
        results = self.results("with")
        made, jobs = self.folder / "made.pftrace", self.folder / "made.csv"
        self.expect(redag("events", results, "--format", "perfetto", "-o", made), 0)
        drawn = [[event for event in Picture(path).events if event[2] != "run"] for path in (results / "trace.pftrace", made)]
        self.assertEqual(drawn[0], drawn[1])
        self.expect(redag("events", results, "--format", "jobs"), 2, "name a file with -o")
        self.expect(redag("events", results, "--format", "jobs", "-o", jobs), 0)
        self.assertEqual((results / "jobs.csv").read_bytes(), jobs.read_bytes())

    def test_a_long_run_has_no_picture(self):
        out = self.folder / "out"
        result = self.expect(redag("simulate", self.cart, "--duration", "700s", "--out", out), 0)
        self.assertFalse((out / "trace.pftrace").exists())
        self.assertIn(f"redag events {out} --format perfetto", result.stdout)
        self.assertGreater(json.loads(redag("events", "--check", out, "--json").stdout)["traces"][0]["run"]["events"], 500_000)
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", out), 0)
        self.assertTrue((out / "trace.pftrace").exists())
        self.expect(redag("simulate", self.cart, "--duration", "700s", "--out", out), 0)
        self.assertFalse((out / "trace.pftrace").exists(), "it was that of the shorter run")

    def test_damage_is_found_at_its_byte(self):
        out = self.results("out", duration="100s")
        events = out / "events.redag"
        good = events.read_bytes()
        events.write_bytes(good[:-1])
        for command in ["why"], ["events"]:
            self.assertIn("; 55 bytes are no whole block", self.expect(redag(*command, out), 0).stderr)
        events.write_bytes(good[:5000] + b"#" + good[5001:])
        self.expect(redag("events", "--check", out), 2, "events.redag: error: byte ", "the checksum of the block does not match")
        events.write_bytes(good.replace(b"\r\n", b"\n", 1))
        self.expect(redag("events", "--check", out), 2, "the file was copied as text")
        events.write_bytes(b"")
        self.expect(redag("events", "--check", out), 2, "the file is empty")

    def test_mistakes(self):
        out = self.results("out")
        self.expect(redag("events", out, "--format", "perfetto"), 2, "name a file with -o")
        self.expect(redag("events", out, "-o", "/dev/null"), 2, "/dev/null: error: cannot write: it is not a file")
        self.expect(redag("events", out, "-o", "/nowhere/x.jsonl"), 2, "/nowhere/x.jsonl")
        self.results("other")
        self.expect(redag("events", self.folder), 2, "holds 2 runs")

    def test_a_reader_that_leaves(self):
        out = self.results("out", duration="300s")
        command = f"'{PROGRAM}' events '{out}' | head -n 1 | cut -c 1-28; echo ${{PIPESTATUS[0]}}"
        result = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
        self.assertEqual(result.stdout, '{"format":"redag.events/1","\n0\n', result.stderr)


class Report(Case):
    def results(self, name, *arguments):
        out = self.folder / name
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", out, *arguments), 0)
        return out

    def test_one_run(self):
        out = self.results("out")
        result = self.expect(redag("report", out), 0)
        self.assertRegex(result.stdout, r"missed their deadline .*\n.*report\.html: [\d.]+ [KM]B")
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
        document = self.document(redag("report", self.results("out"), "--json"), "redag.report/3")
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
        document = self.document(redag("report", out, "--json"), "redag.report/3")
        self.assertEqual([group["label"] for group in document["groups"]], ["ste", "redag"], "as they were listed")
        self.assertEqual([len(group["runs"]) for group in document["groups"]], [2, 2])
        self.assertEqual([row["name"] for row in document["comparison"]["dags"]], ["fast", "slow"])

    def test_folders_are_told_apart_by_name(self):
        first, second = self.results("before/redag"), self.results("after/redag", "--executor", "mte")
        document = self.document(redag("report", first, second, first, "--json"), "redag.report/3")
        self.assertEqual([group["label"] for group in document["groups"]], ["before/redag", "after/redag"])

    def test_mistakes(self):
        self.expect(redag("report"), 2, "DIR")
        self.expect(redag("report", self.folder), 2, "no events.redag", "--out")
        self.expect(redag("report", self.folder / "nowhere"), 2, "nowhere")
        out = self.results("out")
        self.expect(redag("report", out, "-o", "/nowhere/report.html"), 2, "/nowhere/report.html")
        (out / "comparison.json").write_text("{}")
        self.expect(redag("report", out), 2, "comparison.json:1", "was not written by 'redag compare'")
        (out / "comparison.json").unlink()
        events = (out / "events.redag").read_bytes()
        (out / "events.redag").write_bytes(events[:100])
        self.expect(redag("report", out), 2, "events.redag: error: byte 16: the file is damaged here")

    def test_repetitions_of_different_things(self):
        self.results("out/repetition-1")
        self.results("out/repetition-2", "--executor", "mte")
        self.expect(redag("report", self.folder / "out"), 2, "repetition-2/events.redag is not a repetition")


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
        result = self.expect(redag("tune", file, "-o", tuned), 0, "wrote")
        self.assertIn("change max_active of wide: none -> 1", result.stdout)
        self.assertRegex(result.stdout, r"misses, on unseen seeds: [\d ]+ \([\d.]+ %\) -> none")
        self.expect(redag("validate", "--strict", tuned), 0)
        self.assertIn("bcet: 20ms", tuned.read_text())
        self.assertRegex(tuned.read_text(), r'^# created: "2\d{3}-.*\n(# .*\n)*# command: ".* tune .*"\n')
        again = self.expect(redag("tune", tuned, "--check"), 0)
        self.assertIn("nothing to change", again.stdout)
        self.expect(redag("tune", file, "--vary", "workers", "--check"), 1)
        before = self.folder / "before"
        after = self.folder / "after"
        for name, folder in (file, before), (tuned, after):
            self.expect(redag("simulate", name, "--duration", "20s", "--seed", "77", "--out", folder), 0)
        differs = self.expect(redag("compare", before, after), 0).stdout
        self.assertIn("differs max_active of wide: none -> 1", differs)
        self.assertIn("better quick: missed", differs)

    def test_json_is_the_same_for_every_number_of_processors(self):
        file = self.write("wide.yaml", self.WIDE)
        one = redag("tune", file, "--jobs", "1", "--duration", "2s", "--json")
        document = self.document(one, "redag.tuning/4")
        self.assertEqual(body(one.stdout), body(redag("tune", file, "--jobs", "3", "--duration", "2s", "--json").stdout))
        self.assertEqual(document["best"]["max_active"], {"wide": 1, "quick": 0})

    def test_pairs(self):
        paper = SOURCE / "workloads" / "paper" / "harmonic_u08.yaml"
        result = redag("tune", paper, "--vary", "max_active", "--caps", "2-5", "--duration", "2s",
                       "--seeds", "1", "--held-out", "1", "--json")
        trials = self.document(result, "redag.tuning/4")["trials"]
        pairs = sorted((trial["max_active"]["dag1"], trial["max_active"]["dag2"]) for trial in trials)
        self.assertEqual(pairs, [(a, b) for a in range(2, 6) for b in range(2, 6)])

    def test_interrupted(self):
        file = self.write("wide.yaml", self.WIDE)
        process = subprocess.Popen([PROGRAM, "tune", file, "--duration", "100000s", "--held-out", "0", "--seeds", "1",
                                    "--jobs", "1"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        interrupt(process, 0.5)
        out, err = process.communicate(timeout=250)
        self.assertIn("interrupted", err)
        self.assertIn(process.returncode, (0, 2))  # 2: not even the given workload was judged yet
        self.assertEqual(process.returncode == 0, "stopped after" in out)

    def test_bad_input(self):
        self.expect(redag("tune"), 2, "FILE is required")
        self.expect(redag("tune", self.write("bad.yaml", MISTAKEN)), 2, "bad.yaml:6")
        self.expect(redag("tune", self.cart, "--judge", "bound"), 2, "did you mean 'bounds'?")
        self.expect(redag("tune", self.cart, "--vary", "worker"), 2, "did you mean 'workers'?")
        self.expect(redag("tune", self.cart, "--caps", "5-2"), 2, "write it as 2-5")
        self.expect(redag("tune", self.cart, "--seeds", "0"), 2, "--seeds")
        self.expect(redag("tune", self.cart, "-o", self.folder / "no" / "where.yaml"), 2)


if __name__ == "__main__":
    main()
