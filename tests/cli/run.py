#!/usr/bin/env python3
"""The program `redag` as its users meet it: files, pipes, terminals, signals, full disks.

Usage: run.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import csv
import fcntl
import json
import os
import pathlib
import pty
import re
import signal
import struct
import subprocess
import termios
import time
import unittest

from program import CART, PROGRAM, SOURCE, Case, in_terminal, main, redag

COMMANDS = [["validate"], ["generate"], ["simulate"], ["run"], ["compare"], ["diff"], ["analyze"], ["sensitivity"], ["assign"], ["tune"],
            ["check-trace"], ["top"], ["report"], ["experiment"], ["experiment", "acceptance"],
            ["experiment", "factorial"], ["experiment", "merge"]]
MISTAKEN = """\
name: cart
platform: {workers: 1}
dags:
  - name: fast
    tasks:
      - {name: sense, wect: 1ms, period: 10ms}
      - {name: act, wcet: 1, activation: data, after: sense}
"""


class Usage(Case):
    def test_version(self):
        self.assertRegex(self.expect(redag("--version"), 0).stdout, r"^redag \d+\.\d+\.\d+\n$")

    def test_no_arguments(self):
        self.expect(redag(), 2, "Subcommands:", "check-trace")

    def test_help_of_every_command(self):
        listed = redag("--help").stdout
        for command in COMMANDS:
            self.assertIn(command[0], listed)
            text = self.expect(redag(*command, "--help"), 0).stdout
            self.assertIn(f"Usage: redag {' '.join(command)}", text)
            self.assertIn("Examples:", text)

    def test_examples_parse(self):
        """Every option in the examples of --help exists."""
        for command in COMMANDS:
            text = redag(*command, "--help").stdout
            options, examples = text.split("Examples:")
            for option in re.findall(r"--[a-z-]+", examples):
                self.assertIn(option, options, command)

    def test_mistakes_are_near_something(self):
        self.expect(redag("simualte", self.cart), 2, "did you mean 'simulate'?")
        self.expect(redag("simulate", self.cart, "--durtion", "1s"), 2, "did you mean '--duration'?")
        self.expect(redag("simulate", self.cart, "--policy", "rate_monotonc"), 2, "did you mean 'rate_monotonic'?")
        self.expect(redag("simulate", self.cart, "--executor", "mtee"), 2, "did you mean 'mte'?")
        self.expect(redag("compare", self.cart, "--executors", "redag,stee"), 2, "did you mean 'ste'?")

    def test_bad_values(self):
        for arguments, words in [(["--duration", "5"], "no unit"), (["--duration", "0s"], "not longer than 0"),
                                 (["--duration", "-1s"], "not longer than 0"), (["--seed", "-1"], "whole number"),
                                 (["--seed", "99999999999999999999"], "whole number"),
                                 (["--workers", "100000"], "workers"), (["--warmup", "20s"], "leaves nothing")]:
            self.expect(redag("simulate", self.cart, "--duration=10s" if "--duration" not in arguments else "--seed=1",
                              *arguments), 2, words)
        self.expect(redag("run", self.cart, "--affinity", "1-"), 2, "list of processors")
        self.expect(redag("simulate", self.cart, "--preemption", "os", "--policy", "edf"), 2, "static policy")
        self.expect(redag("simulate", self.cart, "--executor", "mte-fifo"), 2, "no threads")


class Validate(Case):
    def test_fine(self):
        self.assertIn("2 DAGs, 3 tasks", self.expect(redag("validate", self.cart), 0).stdout)

    def test_every_mistake_with_its_place(self):
        bad = self.write("bad.yaml", MISTAKEN)
        result = self.expect(redag("validate", bad, self.cart), 2, "did you mean 'wcet'?")
        self.assertRegex(result.stderr, rf"{re.escape(str(bad))}:6:\d+: error: .*wect")
        self.assertRegex(result.stderr, rf"{re.escape(str(bad))}:7:\d+: error: ")
        self.assertIn("cart.yaml: ok", result.stdout, "the other files are still looked at")

    def test_json(self):
        bad = self.write("bad.yaml", MISTAKEN)
        document = self.document(redag("validate", "--json", bad, self.cart), "redag.validate/1", 2)
        self.assertEqual([file["ok"] for file in document["files"]], [False, True])
        self.assertEqual(document["files"][0]["diagnostics"][0]["line"], 6)
        self.assertEqual(document["files"][1]["workload"]["hyperperiod_ns"], 100_000_000)

    def test_standard_input(self):
        self.expect(redag("validate", "-", text=CART), 0)
        self.expect(redag("validate", "-", text=MISTAKEN), 2, "<stdin>:6:")

    def test_what_is_no_workload(self):
        self.expect(redag("validate", self.folder), 2, str(self.folder))
        self.expect(redag("validate", "/no/such.yaml"), 2, "/no/such.yaml")
        self.expect(redag("validate", self.write("empty.yaml", "")), 2, "empty.yaml")
        binary = self.folder / "binary.yaml"
        binary.write_bytes(bytes(range(256)))
        self.expect(redag("validate", "--json", binary), 2)

    def test_name_that_is_not_utf8(self):
        name = os.fsencode(self.folder) + b"/\xff.yaml"
        result = subprocess.run([PROGRAM, "validate", "--json", name], capture_output=True, check=False)
        self.assertEqual(result.returncode, 2)
        json.loads(result.stdout)

    def test_strict(self):
        # 3 tasks of 60 % on one worker: legal, and a warning.
        text = CART.replace("wcet: 25ms", "wcet: 99ms")
        crowded = self.write("crowded.yaml", text)
        warned = redag("validate", crowded)
        if "warning:" not in warned.stderr:
            self.skipTest("nothing to warn of")
        self.expect(warned, 0)
        self.expect(redag("validate", "--strict", crowded), 2, "--strict")

    def test_workloads_of_the_repository(self):
        files = sorted((SOURCE / "workloads").rglob("*.yaml"))
        self.assertTrue(files)
        self.expect(redag("validate", *files), 0)


class Generate(Case):
    def test_same_seed_same_bytes(self):
        arguments = ["generate", "--dags", "3", "--seed", "5", "--shape", "fork_join"]
        self.assertEqual(redag(*arguments).stdout, redag(*arguments).stdout)
        self.assertNotEqual(redag(*arguments).stdout, redag(*arguments[:4], "6", *arguments[5:]).stdout)

    def test_is_valid_and_says_how_it_was_made(self):
        text = self.expect(redag("generate", "--periods", "robot", "--offsets", "--seed", "9"), 0).stdout
        self.assertTrue(text.startswith("# redag generate --periods robot --offsets --seed 9\n"), text[:80])
        self.expect(redag("validate", "-", text=text), 0)

    def test_many(self):
        sets = self.folder / "sets"
        self.expect(redag("generate", "--count", "5", "--seed", "10", "--out", sets), 0)
        files = sorted(sets.iterdir())
        self.assertEqual([file.name for file in files], [f"workload-{n}.yaml" for n in range(10, 15)])
        self.expect(redag("validate", *files), 0)
        self.assertEqual(files[2].read_text(), redag("generate", "--seed", "12").stdout)
        self.expect(redag("generate", "--count", "2"), 2, "--out")

    def test_impossible(self):
        self.expect(redag("generate", "--min-tasks", "9", "--max-tasks", "3"), 2, "error:")
        self.expect(redag("generate", "-o", "/no/such/folder/x.yaml"), 2, "/no/such/folder/x.yaml")
        self.expect(redag("generate", "-o", "/dev/full"), 2, "No space left")


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
        self.assertNotIn("bounds", json.loads(redag("run", light, "--duration", "300ms", "--executor", "mte",
                                                    "--json").stdout))
        self.assertIn("\nbounds: 3 of 3 tasks", redag("run", light, "--duration", "300ms", "--preemption", "none").stdout)

    def test_run_is_finished_and_written(self):
        out = self.folder / "out"
        process = self.start("run", self.cart, "--duration", "1h", "--json", "--out", out)
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        text, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0, errors)
        document = json.loads(text)
        self.assertTrue(document["stopped"])
        self.assertLess(document["end_ns"], 120e9)
        self.assertTrue((out / "jobs.csv").exists())

    def test_simulation_too(self):
        process = self.start("simulate", self.cart, "--duration", "10000h", "--max-events", "1000")
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        text, errors = process.communicate(timeout=240)
        self.assertEqual(process.returncode, 0, errors)
        self.assertIn("stopped early", text)

    def test_one_wish_that_arrives_twice_is_one(self):
        # As timeout(1) does: first to the process, then to its group.
        process = self.start("run", self.cart, "--duration", "1h", "--json")
        time.sleep(2)
        process.send_signal(signal.SIGINT)
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
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130)

    def test_comparison_keeps_whole_rounds(self):
        process = self.start("compare", self.cart, "--executors", "redag-none,redag-cooperative", "--repeat", "1000",
                             "--duration", "100ms", "--json")
        time.sleep(6)
        process.send_signal(signal.SIGTERM)
        text, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0, errors)
        self.assertIn("interrupted", errors)
        counts = {executor["repetitions"] for executor in json.loads(text)["executors"]}
        self.assertEqual(len(counts), 1)


class Top(Case):
    """A live executor, seen from outside. Others may run on this machine: each test looks for its own."""

    def start(self, *arguments):
        process = subprocess.Popen([PROGRAM, "run", self.cart, "--duration", "1h", "--json", *map(str, arguments)],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    def page(self, process):
        return pathlib.Path(f"/dev/shm/redag.{process.pid}.0")

    def frame_of(self, process, until=lambda frame: True):
        """The first frame that is as wanted."""
        deadline = time.monotonic() + 100
        while time.monotonic() < deadline:
            result = redag("top", process.pid, "--json")
            if result.returncode == 0:
                frame = json.loads(result.stdout)
                if until(frame):
                    return frame
            else:
                self.assertEqual(result.returncode, 1, result.stderr)  # not there yet
            time.sleep(0.1)
        return self.fail("no such frame came")

    def test_a_run_is_seen(self):
        process = self.start()
        frame = self.frame_of(process, lambda f: all(task["finished"] > 3 for task in f["tasks"]))
        self.assertEqual(frame["format"], "redag.live/1")
        self.assertEqual((frame["pid"], frame["name"], frame["program"]), (process.pid, "cart", "redag"))
        self.assertEqual([dag["name"] for dag in frame["dags"]], ["fast", "slow"])
        self.assertEqual([task["name"] for task in frame["tasks"]], ["sense", "act", "plan"])
        self.assertEqual([task["deadline_ns"] for task in frame["tasks"]], [10_000_000, 10_000_000, 100_000_000])
        self.assertEqual(frame["preemption"], "none")
        # Without preemption plan makes sense miss a release, and so has a bound alone: its own time and both others'.
        self.assertEqual([task["bound_ns"] for task in frame["tasks"]], [None, None, 27_000_000])
        for task in frame["tasks"]:
            self.assertGreaterEqual(task["response"]["max_ns"], task["response"]["p50_ns"])
            self.assertGreater(task["cpu_ns"], 0)
            self.assertGreaterEqual(task["released"], task["finished"])
        later = self.frame_of(process, lambda f: f["sequence"] > frame["sequence"])
        self.assertGreater(later["up_ns"], frame["up_ns"])
        self.assertEqual(self.page(process).stat().st_mode & 0o7777, 0o600)
        self.expect(redag("top", process.pid, "--list"), 0)
        listed = {e["pid"]: e for e in json.loads(redag("top", "--list", "--json").stdout)["executors"]}
        self.assertEqual(listed[process.pid]["name"], "cart")

        text = self.expect(redag("top", process.pid, "--once"), 0).stdout
        self.assertIn("cart  redag", text)
        for column in ["rate/s", "p99", "deadline", "bound", "missed", "active"]:
            self.assertIn(column, text)
        piped = self.expect(redag("top", process.pid), 0, "not on a terminal")
        self.assertIn("plan", piped.stdout)
        self.assertNotIn("\033", piped.stdout)

        process.send_signal(signal.SIGINT)
        process.wait(timeout=100)
        self.assertFalse(self.page(process).exists())
        self.expect(redag("top", process.pid, "--once"), 1, "no live page")

    def test_a_run_can_hide(self):
        process = self.start("--no-live")
        time.sleep(1.5)
        self.assertFalse(self.page(process).exists())

    def test_a_killed_run_leaves_nothing_for_long(self):
        process = self.start()
        self.frame_of(process)
        process.kill()
        process.wait(timeout=100)
        self.assertTrue(self.page(process).exists())
        self.expect(redag("top", process.pid, "--once"), 1, "no live page")
        self.assertFalse(self.page(process).exists())

    def test_pages_that_others_can_open_are_refused(self):
        process = self.start()
        self.frame_of(process)
        self.page(process).chmod(0o644)
        self.expect(redag("top", process.pid, "--once"), 2, "others than its owner")
        self.page(process).chmod(0o600)
        self.expect(redag("top", process.pid, "--once"), 0)

    def test_bad_targets(self):
        self.expect(redag("top", "cart"), 2, "'cart' is no process")
        self.expect(redag("top", "12."), 2, "'12.' is no process")
        self.expect(redag("top", "--folder", self.folder), 1, "no executor runs")

    def test_damaged_pages(self):
        page = self.folder / f"redag.{os.getpid()}.0"
        for content in [b"", b"redagtop", os.urandom(5000), b"redagtop" + os.urandom(100_000)]:
            page.write_bytes(content)
            page.chmod(0o600)
            self.expect(redag("top", "--folder", self.folder, "--once"), 2)
            self.expect(redag("top", "--folder", self.folder, "--list"), 0)

    def test_on_a_terminal(self):
        """Keys, a restart of the executor, and the terminal afterwards."""
        first = self.start()
        self.frame_of(first)
        try:
            pid, terminal = pty.fork()
        except OSError as error:
            raise unittest.SkipTest(f"no pseudo-terminal to be had here: {error}") from error
        if pid == 0:
            os.environ.update(TERM="xterm")
            try:
                os.execv(PROGRAM, [str(PROGRAM), "top", str(first.pid), "--interval", "50ms"])
            finally:
                os._exit(127)
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 120, 0, 0))
        seen = ""

        def read_until(text):
            nonlocal seen
            deadline = time.monotonic() + 100
            while text not in seen:
                self.assertLess(time.monotonic(), deadline, seen[-3000:])
                seen += os.read(terminal, 65536).decode(errors="replace")
            seen = seen[seen.index(text) + len(text):]

        read_until("\033[?1049h")
        read_until(f"redag {first.pid}")
        os.write(terminal, b"n")
        read_until("by name")
        read_until("fast.sense")
        os.write(terminal, b"t")
        read_until("since the start")
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 10, 40, 0, 0))
        read_until("fast.act")
        first.kill()
        first.wait(timeout=100)
        read_until("it has ended")
        second = self.start()
        read_until(f"redag {second.pid}")
        os.write(terminal, b"q")
        read_until("\033[?1049l")
        # Not closed before it has ended: that would hang it up.
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), 0)
        os.close(terminal)


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

    def test_preemption_is_what_makes_the_difference(self):
        result = redag("compare", self.cart, "--simulate", "--executors", "redag-none,redag-os", "--duration", "1s")
        self.assertIn(": redag-os misses fewest", self.expect(result, 0).stdout)


class Analyze(Case):
    def test_table_and_verdict(self):
        result = self.expect(redag("analyze", self.cart), 0)
        # One worker, run to completion: plan (25 ms) blocks fast, which has 10 ms.
        self.assertRegex(result.stdout, r"fast\.sense +10ms +- +- +no bound")
        self.assertRegex(result.stdout, r"slow\.plan +100ms +\S+ms +\S+ms +ok +dag_one_worker_deferred")
        self.assertIn("preemption: none\n", result.stdout)
        self.assertIn("not shown schedulable: 2 tasks without a bound", result.stdout)
        self.assertRegex(result.stdout, r"melani +does not apply +\S")

    def test_overrides_and_check(self):
        self.expect(redag("analyze", self.cart, "--check"), 1)
        preempted = self.expect(redag("analyze", self.cart, "--check", "--preemption", "os"), 0)
        self.assertIn("schedulable: every deadline is met, by ", preempted.stdout)
        self.expect(redag("analyze", self.cart, "--check", "--preemption", "os", "--policy", "fixed"), 0)
        self.expect(redag("analyze", self.cart, "--check", "--preemption", "os", "--workers", "2"), 0)
        self.expect(redag("analyze", self.cart, "--check", "--preemption", "os", "--overhead-dispatch", "5ms"), 1)

    def test_edges_between_rates_are_analysed(self):
        contention = SOURCE / "workloads" / "contention.yaml"
        self.expect(redag("analyze", contention, "--check"), 0)
        self.assertIn("data of other rates, waited for",
                      self.expect(redag("analyze", contention, "--explain", "perception"), 0).stdout)

    def test_auto_is_said(self):
        self.assertIn("auto is analysed as os", redag("analyze", SOURCE / "workloads" / "hello.yaml").stdout)
        text = redag("analyze", SOURCE / "workloads" / "hello.yaml", "--preemption", "cooperative").stdout
        self.assertIn("preemption: cooperative (no task has a region: the same as none)", text)

    def test_overload_is_certain(self):
        text = redag("analyze", self.write("over.yaml", CART.replace("25ms", "99ms"))).stdout
        self.assertIn("\nnot schedulable: the utilization, 1.190, is above what 1 worker can do", text)

    def test_explanation(self):
        text = self.expect(redag("analyze", self.cart, "--preemption", "os", "--explain", "slow.plan"), 0).stdout
        # 25 ms of its own and four times the 2 ms of fast: in 33 ms, fast comes at 0, 10, 20 and 30.
        self.assertIn("slow.plan: answers within 33ms of its release, deadline 100ms: ok", text)
        self.assertRegex(text, r"own execution +slow.plan +1 +25ms +75\.8 %")
        self.assertRegex(text, r"interference of +fast +4 +8ms +24\.2 %")
        self.assertIn("what to change: the largest term is 25ms of 33ms", text)
        text = self.expect(redag("analyze", self.cart, "--explain", "fast"), 0).stdout
        self.assertIn("fast: no bound", text)
        self.assertIn("jobs would be skipped", text)

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

    def test_exploration(self):
        # plan is released with fast, whose two jobs go first, and has ended when fast comes again.
        short = self.write("short.yaml", CART.replace("25ms", "7ms"))
        text = self.expect(redag("analyze", "--explore", short, "--check"), 0).stdout
        self.assertRegex(text, r"exploration +schedulable +bounds 3 of 3 tasks; \d+ states, 21 jobs a hyperperiod, exact")
        self.assertRegex(text, r"slow\.plan +3ns +9ms")
        document = json.loads(redag("analyze", "--explore", short, "--json").stdout)
        self.assertEqual(document["exploration"]["end"], "complete")
        worst = {task["name"]: task["worst_ns"] for task in document["exploration"]["tasks"]}
        for task in document["tasks"]:
            self.assertLessEqual(task["bound_ns"], worst[task["name"]])
        self.assertNotIn("exploration", json.loads(redag("analyze", short, "--json").stdout))

    def test_exploration_ends_early(self):
        text = self.expect(redag("analyze", "--explore", self.cart), 0).stdout
        self.assertRegex(text, r"exploration +not shown .*; fast/\w+ can end after its next release")
        short = self.write("short.yaml", CART.replace("25ms", "7ms"))
        text = self.expect(redag("analyze", "--explore=21", short), 0).stdout
        self.assertIn("gave up at 21 states", text)
        self.assertIn("dag_one_worker_deferred    schedulable", text)
        self.expect(redag("analyze", "--explore=0", short), 2, "'0' is not a number of states, 1 or more")
        self.expect(redag("analyze", "--explore=many", short), 2, "'many' is not a number of states, 1 or more")
        text = self.expect(redag("analyze", "--explore", short, "--preemption", "os"), 0).stdout
        self.assertRegex(text, r"exploration +does not apply +for jobs that run to completion")

    def test_bad_input(self):
        self.expect(redag("analyze"), 2, "FILE is required")
        self.expect(redag("analyze", self.write("bad.yaml", MISTAKEN)), 2, "did you mean 'wcet'?")
        self.expect(redag("analyze", self.cart, "--preemption", "os", "--policy", "edf"), 2, "static policy")
        self.expect(redag("analyze", self.cart, "--overhead-release", "-1us"), 2, "--overhead-release")

    def test_no_simulated_response_is_above_its_bound(self):
        bounded = 0
        for seed in range(1, 25):
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

    def test_narrow_terminal(self):
        status, text = in_terminal("analyze", self.cart, columns=50, NO_COLOR="1")
        self.assertEqual(status, 0, text)
        rows = [line for line in text.splitlines() if re.match(r"(fast|slow|melani)", line)]
        self.assertLessEqual(max(map(len, rows)), 50, text)


# Harmonic, U = 1/4 + 1/8 + 1/8: with rate-monotonic priorities on one worker everything up to U = 1 is schedulable.
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
# By rate b answers after 5 ms, by deadline after 2 ms.
SHORT_DEADLINE = """\
name: short
platform: {workers: 1, preemption: os}
# a comment, which is not kept
dags:
  - name: a
    tasks: [{name: t, wcet: 3ms, bcet: 1ms, period: 10ms}]
  - name: b
    tasks: [{name: t, wcet: 2ms, period: 20ms, deadline: 4ms, group: bus}]
"""


class Sensitivity(Case):
    def limits(self, result):
        document = self.document(result, "redag.sensitivity/1")
        return document, {row["name"]: row for row in document["limits"]}

    def test_harmonic_periods(self):
        file = self.write("harmonic.yaml", HARMONIC)
        text = self.expect(redag("sensitivity", file), 0).stdout
        self.assertIn("schedulable: every deadline is met", text)
        self.assertRegex(text, r"all wcets +- +- +2\.0000 +utilization above 1")
        self.assertRegex(text, r"wcet of b\.t +1ms +5ms +5\.0000")
        self.assertIn("all execution times together can grow to 2.0000 times what they are", text)
        self.assertNotIn("not monotone", text)
        document, rows = self.limits(redag("sensitivity", file, "--json"))
        self.assertTrue(document["schedulable"])
        self.assertEqual(rows["all rates"]["factor"], 2)
        self.assertEqual(rows["wcet of b.t"]["limit_ns"], 5_000_000)
        self.assertTrue(all(row["monotone"] for row in rows.values()))

    def test_what_has_to_shrink(self):
        file = self.write("heavy.yaml", HARMONIC.replace("wcet: 2ms", "wcet: 14ms"))  # U = 5/4
        text = self.expect(redag("sensitivity", file), 0).stdout
        self.assertIn("all execution times together have to shrink to 0.8000 of what they are", text)
        self.assertIn("alone suffices, with the least change: wcet of c.t, from 14ms to 10ms", text)
        self.expect(redag("sensitivity", file, "--check"), 1)
        hopeless = self.write("hopeless.yaml", HARMONIC.replace("wcet: 2ms", "wcet: 17ms").replace("1ms", "9ms"))
        self.assertIn("none of the execution times looked at suffices alone", redag("sensitivity", hopeless).stdout)

    def test_limits_hold_in_the_analysis(self):
        _, rows = self.limits(redag("sensitivity", self.cart, "--preemption", "os", "--json"))
        limit = rows["wcet of slow.plan"]["limit_ns"]
        for wcet, status in ((limit, 0), (limit + 1, 1)):
            changed = self.write("changed.yaml", CART.replace("25ms", f"{wcet}ns"))
            self.expect(redag("analyze", changed, "--preemption", "os", "--check"), status)
        period = rows["period of fast"]["limit_ns"]
        for value, status in ((period, 0), (period - 1, 1)):
            changed = self.write("changed.yaml", CART.replace("period: 10ms", f"period: {value}ns"))
            self.expect(redag("analyze", changed, "--preemption", "os", "--check"), status)

    def test_the_simulator_is_never_behind_the_bounds(self):
        compared = 0
        for seed in range(1, 9):
            text = redag("generate", "--seed", seed, "--dags", 3, "--utilization", "0.8", "--workers", 1 + seed % 2).stdout
            for mode in ("none", "os"):
                result = redag("sensitivity", "-", "--preemption", mode, "--simulate", "--probes", "4", "--json", text=text)
                document, rows = self.limits(result)
                for row in rows.values():
                    if document["schedulable"] and row["kind"] in ("wcet", "all_wcets"):
                        compared += 1
                        self.assertGreaterEqual(row["simulated"]["factor"], row["factor"], (seed, mode, row["name"]))
        self.assertGreater(compared, 10)

    def test_where_no_bound_speaks_the_simulator_does(self):
        text = self.expect(redag("sensitivity", SOURCE / "workloads" / "robot.yaml", "--simulate"), 0).stdout
        self.assertIn("no method that bounds response times applies", text)
        self.assertRegex(text, r"in simulation, which proves nothing, all execution times together go to 1\.\d+ times")

    def test_one_task(self):
        _, rows = self.limits(redag("sensitivity", self.cart, "--task", "fast.act", "--json"))
        self.assertEqual(set(rows), {"wcet of fast.act", "period of fast"})
        _, rows = self.limits(redag("sensitivity", self.cart, "--task", "fast", "--json"))
        self.assertEqual(set(rows), {"wcet of fast.sense", "wcet of fast.act", "period of fast"})
        self.expect(redag("sensitivity", self.cart, "--task", "slow.plam"), 2, "did you mean 'slow.plan'?")

    def test_bad_input(self):
        self.expect(redag("sensitivity"), 2, "FILE is required")
        self.expect(redag("sensitivity", self.write("bad.yaml", MISTAKEN)), 2, "bad.yaml:6")
        self.expect(redag("sensitivity", self.cart, "--probes", "1000000"), 2, "--probes")

    def test_interrupt_keeps_what_was_found(self):
        many = redag("generate", "--seed", 3, "--dags", 60, "--shape", "independent", "--utilization", "2.4",
                     "--workers", 4, "--preemption", "os").stdout
        process = subprocess.Popen([PROGRAM, "sensitivity", "-", "--simulate", "--probes", "20000", "--json"],
                                   stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        process.stdin.write(many)
        process.stdin.close()
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        out, err = process.stdout.read(), process.stderr.read()
        self.assertEqual(process.wait(timeout=60), 0, err)
        process.stdout.close()
        process.stderr.close()
        self.assertIn("interrupted", err)
        self.assertTrue(json.loads(out)["stopped"])


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
        self.assertIn("better fast.sense: missed 10.0 % -> 0.0 %", result.stdout)
        self.assertIn("worse slow.plan: p50 27ms -> 33ms", result.stdout)
        self.assertNotIn("lasts longer than the blocks", result.stdout)
        self.expect(redag("diff", none, full, "--check"), 1)
        self.expect(redag("diff", none, none, "--check"), 0)
        self.assertIn("no figure differs", redag("diff", none, none).stdout)
        document = self.document(redag("diff", none, full, "--json"), "redag.difference/1")
        self.assertEqual(document["changes"], [{"kind": "setting", "what": "preemption", "a": "none", "b": "os"}])
        self.assertEqual([row["task"] for row in document["rows"]], [None, None, "sense", "act", None, "plan"])
        self.assertTrue(document["worse"] and document["better"])
        self.assertEqual(redag("diff", none, full, "--json").stdout, redag("diff", none, full, "--json").stdout)

    def test_repetitions(self):
        file = self.write("random.yaml", CART.replace("wcet: 1ms, period", "wcet: 1ms, bcet: 1us, period"))
        folder = self.folder / "cmp"
        self.expect(redag("compare", file, "--simulate", "--duration", "20s", "--repeat", "3", "--executors",
                          "redag,mte", "--out", folder), 0)
        result = redag("diff", folder / "mte", folder / "redag", "--json")
        self.assertEqual(self.document(result, "redag.difference/1")["a"]["seeds"], [1, 2, 3])
        self.expect(redag("diff", folder, folder / "mte"), 2, "holds runs of several kinds: redag, mte", "name one of them")
        # Repetitions by any other name, as run_workload of redag_rclcpp has them.
        for n in 1, 2, 3:
            (folder / "redag" / f"repetition-{n}").rename(folder / "redag" / str(n))
        again = self.document(redag("diff", folder / "mte", folder / "redag", "--json"), "redag.difference/1")
        self.assertEqual(again["b"]["seeds"], [1, 2, 3])
        self.assertEqual(again["rows"], json.loads(result.stdout)["rows"])

    def test_other_workload(self):
        one = self.results("one")
        other = self.results("other", file=self.write("other.yaml", CART.replace("25ms", "20ms")))
        self.expect(redag("diff", one, other), 2, "different workloads: wcet of slow.plan: 25ms -> 20ms", "--different")
        result = self.expect(redag("diff", one, other, "--different"), 0)
        self.assertIn("beware the two ran different workloads", result.stdout)

    def test_bad_input(self):
        one = self.results("one")
        self.expect(redag("diff", one), 2, "B is required")
        self.expect(redag("diff", one, self.folder / "nowhere"), 2, "nowhere")
        (self.folder / "empty").mkdir()
        self.expect(redag("diff", one, self.folder / "empty"), 2, "no events.jsonl")
        self.expect(redag("diff", one, one, "--tolerance", "2"), 2, "not a share from 0 to 1")
        self.expect(redag("diff", one, one, "--replicates", "1"), 2, "--replicates")


class Assign(Case):
    def test_by_deadline(self):
        file = self.write("short.yaml", SHORT_DEADLINE)
        tuned = self.folder / "tuned.yaml"
        result = self.expect(redag("assign", file, "-o", tuned), 0, "wrote")
        self.assertIn("change policy: rate_monotonic -> deadline_monotonic", result.stdout)
        self.assertIn("gain: the workload is shown schedulable", result.stdout)
        self.assertIn("worst lateness (bound - deadline): 1ms -> -2ms", result.stdout)
        self.expect(redag("analyze", file, "--check"), 1)
        self.expect(redag("analyze", tuned, "--check"), 0)
        self.expect(redag("validate", "--strict", tuned), 0)
        self.assertIn("bcet: 1ms", tuned.read_text())
        self.assertIn("group: bus", tuned.read_text())
        again = self.expect(redag("assign", tuned, "--check"), 0)
        self.assertIn("nothing to change", again.stdout)

    def test_audsley(self):
        # J. Lehoczky, RTSS 1990: deadlines beyond periods, where neither rates nor deadlines decide.
        file = self.write("lehoczky.yaml", """\
name: lehoczky
platform: {workers: 1, preemption: os}
dags:
  - name: a
    tasks: [{name: t, wcet: 52ms, period: 100ms, deadline: 110ms, overrun: {queue: 2}}]
  - name: b
    tasks: [{name: t, wcet: 52ms, period: 140ms, deadline: 154ms, overrun: {queue: 2}}]
""")
        tuned = self.folder / "tuned.yaml"
        text = self.expect(redag("assign", file, "-o", tuned), 0).stdout
        self.assertIn("change policy: rate_monotonic -> fixed", text)
        self.assertIn("change priority of b.t: none -> 2", text)
        self.assertIn("Audsley's assignment, by rta_preemptive: finds an order that passes", text)
        self.expect(redag("analyze", tuned, "--check"), 0)
        run = json.loads(self.expect(redag("simulate", tuned, "--json", "--check"), 0).stdout)
        self.assertTrue(run["check"]["ok"])

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
        document = self.document(redag("assign", file, "--json"), "redag.assignment/1")
        self.assertEqual(document["changes"], ["max_active of wide: none -> 2"])
        self.assertTrue(document["exhaustive"])
        self.assertEqual([trial["max_active"]["wide"] for trial in document["trials"]], [0, 1, 2, 3])
        self.assertEqual([trial["schedulable"] for trial in document["trials"]], [False, True, True, False])
        kept = self.document(redag("assign", file, "--keep", "max_active", "--json"), "redag.assignment/1")
        self.assertFalse(kept["schedulable"])
        self.expect(redag("assign", file, "--keep", "max_active", "--check"), 1)
        local = redag("assign", file, "--exhaustive", "0", "--seed", "7", "--json")
        self.assertEqual(json.loads(local.stdout)["best"], document["best"])
        self.assertEqual(local.stdout, redag("assign", file, "--exhaustive", "0", "--seed", "7", "--json").stdout)

    def test_bad_input(self):
        self.expect(redag("assign"), 2, "FILE is required")
        self.expect(redag("assign", self.write("bad.yaml", MISTAKEN)), 2, "bad.yaml:6")
        self.expect(redag("assign", self.cart, "--objective", "latenes"), 2, "did you mean 'lateness'?")
        self.expect(redag("assign", self.cart, "-o", self.folder / "no" / "where.yaml"), 2)

    def test_workloads_of_the_repository(self):
        for file in sorted((SOURCE / "workloads").rglob("*.yaml")):
            tuned = self.folder / "tuned.yaml"
            self.expect(redag("assign", file, "--preemption", "none", "--exhaustive", "50", "-o", tuned), 0)
            self.expect(redag("validate", tuned), 0)
        text = self.expect(redag("assign", SOURCE / "workloads" / "robot.yaml"), 0).stdout
        self.assertIn("nothing to compare: no method bounds any response time", text)


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
        self.assertRegex(result.stdout, r"misses, on seeds that the search has not seen: [\d ]+ \([\d.]+ %\) -> none")
        self.assertIn("seed by seed: 10 better, 0 equal, 0 worse", result.stdout)
        self.expect(redag("validate", "--strict", tuned), 0)
        self.assertIn("bcet: 20ms", tuned.read_text())
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

    def test_json_is_the_same_for_every_number_of_processors(self):
        file = self.write("wide.yaml", self.WIDE)
        one = redag("tune", file, "--jobs", "1", "--duration", "2s", "--json")
        document = self.document(one, "redag.tuning/1")
        self.assertEqual(one.stdout, redag("tune", file, "--jobs", "3", "--duration", "2s", "--json").stdout)
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
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=250)
        self.assertIn("interrupted", err)
        self.assertIn(process.returncode, (0, 2))  # 2: not even the workload as it is was judged
        self.assertEqual(process.returncode == 0, "stopped after" in out)

    def test_bad_input(self):
        self.expect(redag("tune"), 2, "FILE is required")
        self.expect(redag("tune", self.write("bad.yaml", MISTAKEN)), 2, "bad.yaml:6")
        self.expect(redag("tune", self.cart, "--objective", "misess"), 2, "did you mean 'misses'?")
        self.expect(redag("tune", self.cart, "--vary", "worker"), 2, "did you mean 'workers'?")
        self.expect(redag("tune", self.cart, "--caps", "5-2"), 2, "write it as 2-5")
        self.expect(redag("tune", self.cart, "--seeds", "0"), 2, "--seeds")
        self.expect(redag("tune", self.cart, "-o", self.folder / "no" / "where.yaml"), 2)


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
        # The same events under another policy: somebody was chosen against the rules.
        lie = text.replace('"policy":"rate_monotonic"', '"policy":"fifo"', 1)
        self.assertNotEqual(lie, text)
        result = self.expect(redag("check-trace", self.write("lie.jsonl", lie)), 1)
        self.assertIn("violations", result.stdout)
        document = self.document(redag("check-trace", "--json", self.folder / "lie.jsonl"), "redag.check-trace/1", 1)
        self.assertGreater(document["traces"][0]["check"]["violation_count"], 0)

        # Nodes see no decisions: of them nobody can say that.
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
        self.assertEqual((self.folder / "again.html").read_text(), page, "equal results make equal bytes")
        # A page among the results does not keep the next run from writing there.
        self.results("out")

    def test_data(self):
        document = self.document(redag("report", self.results("out"), "--json"), "redag.report/1")
        group = document["groups"][0]
        self.assertEqual(group["label"], "redag")
        summary = json.loads((self.folder / "out" / "summary.json").read_text())
        for key in ["released", "finished", "late", "skipped", "in_flight", "max_lateness_ns"]:
            self.assertEqual(group["total"][key], summary["total"][key], key)
        self.assertEqual(group["total"]["response"], group["total"]["response"] | summary["total"]["response"])
        self.assertFalse((self.folder / "out" / "report.html").exists(), "--json alone writes no page")

    def test_comparison(self):
        out = self.folder / "cmp"
        self.expect(redag("compare", self.cart, "--simulate", "--executors", "ste,redag", "--repeat", "2", "--duration", "1s",
                          "--out", out), 0)
        document = self.document(redag("report", out, "--json"), "redag.report/1")
        self.assertEqual([group["label"] for group in document["groups"]], ["ste", "redag"], "as they were listed")
        self.assertEqual([len(group["runs"]) for group in document["groups"]], [2, 2])
        self.assertEqual([row["name"] for row in document["comparison"]["dags"]], ["fast", "slow"])

    def test_folders_are_told_apart_by_name(self):
        first, second = self.results("before/redag"), self.results("after/redag", "--executor", "mte")
        document = self.document(redag("report", first, second, first, "--json"), "redag.report/1")
        self.assertEqual([group["label"] for group in document["groups"]], ["before/redag", "after/redag"])

    def test_mistakes(self):
        self.expect(redag("report"), 2, "DIR")
        self.expect(redag("report", self.folder), 2, "no events.jsonl", "--out")
        self.expect(redag("report", self.folder / "nowhere"), 2, "nowhere")
        out = self.results("out")
        self.expect(redag("report", out, "-o", "/nowhere/report.html"), 2, "/nowhere/report.html")
        (out / "comparison.json").write_text("{}")
        self.expect(redag("report", out), 2, "comparison.json:1", "not a comparison")
        (out / "comparison.json").unlink()
        events = (out / "events.jsonl").read_text().splitlines(keepends=True)
        (out / "events.jsonl").write_text("".join(events[:-1]))
        self.expect(redag("report", out), 2, f"events.jsonl:{len(events) - 1}", "ends too early")

    def test_repetitions_of_different_things(self):
        self.results("out/repetition-1")
        self.results("out/repetition-2", "--executor", "mte")
        self.expect(redag("report", self.folder / "out"), 2, "repetition-2/events.jsonl: is no repetition")


if __name__ == "__main__":
    main()
