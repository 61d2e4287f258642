#!/usr/bin/env python3
"""`redag top`: runs that are watched.

Usage: live.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import fcntl
import json
import os
import pathlib
import pty
import signal
import struct
import subprocess
import termios
import time
import unittest

from program import PROGRAM, Case, main, redag


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
            before, _, seen = seen.partition(text)
            return before

        read_until("\033[?1049h")
        read_until(f"redag {first.pid}")
        os.write(terminal, b"n")
        read_until("by name")
        read_until("fast.sense")
        os.write(terminal, b"t")
        read_until("since the start")
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 10, 40, 0, 0))
        read_until("fast.act")
        # Erased before it is written: afterwards the last character of a line as wide as the terminal would go, too.
        self.assertRegex(read_until("q quit"), r"\033\[J(\033\[\d+m)?\Z")
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


if __name__ == "__main__":
    main()
