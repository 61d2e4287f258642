#!/usr/bin/env python3
"""Simulations, runs and comparisons: what they print and write, and what streams and signals do to them.

Usage: runs.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import csv
import json
import os
import re
import resource
import signal
import subprocess
import time

from program import CART, PROGRAM, SOURCE, Case, in_terminal, interrupt, main, redag


class Simulate(Case):
    def test_table_and_verdict(self):
        result = self.expect(redag("simulate", self.cart, "--duration", "1s"), 0)
        for words in ["fast.sense", "slow.plan", "preemption: none", "trace check: ok"]:
            self.assertIn(words, result.stdout)

    def test_json_and_files_agree(self):
        out = self.folder / "deep" / "out"
        result = redag("simulate", self.cart, "--duration", "2s", "--json", "--out", out)
        document = self.document(result, "redag.summary/1")
        self.assertTrue(document["check"]["ok"])
        written = json.loads((out / "summary.json").read_text())
        self.assertEqual(written, {key: document[key] for key in written})
        self.assertEqual(sorted(path.name for path in out.iterdir()),
                         ["events.jsonl", "jobs.csv", "summary.json", "trace.json"])
        with open(out / "jobs.csv", newline="") as file:
            self.assertEqual(len(list(csv.DictReader(file))), document["total"]["released"])
        json.loads((out / "trace.json").read_text())

    def test_same_seed_same_bytes(self):
        arguments = ["simulate", SOURCE / "workloads" / "contention.yaml", "--duration", "1s", "--json"]
        self.assertEqual(redag(*arguments).stdout, redag(*arguments).stdout)
        self.assertNotEqual(redag(*arguments).stdout, redag(*arguments, "--seed", "2").stdout)

    def test_the_command_line_overrides(self):
        document = self.document(redag("simulate", self.cart, "--duration", "1s", "--preemption", "cooperative",
                                       "--workers", "2", "--policy", "fifo", "--json"), "redag.summary/1")
        self.assertEqual(document["run"]["preemption"], "cooperative")
        self.assertEqual(document["run"]["config"]["policy"], "fifo")
        self.assertEqual(len(document["worker_busy"]), 2)

    def test_check_says_no(self):
        self.expect(redag("simulate", self.cart, "--duration", "1s"), 0)
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--check"), 1)
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--check", "--preemption", "os"), 0)

    def test_overheads_cost_time(self):
        plain = json.loads(redag("simulate", self.cart, "--duration", "1s", "--json").stdout)
        slower = json.loads(redag("simulate", self.cart, "--duration", "1s", "--json", "--overhead-dispatch", "1ms").stdout)
        self.assertGreater(slower["worker_busy"][0], plain["worker_busy"][0])

    def test_a_cut_trace_is_said_and_lawful(self):
        out = self.folder / "out"
        result = self.expect(redag("simulate", self.cart, "--duration", "60s", "--max-events", "5000", "--out", out), 0)
        self.assertIn("--max-events", result.stdout)
        self.expect(redag("check-trace", out), 0)
        self.assertGreater(json.loads((out / "summary.json").read_text())["end_ns"],
                           json.loads((out / "events.jsonl").read_text().splitlines()[-1])["end_ns"])

    def test_folders_of_others_are_left_alone(self):
        (self.folder / "mine").mkdir()
        thesis = self.write("mine/thesis.tex", "years of work")
        arguments = ["simulate", self.cart, "--duration", "1s", "--out", self.folder / "mine"]
        self.expect(redag(*arguments), 2, "thesis.tex", "--force")
        self.expect(redag(*arguments, "--force"), 0)
        self.assertEqual(thesis.read_text(), "years of work")
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", self.cart), 2, str(self.cart))
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", "/proc/redag"), 2, "/proc/redag")

    def test_again_into_the_same_folder(self):
        arguments = ["simulate", self.cart, "--duration", "1s", "--out", self.folder / "out"]
        self.expect(redag(*arguments), 0)
        self.expect(redag(*arguments), 0)

    def test_thousands_of_tasks(self):
        big = self.write("big.yaml", redag("generate", "--dags", "400", "--min-tasks", "5", "--max-tasks", "8",
                                           "--utilization", "3", "--workers", "4").stdout)
        result = self.expect(redag("simulate", big, "--duration", "1s"), 0)
        self.assertIn("--all-tasks", result.stdout)
        self.assertIn("trace check: ok", result.stdout)


class Streams(Case):
    def test_a_reader_that_leaves(self):
        out = self.folder / "out"
        command = f"'{PROGRAM}' simulate '{self.cart}' --duration 2s --json --out '{out}' | head -n 1; echo ${{PIPESTATUS[0]}}"
        result = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
        self.assertEqual(result.stdout, "{\n0\n", result.stderr)
        self.assertTrue((out / "summary.json").exists())

    def test_full_disk(self):
        with open("/dev/full", "w") as full:
            result = subprocess.run([PROGRAM, "simulate", self.cart, "--duration", "1s"], stdout=full,
                                    stderr=subprocess.PIPE, text=True, check=False)
        self.expect(result, 2) if result.stdout else self.assertEqual(result.returncode, 2)
        self.assertIn("No space left", result.stderr)

    def test_no_colour_in_files(self):
        self.assertNotIn("\033", redag("simulate", self.cart, "--duration", "1s").stdout)

    def test_terminal(self):
        status, text = in_terminal("simulate", self.cart, "--duration", "1s")
        self.assertEqual(status, 0)
        self.assertIn("\033[", text)
        status, text = in_terminal("simulate", self.cart, "--duration", "1s", NO_COLOR="1")
        self.assertNotRegex(text, r"\033\[\d+m")

    def test_narrow_terminals(self):
        for columns in (60, 40):
            status, text = in_terminal("compare", self.cart, "--simulate", "--duration", "1s", "--executors",
                                       "redag-none,redag-os", columns=columns, NO_COLOR="1")
            self.assertEqual(status, 0, text)
            table = [line for line in text.splitlines() if re.search(r" redag-(none|os) .*%", line) and ":" not in line]
            self.assertEqual(len(table), 6, text)
            self.assertLessEqual(max(map(len, table)), columns, text)
        self.assertIn("no room for", text)

    def test_progress_on_a_terminal(self):
        _, text = in_terminal("run", self.cart, "--duration", "1s")
        self.assertRegex(text, r"\[#+ *\] +\d+ %")
        self.assertNotIn("[###", redag("run", self.cart, "--duration", "300ms").stderr)


class Interrupts(Case):
    def start(self, *arguments):
        return subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def test_run_is_held_to_its_bounds(self):
        light = self.write("light.yaml", CART.replace("25ms", "5ms"))
        document = json.loads(redag("run", light, "--duration", "300ms", "--preemption", "none", "--json").stdout)
        self.assertEqual(document["bounds"]["bounded"], 3, document["bounds"])
        self.assertEqual([task["bound_ns"] for task in document["bounds"]["tasks"][:2]], [6_999_999] * 2)
        mte = json.loads(redag("run", light, "--duration", "300ms", "--executor", "mte", "--json").stdout)["bounds"]
        self.assertEqual(mte["bounded"], 3, mte)
        self.assertTrue({task["method"] for task in mte["tasks"]} <= {"wait_set", "wait_set_rates", "dag_any"}, mte)
        self.assertIn("\nbounds: 3 of 3 tasks", redag("run", light, "--duration", "300ms", "--preemption", "none").stdout)

    def test_memory_is_locked_or_a_warning_says_why_not(self):
        def little():
            resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
        command = [PROGRAM, "run", self.cart, "--duration", "50ms", "--preemption", "none", "--mlockall"]
        for prepare in None, little:
            result = subprocess.run(command, capture_output=True, text=True, check=True, preexec_fn=prepare)
            if prepare and os.geteuid() != 0:
                self.assertIn("memory cannot be locked", result.stderr)
                self.assertIn("memlock unlimited", result.stderr)

    def test_run_is_finished_and_written(self):
        out = self.folder / "out"
        process = self.start("run", self.cart, "--duration", "1h", "--json", "--out", out)
        interrupt(process, 2)
        text, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0, errors)
        document = json.loads(text)
        self.assertTrue(document["stopped"])
        self.assertLess(document["end_ns"], 120e9)
        self.assertTrue((out / "jobs.csv").exists())

    def test_simulation_too(self):
        process = self.start("simulate", self.cart, "--duration", "10000h", "--max-events", "1000")
        interrupt(process, 1)
        text, errors = process.communicate(timeout=240)
        self.assertEqual(process.returncode, 0, errors)
        self.assertIn("stopped early", text)

    def test_one_wish_that_arrives_twice_is_one(self):
        # As timeout(1) does: first to the process, then to its group.
        process = self.start("run", self.cart, "--duration", "1h", "--json")
        interrupt(process, 2)
        time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        text, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0, errors)
        self.assertTrue(json.loads(text)["stopped"])

    def test_the_second_one_ends_it_at_once(self):
        # A job that cannot be waited for: the run asks it to end, and then waits for seconds.
        endless = self.write("endless.yaml", "name: e\nplatform: {workers: 1, preemption: none}\ndags:\n"
                             "  - {name: d, tasks: [{name: t, wcet: 1000s, period: 2000s}]}\n")
        process = self.start("run", endless, "--duration", "3000s")
        interrupt(process, 2)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130)

    def test_comparison_keeps_whole_rounds(self):
        process = self.start("compare", self.cart, "--executors", "redag-none,redag-cooperative", "--repeat", "1000",
                             "--duration", "100ms", "--json")
        interrupt(process, 6, signal.SIGTERM)
        text, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0, errors)
        self.assertIn("interrupted", errors)
        counts = {executor["repetitions"] for executor in json.loads(text)["executors"]}
        self.assertEqual(len(counts), 1)


class Compare(Case):
    def test_simulated(self):
        out = self.folder / "out"
        result = redag("compare", self.cart, "--simulate", "--duration", "2s", "--repeat", "2", "--json", "--out", out)
        document = self.document(result, "redag.comparison/1")
        self.assertEqual([executor["name"] for executor in document["executors"]], ["redag", "mte", "ste"])
        for executor in document["executors"]:
            self.assertEqual(executor["repetitions"], 2)
            self.assertTrue((out / executor["name"] / "repetition-2" / "events.jsonl").exists())
        self.assertEqual(len(document["verdicts"]), 2)
        self.assertEqual(json.loads((out / "comparison.json").read_text()), document)
        with open(out / "comparison.csv", newline="") as file:
            self.assertEqual(len(list(csv.DictReader(file))), 3 * 2 * 2)
        self.expect(redag("check-trace", out), 0)

    def test_on_threads(self):
        result = self.expect(redag("compare", self.cart, "--duration", "300ms", "--repeat", "1"), 0)
        self.assertRegex(result.stdout, r"fast: redag misses .* %, mte .* %, ste .* %: ")

    def test_bad_values(self):
        self.expect(redag("compare", self.cart, "--repeat", "20000"), 2, "--repeat: 20000 is more than 10000")
        self.expect(redag("compare", self.cart, "--simulate", "--executors", "redag,mte-fifo"), 2,
                    "the simulator has no threads: 'mte-fifo' is 'mte' there")

    def test_preemption_is_what_makes_the_difference(self):
        result = redag("compare", self.cart, "--simulate", "--executors", "redag-none,redag-os", "--duration", "1s")
        self.assertIn(": redag-os misses fewest", self.expect(result, 0).stdout)


if __name__ == "__main__":
    main()
