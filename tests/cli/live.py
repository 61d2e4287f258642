#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag top`, which watches runs.

Usage: live.py PROGRAM SOURCE_DIR. A terminal is emulated by pyte (python3-pyte).
"""
import fcntl
import json
import os
import pathlib
import re
import pty
import select
import signal
import struct
import subprocess
import tempfile
import termios
import time
import unittest

import pyte

from program import PROGRAM, SOURCE, Case, main, redag


class Top(Case):
    """Watches a live executor from outside. Other executors may run on this machine: each test looks for its own."""

    def start(self, *arguments, workload=None):
        process = subprocess.Popen([PROGRAM, "run", workload or self.cart, "--duration", "1h", "--json", *map(str, arguments)],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    def page(self, process):
        return pathlib.Path(f"/dev/shm/redag.{process.pid}.0")

    def frame_of(self, process, until=lambda frame: True):
        """Returns the first frame that satisfies the condition."""
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
        # Without preemption plan makes sense miss a release. Only plan has a bound: its own time and that of both
        # others.
        self.assertEqual([task["bound_ns"] for task in frame["tasks"]], [28_999_999, 28_999_999, 27_000_000])
        for task in frame["tasks"]:
            self.assertGreaterEqual(task["response"]["max_ns"], task["response"]["p50_ns"])
            self.assertGreater(task["cpu_ns"], 0)
            self.assertGreaterEqual(task["released"], task["finished"])
        later = self.frame_of(process, lambda f: f["sequence"] > frame["sequence"])
        self.assertGreater(later["up_ns"], frame["up_ns"])
        self.assertEqual(self.page(process).stat().st_mode & 0o7777, 0o600)
        self.assertRegex(self.expect(redag("top", "--list"), 0).stdout, r"(?m)^ *pid .* jobs +missed ")
        listed = {e["pid"]: e for e in json.loads(redag("top", "--list", "--json").stdout)["executors"]}
        self.assertEqual(listed[process.pid]["name"], "cart")

        text = self.expect(redag("top", process.pid, "--once"), 0).stdout
        self.assertIn("cart  redag", text)
        for column in ["rate/s", "p99", "deadline", "bound", "missed", "active"]:
            self.assertIn(column, text)
        # docs/live_page.md shows the same columns.
        picture = (SOURCE / "docs" / "images" / "top.svg").read_text(encoding="utf-8")
        head = re.search(r'y="([\d.]+)"[^>]*>task<', picture)[1]
        self.assertEqual(re.findall(rf'y="{head}"[^>]*>([^<]+)<', picture),
                         next(line for line in text.splitlines() if line.startswith("task ")).split())
        piped = self.expect(redag("top", process.pid), 0, "not a terminal")
        self.assertIn("plan", piped.stdout)
        self.assertNotIn("\033", piped.stdout)

        process.send_signal(signal.SIGINT)
        process.wait(timeout=100)
        self.assertFalse(self.page(process).exists())
        self.expect(redag("top", process.pid, "--once"), 1, "no live page")

    def test_devices_and_jobs_that_wait(self):
        process = self.start("--preemption", "none", workload=SOURCE / "workloads" / "perception.yaml")
        frame = self.frame_of(process, lambda f: f["devices"] and f["devices"][0]["served"] > 3
                              and sum(dag["away"] for dag in f["dags"]) > 0)
        gpu, = frame["devices"]
        self.assertEqual((frame["devices_in_all"], gpu["name"], gpu["slots"]), (1, "gpu", 1))
        self.assertGreater(gpu["busy_ns"], 0)
        self.assertGreaterEqual(gpu["busy_ns"], gpu["recent"]["busy_ns"])
        for task in frame["tasks"]:
            self.assertLessEqual(task["away"], task["active"])
            self.assertTrue(task["away"] == 0 or task["name"] in ("detect", "segment", "update"), task["name"])
        served = self.frame_of(process, lambda f: f["devices"][0]["tasks"])["devices"][0]
        self.assertEqual(served["used"], 1)
        self.assertIn(served["tasks"][0], ("camera.detect", "lidar.segment", "map.update"))
        text = self.expect(redag("top", process.pid, "--once"), 0).stdout
        self.assertRegex(text, r"\ngpu \d.+% busy, \d jobs? queued\n")
        self.assertRegex(text, r"\d jobs? away")

    def test_a_run_can_hide(self):
        process = self.start("--no-live")
        time.sleep(1.5)
        self.assertFalse(self.page(process).exists())

    def test_a_killed_run_leaves_nothing_for_long(self):
        # Any executor that starts meanwhile removes dead pages from /dev/shm: this one is in a folder of its own.
        with tempfile.TemporaryDirectory(dir="/dev/shm") as name:
            folder = pathlib.Path(name)
            process = self.start()
            self.linked(folder, process)
            process.kill()
            process.wait(timeout=100)
            self.assertEqual(len(list(folder.iterdir())), 1)
            self.expect(redag("top", process.pid, "--folder", folder, "--once"), 1, "no live page")
            self.assertEqual(list(folder.iterdir()), [])

    def test_pages_that_others_can_open_are_refused(self):
        process = self.start()
        self.frame_of(process)
        self.page(process).chmod(0o644)
        self.expect(redag("top", process.pid, "--once"), 2, "other users than its owner")
        self.page(process).chmod(0o600)
        self.expect(redag("top", process.pid, "--once"), 0)

    def test_bad_targets(self):
        self.expect(redag("top", "cart"), 2, "'cart' is not a process")
        self.expect(redag("top", "12."), 2, "'12.' is not a process")
        self.expect(redag("top", "--folder", self.folder), 1, "no running executor")
        self.expect(redag("top", "--folder", self.folder, "--list"), 1, "no running executor")

    def test_all_in_one_table(self):
        with tempfile.TemporaryDirectory(dir="/dev/shm") as name:
            folder = pathlib.Path(name)
            self.expect(redag("top", "--folder", folder, "--all"), 1, "no running executor")
            first, second = self.start(), self.start()
            for process in first, second:
                self.linked(folder, process)
            table = self.document(redag("top", "--folder", folder, "--all", "--json"), "redag.live-all/1")
            self.assertEqual({(task["pid"], task["dag"], task["name"]) for task in table["tasks"]},
                             {(process.pid, dag, task) for process in (first, second)
                              for dag, task in (("fast", "sense"), ("fast", "act"), ("slow", "plan"))})
            periods = [task["period_ns"] for task in table["tasks"]]
            self.assertEqual(periods, sorted(periods))
            self.assertEqual({task["priority"] for task in table["tasks"]}, {None}, "the workload has preemption none")
            text = self.expect(redag("top", "--folder", folder, "--all"), 0).stdout
            for word in ["level", "period", "fast.sense", str(first.pid), str(second.pid)]:
                self.assertIn(word, text)
            self.expect(redag("top", first.pid, "--folder", folder, "--all"), 2)

    def test_of_several_one_has_to_be_named(self):
        with tempfile.TemporaryDirectory(dir="/dev/shm") as name:
            folder = pathlib.Path(name)
            first, second = self.start(), self.start()
            for process in first, second:
                self.linked(folder, process)
            lower = min(first.pid, second.pid)
            result = self.expect(redag("top", "--folder", folder, "--once"), 2, "several executors are running", f"redag top {lower}")
            self.assertIn(str(first.pid), result.stderr)
            self.assertIn(str(second.pid), result.stderr)
            one = self.document(redag("top", f"{second.pid}.0", "--folder", folder, "--json"), "redag.live/1")
            self.assertEqual(one["pid"], second.pid)
            self.expect(redag("top", f"{second.pid}.1", "--folder", folder, "--once"), 1, "publishes no live page")

    def test_damaged_pages(self):
        page = self.folder / f"redag.{os.getpid()}.0"
        for content in [b"", b"redagtop", os.urandom(5000), b"redagtop" + os.urandom(100_000)]:
            page.write_bytes(content)
            page.chmod(0o600)
            self.expect(redag("top", "--folder", self.folder, "--once"), 2)
            self.expect(redag("top", "--folder", self.folder, "--list"), 0)

    def linked(self, folder, process):
        """Links the page of `process` into a folder without other pages. The folder is in /dev/shm, because links
        cannot leave it."""
        self.frame_of(process)
        os.link(self.page(process), folder / self.page(process).name)

    def test_on_a_terminal(self):
        """Tests keys, a new size, a restart of the executor, and the terminal afterwards."""
        first = self.start()
        self.frame_of(first)
        screen = Terminal(self, first.pid)
        screen.wait_for(f"redag {first.pid}")
        screen.wait_for("  sense")
        screen.press(">")
        screen.wait_for("by rate")
        screen.wait_for("fast.sense")
        screen.press("?")
        screen.wait_for("COLUMNS")
        screen.press("x")
        screen.wait_without("COLUMNS")
        screen.resize(12, 40)
        screen.wait_for("fast.act")
        screen.wait_for("? help")
        first.kill()
        first.wait(timeout=100)
        screen.resize(24, 80)
        screen.wait_for("the executor has ended")
        second = self.start()
        screen.wait_for(f"redag {second.pid}")
        screen.press("q")
        screen.end()

    def test_a_signal_gives_the_terminal_back(self):
        process = self.start()
        self.frame_of(process)
        for number, status in ((signal.SIGINT, 0), (signal.SIGTERM, 0), (signal.SIGHUP, -signal.SIGHUP)):
            screen = Terminal(self, process.pid)
            screen.wait_for(f"redag {process.pid}")
            os.kill(screen.pid, number)
            screen.end(status)

    def test_without_colours(self):
        process = self.start()
        self.frame_of(process)
        screen = Terminal(self, process.pid, NO_COLOR="1")
        screen.wait_for("  sense")
        screen.press("q")
        screen.end()
        self.assertNotRegex(screen.sent, r"\033\[(\d+;)*3[1-7]m")
        self.assertEqual(re.findall(r'.{0,60}[^\x00-\x7f].{0,30}', screen.sent), [])
        process = self.start()
        self.frame_of(process)
        plain = redag("top", process.pid, env={**os.environ, "TERM": "dumb"})
        self.assertNotIn("\033", self.expect(plain, 0, "one frame is printed").stdout)

    def test_an_executor_is_chosen(self):
        with tempfile.TemporaryDirectory(dir="/dev/shm") as name:
            folder = pathlib.Path(name)
            screen = Terminal(self, "--folder", folder)
            screen.wait_for("waiting for one")
            first, second = sorted((self.start(), self.start()), key=lambda process: process.pid)
            self.linked(folder, first)
            screen.wait_for(f"redag {first.pid}")  # the only executor
            self.linked(folder, second)
            screen.press("a")
            screen.wait(lambda: sum("fast.sense" in row for row in screen.screen.display) == 2, "not both executors")
            screen.press("\t")
            screen.wait_for(f"redag {first.pid}")
            screen.press("\t")
            screen.wait_for(f"redag {second.pid}")
            screen.press("\t")  # around the list
            screen.wait_for(f"redag {first.pid}")
            screen.press("a")
            screen.wait_for("sorted by urgency")
            screen.press("a")
            screen.wait_for(f"redag {first.pid}")
            screen.press(ESCAPE)
            screen.end()
            # Several executors: the program begins with the tasks of all.
            screen = Terminal(self, "--folder", folder)
            screen.wait_for("sorted by urgency")
            screen.press("\t")
            screen.wait_for(f"redag {first.pid}")
            screen.press("q")
            screen.end()

    def test_what_is_shown_is_chosen(self):
        process = self.start()
        self.frame_of(process)
        screen = Terminal(self, process.pid, "--sort", "cpu")
        screen.wait_for("sorted by cpu")
        for order in ["dag", "rate", "max", "misses", "cpu", "dag"]:
            screen.press(">")
            screen.wait_for(f"by {order}")
        screen.press(" ")
        screen.wait_for("paused")
        screen.press(" ")
        screen.wait_without("paused")
        # Leaves room for some of five rows: two DAGs and three tasks.
        screen.resize(10, 120)
        screen.wait_for("1-4 of 5")
        screen.press(END)
        screen.wait_for("  plan")
        screen.wait_for("2-5 of 5")
        screen.press(HOME)
        screen.wait_for("  sense")
        screen.press("q")
        screen.end()


HOME, END = "\033[1~", "\033[4~"
ESCAPE = "\033"


class Terminal:
    """Runs `redag top` on a terminal of its own, and knows what its screen shows."""

    def __init__(self, case, *arguments, **environment):
        self.case, self.sent = case, ""
        try:
            self.pid, self.terminal = pty.fork()
        except OSError as error:
            raise unittest.SkipTest(f"no pseudo-terminal to be had here: {error}") from error
        if self.pid == 0:
            os.environ.pop("NO_COLOR", None)
            os.environ.update(environment, TERM="screen-256color")  # one that pyte understands
            try:
                os.execv(PROGRAM, [str(PROGRAM), "top", *map(str, arguments), "--interval", "50ms"])
            finally:
                os._exit(127)
        self.screen = pyte.Screen(80, 24)
        self.stream = pyte.Stream(self.screen)
        self.resize(24, 80)

    def resize(self, lines, columns):
        fcntl.ioctl(self.terminal, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        self.screen.resize(lines, columns)

    def press(self, keys):
        os.write(self.terminal, keys.encode())

    def wait_for(self, text):
        self.wait(lambda: any(text in row for row in self.screen.display), f"no '{text}'")

    def wait_without(self, text):
        self.wait(lambda: not any(text in row for row in self.screen.display), f"still '{text}'")

    def wait(self, is_so, what):
        """Reads until the condition holds."""
        deadline = time.monotonic() + 100
        while not is_so():
            self.case.assertLess(time.monotonic(), deadline, what + " on:\n" + "\n".join(self.screen.display))
            if select.select([self.terminal], [], [], 1)[0]:
                self.read()

    def read(self):
        text = os.read(self.terminal, 65536).decode(errors="replace")
        self.sent += text
        self.stream.feed(text)

    def end(self, status=0):
        self.wait(lambda: "\033[?1049l" in self.sent, "the terminal was not given back")
        # Closing the terminal earlier would hang the program up.
        self.case.assertEqual(os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1]), status)
        self.case.assertIn("\033[?1049h", self.sent)
        os.close(self.terminal)


if __name__ == "__main__":
    main()
