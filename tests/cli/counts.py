#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests that every screen and file of a run counts the same jobs: released, finished, late, skipped, missed.

Random workloads lose jobs in all ways. An independent count of jobs.csv, by the words of docs/model.md, is compared
with the text and the JSON of `simulate` and `compare`, with summary.json, and with the documents of `report` and `why`.

Usage: counts.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import collections
import csv
import json
import random
import re

from program import SANITIZED, Case, main, redag

SEEDS = 4 if SANITIZED else 24
WARM_UP = 50_000_000
KEYS = ("released", "finished", "late", "skipped", "aborted", "in_flight", "missed")


def workload(rng):
    """Returns a workload file whose load is mostly too high: jobs are skipped, aborted, late, and late end to end."""
    lines = [f"name: counts\nplatform: {{workers: {rng.randint(1, 2)}, preemption: {rng.choice(['none', 'os', 'cooperative'])}}}\ndags:"]
    for d in range(rng.randint(2, 4)):
        period = rng.choice([5, 10, 20, 40])
        keys = [f"name: d{d}"]
        if rng.random() < 0.7:
            keys.append(f"deadline: {rng.randint(period // 2, 2 * period)}ms")
        if rng.random() < 0.3:
            keys.append("max_active: 1")
        if rng.random() < 0.3:
            keys.append("max_pending: 1")
        tasks = []
        for t in range(rng.randint(1, 3)):
            wcet = rng.randint(500, 700 * period)
            task = [f"name: t{t}", f"wcet: {wcet}us", f"bcet: {wcet // 4}us"]
            task += [f"activation: data, after: t{t - 1}"] if t > 0 else [f"period: {period}ms, jitter: {rng.choice([0, 2])}ms"]
            if rng.random() < 0.4:
                task.append(f"overrun: {{queue: {rng.randint(1, 3)}}}")
            if rng.random() < 0.15:
                task.append(f"budget: {rng.randint(wcet // 2, wcet)}us, on_budget: {rng.choice(['abort', 'skip_next', 'demote'])}")
            if rng.random() < 0.5:
                task.append(f"deadline: {rng.randint(period // 2, 2 * period)}ms")
            tasks.append("{" + ", ".join(task) + "}")
        lines.append(f"  - {{{', '.join(keys)}, tasks: [{', '.join(tasks)}]}}")
    return "\n".join(lines) + "\n"


def count(rows, end):
    """Counts jobs of jobs.csv as "What is measured" in docs/model.md says."""
    seen = collections.Counter({key: 0 for key in KEYS})
    for row in rows:
        seen["released"] += 1
        seen[row["outcome"]] += 1
        lost = row["outcome"] in ("skipped", "aborted") and row["reason"] != "no_data"
        finish = end if row["outcome"] == "in_flight" else int(row["finish_ns"])
        late = row["outcome"] in ("finished", "in_flight") and finish > int(row["deadline_ns"])
        seen["late"] += late
        seen["missed"] += late or lost
    return {key: seen[key] for key in KEYS}


def only_late_end_to_end(rows, end, summary):
    """Counts the jobs of sinks that are in time themselves, and too late for the end-to-end deadline of their DAG."""
    deadlines = {}
    for dag in summary["dags"]:
        for sink in dag["end_to_end"]["sinks"]:
            deadlines[dag["name"], summary["tasks"][sink["id"]]["name"]] = dag["end_to_end"]["deadline_ns"]
    found = 0
    for row in rows:
        deadline = deadlines.get((row["dag"], row["task"]), 0)
        if deadline == 0 or row["outcome"] in ("skipped", "aborted") or not row["origin_ns"]:
            continue
        finish = end if row["outcome"] == "in_flight" else int(row["finish_ns"])
        found += finish <= int(row["deadline_ns"]) and finish - int(row["origin_ns"]) > deadline
    return found


def picked(figures):
    return {key: figures[key] for key in KEYS}


class Counts(Case):
    def test_all_screens_agree(self):
        kinds = collections.Counter()
        for seed in range(SEEDS):
            with self.subTest(seed=seed):
                kinds.update(self.one(seed))
        # The workloads lose jobs in every way that this test is about. Slow programs try only some of them.
        if not SANITIZED:
            for kind in "overrun", "queue_full", "dag_full", "budget", "late", "end to end", "in_flight":
                self.assertGreater(kinds[kind], 0, kinds)

    def one(self, seed):
        text = workload(random.Random(seed))
        file = self.write("counts.yaml", text)
        folder = self.folder / f"result{seed}"
        options = ["--duration", "1s", "--warm-up", f"{WARM_UP}ns", "--seed", str(seed)]
        shown = self.expect(redag("simulate", file, *options, "--out", folder, "--all-tasks"), 0).stdout
        summary = json.loads((folder / "summary.json").read_text())
        end = summary["run"]["end_ns"]
        with (folder / "jobs.csv").open(encoding="utf-8") as jobs:
            rows = [row for row in csv.DictReader(jobs) if int(row["release_ns"]) >= WARM_UP]
        total = count(rows, end)

        # summary.json, and the same as a document
        document = json.loads(self.expect(redag("simulate", file, *options, "--json"), 0).stdout)
        for figures in summary, document:
            self.assertEqual(picked(figures["total"]), total, text)
            for kind in "dags", "tasks":
                for one in figures[kind]:
                    own = [row for row in rows if (row["dag"], row["task"]) == (one["dag"], one["name"])] if kind == "tasks" \
                        else [row for row in rows if row["dag"] == one["name"]]
                    self.assertEqual(picked(one), count(own, end), text)

        # the screen of simulate
        number = lambda digits: int(digits.replace(" ", ""))
        for dag, task in {(row["dag"], row["task"]) for row in rows}:
            own = count([row for row in rows if (row["dag"], row["task"]) == (dag, task)], end)
            line = re.search(rf"^{dag}\.{task} +(.*)$", shown, re.M).group(1)
            cells = [number(re.match(r"[\d ]+", cell).group()) for cell in re.split(r"  +", line)[:5]]
            self.assertEqual(cells, [own[key] for key in ("released", "late", "skipped", "aborted", "missed")], line)
        headline = f"{total['missed']:,} of {total['released']:,} job".replace(",", " ")
        self.assertIn(headline if total["missed"] else "Every", shown)

        # the report
        page = json.loads(self.expect(redag("report", folder, "--json"), 0).stdout)
        group, = page["groups"]
        self.assertEqual(picked(group["total"]), total)
        self.assertEqual(group["runs"][0]["missed"], total["missed"])
        self.assertEqual(group["runs"][0]["released"], total["released"])
        self.assertEqual([picked(dag["jobs"]) for dag in group["dags"]], [picked(dag) for dag in summary["dags"]])
        self.assertEqual([picked(task["jobs"]) for task in group["tasks"]], [picked(task) for task in summary["tasks"]])
        self.assertEqual([dag["end_to_end"]["late"] for dag in group["dags"]], [dag["end_to_end"]["late"] for dag in summary["dags"]])

        # compare, on the screen and as a document, and its report: all repetitions together
        many = self.folder / f"compared{seed}"
        screen = self.expect(redag("compare", file, "--simulate", "--executors", "redag,mte", "--repeat", "2", *options, "--out", many), 0).stdout
        comparison = json.loads((many / "comparison.json").read_text())
        page = json.loads(self.expect(redag("report", many, "--json"), 0).stdout)
        screen_rows = {}
        for line in screen.splitlines():
            if row := re.match(r"(?:(d\d|total) +| {4,})(redag|mte) +(\d.*)$", line):
                name = row[1] or name
                screen_rows[name, row[2]] = [number(re.match(r"[\d ]+", cell).group()) for cell in re.split(r"  +", row[3])[:3]]
        for executor, its_group in zip(comparison["executors"], page["groups"]):
            runs = [json.loads(path.read_text()) for path in sorted(many.glob(executor["name"] + "/repetition-*/summary.json"))]
            for dag, shown_dag, *each in zip(executor["dags"], its_group["dags"], *(run["dags"] for run in runs)):
                own = [sum(run[key] for run in each) for key in ("released", "late", "missed")]
                for figures in dag, shown_dag["jobs"]:
                    self.assertEqual([figures[key] for key in ("released", "late", "missed")], own)
                self.assertEqual(screen_rows[dag["name"], executor["name"]], own, screen)

        # why
        why = json.loads(self.expect(redag("why", folder, "--json"), 0).stdout)
        end_to_end = only_late_end_to_end(rows, end, summary)
        for figures in why, group["why"]:
            self.assertEqual(figures["missed"], total["missed"])
            self.assertEqual(figures["late_end_to_end"], end_to_end)
            self.assertEqual(figures["misses"], total["missed"] + end_to_end)
        self.assertEqual(why["released"], total["released"])
        words = self.expect(redag("why", folder), 0).stdout
        if total["missed"]:
            self.assertTrue(words.startswith(headline), words)
        lost = collections.Counter(row["reason"] for row in rows if row["outcome"] in ("skipped", "aborted"))
        return lost + collections.Counter({"late": total["late"], "end to end": end_to_end, "in_flight": total["in_flight"]})


if __name__ == "__main__":
    main()
