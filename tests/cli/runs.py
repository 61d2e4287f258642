#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests simulations, runs and comparisons: their output and files, and the effect of streams and signals.

Usage: runs.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import csv
import ctypes
import json
import os
import re
import resource
import shlex
import signal
import subprocess
import time
import unittest

from pftrace import Picture
from program import CART, PROGRAM, SANITIZED, SOURCE, Case, body, in_terminal, interrupt, main, redag


class Doctor(Case):
    def measured(self, *arguments):
        """Measures. The exit status depends on the machine."""
        path = self.folder / "overheads.yaml"
        result = redag("doctor", "--measure", "1s", "--out", path, *arguments)
        self.assertIn(result.returncode, (0, 1), result.stderr)
        return path, result.stdout

    def test_each_line_has_a_colour(self):
        result = redag("doctor")
        lines = re.findall(r"(?m)^(green|yellow|red|unknown) +([^:]+): .", result.stdout)
        self.assertLessEqual({"real-time right", "throttling", "clock source", "swap"}, {name for _, name in lines})
        self.assertEqual(result.returncode, 1 if "red" in dict(map(reversed, lines)).values() else 0, result.stdout)
        document = json.loads(redag("doctor", "--json").stdout)
        self.assertEqual(document["format"], "redag.doctor/1")
        self.assertEqual([(line["verdict"], line["name"]) for line in document["lines"]], lines)
        for line in document["lines"]:
            self.assertTrue(line["why"] and line["mend"] and line["found"], line)
        self.assertEqual(sum(document[colour] for colour in ("green", "yellow", "red", "unknown")), len(lines))

    @unittest.skipIf(SANITIZED, "a program with sanitizers has no real-time priorities, and does not notice")
    def test_without_rights_it_is_red(self):
        def without():
            resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
            ctypes.CDLL(None).prctl(24, 23, 0, 0, 0)  # PR_CAPBSET_DROP, CAP_SYS_NICE
        result = subprocess.run([PROGRAM, "doctor"], capture_output=True, text=True, check=False, preexec_fn=without)
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertRegex(result.stdout, r"(?m)^red +real-time right: SCHED_FIFO is not allowed$")
        self.assertIn("rtprio 95", result.stdout)

    def test_lines_fit_a_terminal(self):
        status, text = in_terminal("doctor", columns=80)
        self.assertIn(status, (0, 1))
        self.assertIn("\x1b[", text)
        plain = re.sub(r"\x1b\[[0-9;]*m", "", text).replace("\r", "")
        self.assertEqual(plain, redag("doctor", env={**os.environ, "COLUMNS": "80"}).stdout)
        for line in plain.splitlines():
            self.assertTrue(len(line) <= 80 or " " not in line.strip(), line)

    def test_a_running_process(self):
        workload = self.write("robot.yaml", CART.replace("name: cart", "name: attached"))
        with subprocess.Popen([PROGRAM, "run", workload, "--duration", "300s"], stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL) as process:
            deadline = time.monotonic() + 60
            while str(process.pid) not in redag("top", "--list").stdout:
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.05)
            document = json.loads(redag("doctor", "--attach", process.pid, "--json").stdout)
            text = redag("doctor", "--attach", process.pid).stdout
            process.kill()
        self.assertEqual(document["processes"], [str(process.pid)])
        self.assertIn("redag-timer", [thread["name"] for thread in document["threads"]])
        found = {line["name"]: line["found"] for line in document["lines"]}
        self.assertRegex(found["live page"], "^attached: preemption none, 1 worker, ")
        self.assertNotIn("middleware", found)
        self.assertIn("redag-timer", text)
        self.expect(redag("doctor", "--attach", process.pid), 2, "there is no process")

    def test_a_file_that_the_others_charge(self):
        path, text = self.measured()
        self.assertIn("wake-up latency: median ", text)
        self.assertRegex(text, r"(?m)^ *\d[\d.]*[mu]?s +\d[\d ]* +#+$")
        measured = set(re.findall(r"(?m)^    (\w+): [1-9]", path.read_text()))
        self.assertLessEqual({"clock", "lateness", "dispatch", "preempt", "timer", "stall"}, measured)
        self.assertIn("overheads charged on ordinary threads: timer ", text)
        self.assertIn("provenance:", path.read_text())
        plain = json.loads(redag("analyze", self.cart, "--json").stdout)
        charged = json.loads(redag("analyze", self.cart, "--json", "--overheads", path).stdout)
        self.assertGreater(charged["utilization"], plain["utilization"])
        self.assertGreater(charged["overheads_ns"]["dispatch"], 0)
        self.assertIn(str(path), charged["provenance"]["calibration"])
        self.assertIn("overheads: release", redag("simulate", self.cart, "--duration", "1s", "--overheads", path).stdout)

    def test_runs_and_their_reports_charge_it(self):
        # Overheads of a quiet machine. On a busy one no bound would remain.
        path = self.write("overheads.yaml", "overheads: {normal: {timer: 5us, dispatch: 50us, preempt: 5us, lateness: 1ms, stall: 2ms, "
                          "stall_per_second: 5ms, noise: 50us, noise_per_second: 5ms, clock: 1us}}\n")
        out = self.folder / "out"
        light = self.write("light.yaml", "name: light\ndags: [{name: d, tasks: [{name: t, wcet: 1ms, period: 100ms}]}]\n")
        arguments = ["run", light, "--preemption", "none", "--duration", "300ms", "--out", out]
        plain = json.loads(redag(*arguments, "--json").stdout)
        self.assertFalse(plain["bounds"]["calibrated"])
        document = json.loads(redag(*arguments, "--json", "--overheads", path).stdout)
        self.assertTrue(document["bounds"]["calibrated"])
        self.assertGreater(document["bounds"]["tasks"][0]["bound_ns"], plain["bounds"]["tasks"][0]["bound_ns"])
        report = json.loads(redag("report", out, "--json").stdout)
        self.assertIn("charged with the machine's overheads", report["groups"][0]["bounds"]["assumes"])
        self.assertEqual(report["groups"][0]["tasks"][0]["bound_ns"], document["bounds"]["tasks"][0]["bound_ns"])

    def test_without_one_the_run_says_so(self):
        result = self.expect(redag("run", self.cart, "--duration", "200ms", "--preemption", "none"), 0)
        self.assertIn("overheads of the platform are not charged; measure them with 'redag doctor --measure'", result.stdout)

    def test_bad_files(self):
        self.expect(redag("run", self.cart, "--overheads", self.folder / "none.yaml"), 2, "cannot open")
        wrong = self.write("wrong.yaml", "overheads:\n  normal: {timer: 1us, dispach: 2us}\n")
        self.expect(redag("analyze", self.cart, "--overheads", wrong), 2, "wrong.yaml:2:", "did you mean 'dispatch'")
        path, _ = self.measured()
        self.expect(redag("analyze", self.cart, "--overheads", path, "--overhead-dispatch", "1us"), 2, "excludes")
        normal = self.write("normal.yaml", re.sub(r"  realtime:\n(    .*\n)+", "", path.read_text()))
        self.expect(redag("analyze", self.cart, "--preemption", "os", "--overheads", normal), 2, "SCHED_FIFO")

    def test_bad_arguments(self):
        self.expect(redag("doctor", "--measure", "0"), 2, "--measure")
        self.expect(redag("doctor", "--measure", "5"), 2, "--measure", "no unit")
        self.expect(redag("doctor", "--measure="), 2, "--measure: the value is empty", "redag doctor --help")
        self.expect(redag("doctor", "--measure", "200h"), 2, "longer than a day")
        self.expect(redag("doctor", "--measure", "1s", "--out", self.folder / "no" / "folder.yaml"), 2, "folder.yaml")
        self.expect(redag("doctor", "--out", "overheads.yaml"), 2, "--measure")
        for pid in ("0", "-1", "x", "1x", "9" * 30):
            self.expect(redag("doctor", f"--attach={pid}"), 2, "--attach", "is not the number of a process")

    def test_interrupted_it_writes_nothing(self):
        path = self.write("before.yaml", "of an earlier calibration\n")
        with subprocess.Popen([PROGRAM, "doctor", "--measure", "10min", "--out", path], text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            interrupt(process, after=2)
            out, error = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 2, error)
        self.assertIn("interrupted: ", error)
        self.assertEqual(out, "")
        self.assertEqual(path.read_text(), "of an earlier calibration\n")


class Simulate(Case):
    def test_table_and_verdict(self):
        result = self.expect(redag("simulate", self.cart, "--duration", "1s"), 0)
        for words in ["fast.sense", "slow.plan", "preemption: none", "trace check: ok"]:
            self.assertIn(words, result.stdout)

    def test_json_and_files_agree(self):
        out = self.folder / "deep" / "out"
        result = redag("simulate", self.cart, "--duration", "2s", "--json", "--out", out)
        document = self.document(result, "redag.summary/2")
        self.assertTrue(document["check"]["ok"])
        written = json.loads((out / "summary.json").read_text())
        self.assertEqual(written, {key: document[key] for key in written})
        self.assertEqual(sorted(path.name for path in out.iterdir()),
                         ["events.redag", "jobs.csv", "summary.json", "trace.pftrace"])
        with open(out / "jobs.csv", newline="") as file:
            self.assertEqual(len(list(csv.DictReader(file))), document["total"]["released"])
        picture = Picture(out / "trace.pftrace")
        spans = [name for track, kind, name, _ in picture.events if kind == 1 and track in ("sense", "act", "plan")]
        self.assertEqual(len(spans), document["total"]["released"])

    def test_same_seed_same_bytes(self):
        arguments = ["simulate", SOURCE / "workloads" / "contention.yaml", "--duration", "1s", "--json"]
        first = redag(*arguments).stdout
        self.assertEqual(body(first), body(redag(*arguments).stdout))
        self.assertNotEqual(body(first), body(redag(*arguments, "--seed", "2").stdout))
        dated = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
        self.assertEqual(redag(*arguments, env=dated).stdout, redag(*arguments, env=dated).stdout)
        self.assertEqual(json.loads(redag(*arguments, env=dated).stdout)["provenance"]["created"], "2023-11-14T22:13:20Z")

    def test_every_file_says_where_it_comes_from(self):
        out = self.folder / "it's out"
        secret = {**os.environ, "SOME_TOKEN": "s3cr3t-value"}
        self.expect(redag("simulate", self.cart, "--duration", "1s", "--out", out, env=secret), 0)
        summary = json.loads((out / "summary.json").read_text())["provenance"]
        self.assertEqual(list(summary), ["created", "version", "revision", "host", "kernel", "command", "calibration"])
        self.assertRegex(summary["created"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        self.assertEqual(shlex.split(summary["command"]),
                         [str(PROGRAM), "simulate", str(self.cart), "--duration", "1s", "--out", str(out)])
        self.assertEqual(summary["host"], os.uname().nodename)
        self.assertIn(os.uname().release, summary["kernel"])
        self.assertEqual(summary["calibration"], "none")
        picture = Picture(out / "trace.pftrace").run
        self.assertEqual({key: picture[key] for key in summary}, summary)
        self.assertEqual(json.loads(redag("events", out).stdout.splitlines()[0])["provenance"], summary)
        for file in out.iterdir():
            self.assertNotIn(b"s3cr3t", file.read_bytes())

    def test_a_bad_source_date_epoch_is_an_error(self):
        self.expect(redag("simulate", self.cart, env={**os.environ, "SOURCE_DATE_EPOCH": "today"}), 2, "SOURCE_DATE_EPOCH 'today'")

    def test_the_command_line_overrides(self):
        document = self.document(redag("simulate", self.cart, "--duration", "1s", "--preemption", "cooperative",
                                       "--workers", "2", "--policy", "fifo", "--json"), "redag.summary/2")
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
        self.expect(redag("events", "--check", out), 0)
        self.assertGreater(json.loads((out / "summary.json").read_text())["end_ns"],
                           json.loads(redag("events", out).stdout.splitlines()[-1])["end_ns"])

    def test_folders_of_others_are_left_alone(self):
        (self.folder / "mine").mkdir()
        thesis = self.write("mine/thesis.tex", "years of work")
        arguments = ["simulate", self.cart, "--duration", "1s", "--out", self.folder / "mine"]
        self.expect(redag(*arguments), 0)
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


class Waits(Case):
    """Jobs that wait for devices: commands that know them, and the others, which refuse them by file and line."""

    FILE = SOURCE / "workloads" / "perception.yaml"

    def test_simulated_explained_and_checked(self):
        out = self.folder / "out"
        self.expect(redag("validate", "--strict", self.FILE), 0)
        result = self.expect(redag("simulate", self.FILE, "--duration", "2s", "--out", out, "--check"), 0)
        self.assertIn("perception", result.stdout)
        events = redag("events", out).stdout
        for kind in ("waits", "served", "woken"):
            self.assertIn(kind, events)
        self.expect(redag("events", "--check", out), 0)
        self.assertIn("waited without a worker", self.expect(redag("why", out, "lidar.segment#0"), 0).stdout)

    def test_bounded_on_one_worker(self):
        one = self.write("one.yaml", self.FILE.read_text().replace("workers: 2", "workers: 1"))
        self.expect(redag("analyze", one, "--check"), 0)
        explained = self.expect(redag("analyze", one, "--explain", "camera.detect"), 0)
        for line in "service at gpu", "blocking at gpu by", "less urgent work", "own execution":
            self.assertIn(line, explained.stdout)
        # Waits of more urgent tasks are no execution of theirs, so the second bound is the smaller one.
        self.assertIn("suspension_aware", explained.stdout)
        oblivious = ["--method", "rta_preemptive"]
        self.expect(redag("analyze", one, "--check", *oblivious), 0)
        # A device that serves in the order of requests lets each less urgent task go first.
        fifo = self.write("fifo.yaml", one.read_text().replace("queue: priority", "queue: fifo"))
        self.expect(redag("analyze", fifo, "--check", *oblivious), 1)
        late = self.write("late.yaml", fifo.read_text().replace("deadline: 50ms", "deadline: 30ms"))
        explained = self.expect(redag("analyze", late, "--explain", "camera.detect"), 0).stdout
        self.assertIn("what to change for the end-to-end deadline of camera, 30ms: ", explained)
        self.assertIn("queue: priority", explained)

    def test_bounded_on_several_workers(self):
        self.expect(redag("analyze", self.FILE, "--check"), 0)
        # Without preemption, a job of another DAG can keep each worker for longer than control has.
        text = self.expect(redag("analyze", self.FILE, "--check", "--preemption", "none"), 1).stdout
        self.assertIn("suggested change: preemption: os", text)
        document = json.loads(redag("analyze", self.FILE, "--json").stdout)
        terms = next(dag["terms"] for dag in document["dags"] if dag["name"] == "map")
        self.assertEqual({term["device"] for term in terms}, {None, "gpu"})

    def test_tuned_and_assigned(self):
        tuned = self.folder / "tuned.yaml"
        for command in (["tune", "--seeds", "2", "--duration", "1s"], ["tune", "--judge", "bounds", "--vary", "priorities"]):
            with self.subTest(command=command):
                self.expect(redag(command[0], self.FILE, *command[1:], "-o", tuned), 0)
                self.expect(redag("validate", tuned), 0)
                self.assertIn("device: gpu", tuned.read_text())
        margins = self.expect(redag("analyze", "--sensitivity", self.FILE), 0).stdout
        self.assertIn("lidar.segment", margins)

    def test_run_on_threads_and_checked(self):
        for mode in "none", "cooperative":
            with self.subTest(mode=mode):
                out = self.folder / mode
                self.expect(redag("run", self.FILE, "--preemption", mode, "--duration", "1s", "--out", out), 0)
                events = redag("events", out).stdout
                for kind in ("waits", "served", "woken"):
                    self.assertIn(kind, events)
                self.expect(redag("events", "--check", out), 0)
                task, number = json.loads(next(line for line in events.splitlines() if '"woken"' in line))[2:4]
                job = {4: "camera.detect", 6: "lidar.segment"}[task] + f"#{number}"
                self.assertIn("waited without a worker", self.expect(redag("why", out, job), 0).stdout)

    def test_others_refuse_them(self):
        where = f"{self.FILE}:{1 + self.FILE.read_text().splitlines().index(self.segments())}:"
        for arguments in (["run", "--executor", "mte"], ["simulate", "--executor", "mte"], ["compare"]):
            with self.subTest(arguments=arguments):
                self.expect(redag(arguments[0], self.FILE, *arguments[1:]), 2, where, "segments, which cannot be handled here")
        for executors in ("redag,mte,ste", "mte,redag-none,ste"):
            for file, text in ((self.FILE, None), ("-", self.FILE.read_text())):
                self.expect(redag("compare", file, "--executors", executors, text=text), 2,
                            "--executors: segments cannot be simulated for mte, ste", "redag-cooperative and redag-os")

    def test_compared(self):
        result = redag("compare", self.FILE, "--simulate", "--executors", "redag,redag-none", "--duration", "2s", "--json")
        of = {each["name"]: each for each in self.document(result, "redag.comparison/3")["executors"]}
        self.assertEqual(set(of), {"redag", "redag-none"})
        result = redag("compare", self.FILE, "--executors", "redag-none,redag-cooperative", "--duration", "500ms",
                       "--repeat", "1")
        self.assertIn("redag-cooperative", self.expect(result, 0).stdout)

    def segments(self):
        return next(line for line in self.FILE.read_text().splitlines() if "segments:" in line)


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
            table = [line for line in text.splitlines() if re.search(r"redag-(none|os) +\d[\d ]* +\d", line) and ":" not in line]
            self.assertEqual(len(table), 6, text)
            self.assertLessEqual(max(map(len, table)), columns, text)
        self.assertIn("no room for", text)
        for columns in (60, 40):
            for command in ([], ["simulate"], ["experiment"]):
                text = redag(*command, "--help", env={**os.environ, "COLUMNS": str(columns)}).stdout
                prose = [line for line in text.split("Examples:")[0].splitlines() if not line.startswith("Usage:")]
                self.assertLessEqual(max(map(len, prose)), columns, text)
            # Only the ends of paragraphs are short: a line that was broken before would be broken again.
            text = redag("simulate", SOURCE / "workloads" / "robot.yaml", "--duration", "1s",
                         env={**os.environ, "COLUMNS": str(columns)}).stdout
            self.assertNotRegex(text, r"\w;\n\w")

    def test_no_progress_in_a_pipe(self):
        self.assertNotIn(" %, ", self.expect(redag("run", self.cart, "--duration", "6s"), 0).stderr)

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
        self.assertEqual([task["bound_ns"] for task in document["bounds"]["tasks"][:2]], [5_999_999, 6_999_999])
        mte = json.loads(redag("run", light, "--duration", "300ms", "--executor", "mte", "--json").stdout)["bounds"]
        self.assertEqual(mte["bounded"], 3, mte)
        self.assertTrue({task["method"] for task in mte["tasks"]} <= {"wait_set", "dag_any"}, mte)
        self.assertIn("\nbounds: 3 of 3 tasks", redag("run", light, "--duration", "300ms", "--preemption", "none").stdout)

    def test_memory_is_locked_or_a_warning_says_why_not(self):
        def little():
            resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
        command = [PROGRAM, "run", self.cart, "--duration", "50ms", "--preemption", "none", "--mlockall"]
        for prepare in None, little:
            result = subprocess.run(command, capture_output=True, text=True, check=True, preexec_fn=prepare)
            if prepare and os.geteuid() != 0:
                self.assertIn("memory cannot be locked", result.stderr)
                self.assertIn("redag doctor", result.stderr)

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
        # As timeout(1) does: signals the process first, then its group.
        process = self.start("run", self.cart, "--duration", "1h", "--json")
        interrupt(process, 2)
        time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        text, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0, errors)
        self.assertTrue(json.loads(text)["stopped"])

    def test_the_second_one_ends_it_at_once(self):
        # A job that does not end: the run asks it to end, and then waits for seconds.
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


class Killed(Case):
    def killed_run(self, out, *arguments):
        process = subprocess.Popen([PROGRAM, "run", self.cart, "--duration", "1h", "--preemption", "none", "--out", out,
                                    *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        record = out / "events.redag"
        for _ in range(2000):  # until several collections are recorded
            if record.exists() and record.stat().st_size > 8000:
                break
            time.sleep(0.02)
        self.assertIn("still goes on", redag("events", "--check", out).stderr)
        process.kill()
        process.wait()

    def test_its_record_is_read_like_results(self):
        out = self.folder / "out"
        self.killed_run(out)
        self.assertEqual([path.name for path in out.iterdir()], ["events.redag"])
        self.assertIn("the run was killed, or still goes on", self.expect(redag("events", "--check", out), 0).stderr)
        self.assertIn("the run was killed", self.expect(redag("why", out), 0).stderr)
        text = self.expect(redag("report", out, "--json"), 0).stdout
        self.assertIn("the record ends here: the run was killed", text)
        jobs = self.folder / "jobs.csv"
        self.expect(redag("events", out, "--format", "jobs", "-o", jobs), 0)
        self.assertGreater(len(jobs.read_text().splitlines()), 10)

    def test_another_run_leaves_it(self):
        out = self.folder / "out"
        self.killed_run(out)
        result = self.expect(redag("run", self.cart, "--duration", "100ms", "--out", out), 0)
        self.assertIn("an earlier run did not end normally", result.stderr)
        self.assertEqual(sorted(path.name for path in out.iterdir()),
                         ["events.1.redag", "events.redag", "jobs.csv", "summary.json", "trace.pftrace"])
        self.assertEqual(self.expect(redag("events", "--check", out), 0).stderr, "")
        self.expect(redag("why", out / "events.1.redag"), 0)

    def test_a_small_record_keeps_the_newest(self):
        self.expect(redag("run", self.cart, "--record-size", "0", "--out", self.folder / "out"), 2, "--record-size")


class Compare(Case):
    def test_simulated(self):
        out = self.folder / "out"
        result = redag("compare", self.cart, "--simulate", "--duration", "2s", "--repeat", "2", "--json", "--out", out)
        document = self.document(result, "redag.comparison/3")
        self.assertEqual([executor["name"] for executor in document["executors"]], ["redag", "mte", "ste"])
        for executor in document["executors"]:
            self.assertEqual(executor["repetitions"], 2)
            self.assertTrue((out / executor["name"] / "repetition-2" / "events.redag").exists())
            runs = [json.loads((out / executor["name"] / f"repetition-{i}" / "summary.json").read_text()) for i in (1, 2)]
            for d, dag in enumerate(executor["dags"]):
                self.assertEqual(dag["end_to_end_max_ns"],
                                 max(run["dags"][d]["end_to_end"]["response"]["max_ns"] for run in runs))
                self.assertEqual(dag["missed"], sum(run["dags"][d]["missed"] for run in runs))
        self.assertEqual(len(document["verdicts"]), 2)
        self.assertEqual(json.loads((out / "comparison.json").read_text()), document)
        self.expect(redag("events", "--check", out), 0)

    def test_on_threads(self):
        result = self.expect(redag("compare", self.cart, "--duration", "300ms", "--repeat", "1"), 0)
        self.assertRegex(result.stdout, r"fast: redag misses .*, mte .*, ste .*: ")

    def test_bad_values(self):
        self.expect(redag("compare", self.cart, "--repeat", "20000"), 2, "--repeat: '20000' is not a whole number from 1 to 10000")
        self.expect(redag("compare", self.cart, "--simulate", "--executors", "redag,mte-fifo"), 2,
                    "the simulator has no threads to make real-time: 'mte-fifo' is the same as 'mte' there")

    def test_preemption_is_what_makes_the_difference(self):
        result = redag("compare", self.cart, "--simulate", "--executors", "redag-none,redag-os", "--duration", "1s")
        self.assertIn(": redag-os misses fewest", self.expect(result, 0).stdout)


if __name__ == "__main__":
    main()
