# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests robot files from outside: as one workload, and `redag arrange` on real processes with named threads.

Usage: arrange.py PROGRAM SOURCE_DIR.
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

from program import PROGRAM, SANITIZED, SOURCE, Case, body, interrupt, main, redag

EXAMPLE = SOURCE / "examples" / "robot" / "cart.yaml"
PATIENCE = 60  # s; only a broken program needs them
ORDINARY = ("OTHER", os.getpriority(os.PRIO_PROCESS, 0))  # what processes of these tests begin with

# A process whose threads have the names that it is told, and wait. It prints their numbers.
NAMED = """
import ctypes, sys, threading
libc = ctypes.CDLL(None)
begun = threading.Barrier(len(sys.argv) - 1)
def wait(name):
    libc.prctl(15, name.encode(), 0, 0, 0)
    numbers[name] = threading.get_native_id()
    begun.wait()
    threading.Event().wait()
numbers = {}
for name in sys.argv[2:]:
    threading.Thread(target=wait, args=(name,), daemon=True).start()
begun.wait()
print(*(numbers[name] for name in sys.argv[2:]), flush=True)
sys.stdin.read()
"""

ROBOT = """\
robot: test
cpus: {cpus}
processes:
  - name: driver
    match: {{command: "*{token}*"}}
    workload:
      dags:
        - name: d
          tasks: [{{name: loop, wcet: 1ms, period: 10ms}}, {{name: slow, wcet: 1ms, period: 50ms}}]
threads:
  - {{name: loop, match: {{process: driver, thread: "rx*"}}, level: {{task: driver.d.loop}}}}
  - {{name: slow, match: {{process: driver, thread: slow}}, level: {{task: driver.d.slow}}}}
  - {{name: logs, match: {{process: driver, thread: log}}, level: {{nice: 5}}}}
"""


def may_use_fifo():
    """Asked of a child: this process stays as it is."""
    code = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(80))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def state(tid):
    """Returns how a thread is scheduled: ("FIFO", 80) or ("OTHER", nice)."""
    policy = os.sched_getscheduler(tid) & ~os.SCHED_RESET_ON_FORK
    if policy == os.SCHED_FIFO:
        return "FIFO", os.sched_getparam(tid).sched_priority
    return "OTHER", os.getpriority(os.PRIO_PROCESS, tid)


class Robots(Case):
    def write_robot(self):
        """A robot that only this test's processes match."""
        self.token = f"token-{os.getpid()}-{time.monotonic_ns()}"
        cpus = ",".join(map(str, sorted(os.sched_getaffinity(0))))
        self.robot = self.write("robot.yaml", ROBOT.format(token=self.token, cpus=f'"{cpus}"'))
        self.state = self.folder / "state.json"

    def start(self, *names):
        """Starts a process with threads of these names. Returns it, and the numbers of its threads."""
        process = subprocess.Popen([sys.executable, "-c", NAMED, self.token, *names], stdin=subprocess.PIPE,
                                   stdout=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process, list(map(int, process.stdout.readline().split()))

    def arrange(self, *arguments):
        return redag("arrange", self.robot, "--state", self.state, *arguments)

    def until(self, condition, what):
        end = time.monotonic() + PATIENCE
        while not condition():
            self.assertLess(time.monotonic(), end, what)
            time.sleep(0.02)

    # --- an order by the bounds ---

    def test_the_bounds_put_the_detector_first(self):
        arm = SOURCE / "examples" / "robot" / "arm.yaml"
        result = self.expect(redag("arrange", arm, "--rtprio", "90", "--json"), 0)
        plan = json.loads(result.stdout)
        self.assertEqual(plan["policy"], "audsley")
        self.assertEqual(plan["search"], {"tests": ["guan with deadlines for responses"], "found": True})
        self.assertEqual([row["members"] for row in plan["levels"]],
                         [["vision.detector.detect"], ["left.joints.control"], ["right.joints.control"], ["left.log.state"]])
        self.assertEqual(plan["executors"]["left"], [79, 77])
        self.expect(redag("analyze", arm, "--check"), 0)
        by_rate = self.write("arm.yaml", arm.read_text().replace("policy: audsley", "policy: rate_monotonic"))
        self.expect(redag("analyze", by_rate, "--check"), 1)
        text = self.expect(redag("arrange", arm, "--rtprio", "90"), 0).stdout
        self.assertIn("arm: one order by audsley (guan with deadlines for responses), SCHED_FIFO 80 to 77", text)
        self.assertEqual(self.expect(redag("arrange", arm, "--rtprio", "90", "--levels", "left"), 0).stdout, "79,77\n")

    def test_says_which_unit_has_no_place(self):
        arm = self.write("arm.yaml", (SOURCE / "examples" / "robot" / "arm.yaml").read_text().replace("wcet: 5ms", "wcet: 20ms"))
        for command in (["validate"], ["arrange", "--rtprio", "90"]):
            self.expect(redag(command[0], arm, *command[1:]), 0, "warning: no order keeps all deadlines by guan")
        broken = self.write("broken.yaml", arm.read_text().replace("wcet: 20ms, ", ""))
        self.expect(redag("arrange", broken, "--rtprio", "90"), 2, "broken.yaml:")

    # --- a robot as one workload ---

    def test_a_robot_is_the_workload_written_by_hand(self):
        by_hand = self.write("cart.yaml", """\
name: cart
platform: {workers: 2, preemption: os}
dags:
  - name: drive/control
    period: 5ms
    criticality: high
    tasks: [{name: read, wcet: 150us}, {name: act, wcet: 400us, activation: data, after: read}]
  - name: drive/odometry
    tasks:
      - {name: wheels, wcet: 300us, period: 20ms, group: drive/bus}
      - {name: battery, wcet: 200us, period: 1s, group: drive/bus}
  - name: vision/camera
    period: 33ms
    tasks: [{name: grab, wcet: 2ms}, {name: detect, wcet: 12ms, activation: data, after: grab}]
  - name: threads/scan
    tasks: [{name: run, wcet: 500us, period: 10ms}]
""")
        for command in (["analyze", "--check"], ["simulate", "--duration", "2s"], ["sensitivity"]):
            robot, hand = (self.expect(redag(command[0], file, *command[1:], "--json"), 0).stdout
                           for file in (EXAMPLE, by_hand))
            self.assertEqual(body(robot), body(hand), command[0])

    def test_validate_reports_robots(self):
        result = self.expect(redag("validate", "--strict", EXAMPLE), 0)
        self.assertIn("robot of 3 processes on 2 processors, 0 links, 3 entries of threads, 1 entry of irqs: 4 DAGs", result.stdout)
        robot = self.write("robot.yaml", EXAMPLE.read_text().replace("wcet: 500us", "wcet: 500").replace(
            "workload: drive.yaml", f"workload: {EXAMPLE.parent}/drive.yaml"))
        self.assertRegex(self.expect(redag("validate", robot), 2).stderr, r"robot.yaml:\d+:\d+: error: wcet: '500' is not a duration")

    def test_what_analysis_cannot_cover_is_refused(self):
        text = EXAMPLE.read_text().replace("drive.yaml", f"{EXAMPLE.parent}/drive.yaml").replace("    wcet: 500us\n", "")
        robot = self.write("robot.yaml", text)
        result = self.expect(redag("analyze", robot), 2)
        self.assertRegex(result.stderr, r"robot.yaml:24:5: error: threads 'scan' can delay tasks, and nothing says for how")
        self.assertRegex(self.expect(redag("validate", robot), 0).stderr, r"robot.yaml:24:5: warning: threads 'scan' can")
        self.expect(redag("arrange", robot, "--rtprio", "90"), 0)

    def test_links_bound_chains_over_processes(self):
        linked = EXAMPLE.parent / "brake.yaml"
        document = json.loads(self.expect(redag("analyze", linked, "--check", "--json"), 0).stdout)
        bound = {dag["name"]: dag["bound_ns"] for dag in document["dags"]}
        self.assertGreaterEqual(bound["drive/avoid"], bound["vision/camera"] + 500_000 + 1_200_000)
        self.expect(redag("simulate", linked, "--duration", "2s"), 0)
        for command in (["tune"], ["assign"], ["sensitivity"]):
            self.assertIn(f"{command[0]} changes tasks", self.expect(redag(*command, linked), 2).stderr)
        for command in (["analyze", "--overhead-release", "1us"], ["simulate", "--workers", "3"]):
            self.assertIn("hold for the platform in its file", self.expect(redag(*command, linked), 2).stderr)
        late = self.write("late.yaml", linked.read_text().replace("transport: 500us", "transport: 30ms"))
        self.assertRegex(self.expect(redag("analyze", late), 2).stderr,
                         r"late.yaml:\d+:5: error: data of 'vision.camera.detect' can arrive .* more than their period 33ms")

    def test_commands_that_want_a_workload_say_so(self):
        result = self.expect(redag("arrange", SOURCE / "workloads" / "hello.yaml"), 2)
        self.assertIn("this is a workload, and not a robot", result.stderr)

    # --- the plan ---

    def test_the_plan_is_one_order(self):
        plan = json.loads(self.expect(redag("arrange", EXAMPLE, "--rtprio", "90", "--json"), 0).stdout)
        self.assertEqual([(level["priority"], level["first_ns"] // 1_000_000, level["members"]) for level in plan["levels"]], [
            (80, 5, ["drive.control.read", "drive.control.act"]), (79, 10, ["threads scan"]),
            (78, 20, ["drive.odometry.wheels"]), (77, 33, ["vision.camera.grab", "vision.camera.detect"]),
            (76, 1000, ["drive.odometry.battery"])])
        self.assertEqual(plan["executors"], {"drive": [80, 78, 76], "vision": [77]})
        self.assertFalse(plan["merged"])
        levels = self.expect(redag("arrange", EXAMPLE, "--rtprio", "90", "--levels", "drive"), 0).stdout
        self.assertEqual(levels, "80,78,76\n")
        merged = self.expect(redag("arrange", EXAMPLE, "--rtprio", "4"), 0).stdout
        self.assertIn("share a level with others, because there are 2 levels", merged)
        for process, hint in (("lidar_driver", "has no executor of ReDAG-RT"), ("drove", "did you mean 'drive'?")):
            result = self.expect(redag("arrange", EXAMPLE, "--rtprio", "90", "--levels", process), 2)
            self.assertIn(hint, result.stderr)

    # --- real threads ---

    @unittest.skipUnless(may_use_fifo(), "this user may not use SCHED_FIFO")
    def test_apply_and_undo(self):
        self.write_robot()
        _, (rx, slow, log, other) = self.start("rx0", "slow", "log", "other")
        before = [state(tid) for tid in (rx, slow, log, other)]
        self.expect(self.arrange("--check"), 1)
        self.assertEqual([state(tid) for tid in (rx, slow, log, other)], before, "a plan changes nothing")
        self.expect(self.arrange("--apply"), 0)
        self.assertEqual([state(tid) for tid in (rx, slow, log)], [("FIFO", 80), ("FIFO", 79), ("OTHER", 5)])
        self.assertEqual(state(other), before[3])
        self.assertIn("that the robot names are as planned", self.expect(self.arrange("--check"), 0).stdout)
        self.expect(self.arrange("--apply"), 0)
        self.expect(self.arrange("--undo"), 0)
        self.assertEqual([state(tid) for tid in (rx, slow, log, other)], before)
        self.assertFalse(self.state.exists())
        self.assertIn("changes undone: 0", self.expect(self.arrange("--undo"), 0).stderr)

    def watch(self):
        process = subprocess.Popen([PROGRAM, "arrange", self.robot, "--state", self.state, "--watch", "--interval", "20ms"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    @unittest.skipUnless(may_use_fifo(), "this user may not use SCHED_FIFO")
    def test_watch_follows_processes_and_takes_back(self):
        self.write_robot()
        for by in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            with self.subTest(by=by):
                watch = self.watch()
                first, (a,) = self.start("rx0")
                self.until(lambda tid=a: state(tid) == ("FIFO", 80), "the first process is not raised")
                first.kill()
                first.wait()
                _, (b, c) = self.start("rx1", "slow")
                self.until(lambda tid=b: state(tid) == ("FIFO", 80), "the second process is not raised")
                self.until(lambda tid=c: state(tid) == ("FIFO", 79), "its other thread is not raised")
                self.assertIn("another 'redag arrange' works on this robot", self.expect(self.arrange("--undo"), 2).stderr)
                interrupt(watch, by=by)
                _, told = watch.communicate(timeout=PATIENCE)
                self.assertEqual(watch.returncode, 0, told)
                self.assertEqual([state(b), state(c)], [ORDINARY] * 2)
                self.assertFalse(self.state.exists())

    @unittest.skipUnless(may_use_fifo(), "this user may not use SCHED_FIFO")
    def test_undo_after_the_watch_was_killed(self):
        self.write_robot()
        watch = self.watch()
        _, (a, b) = self.start("rx0", "slow")
        self.until(lambda: state(a)[0] == state(b)[0] == "FIFO", "not raised")
        watch.kill()
        watch.wait()
        self.expect(self.arrange("--undo"), 0)
        self.assertEqual([state(a), state(b)], [ORDINARY] * 2)

    # --- executors ---

    @unittest.skipIf(SANITIZED, "with sanitizers, executors have their priorities in name only")
    @unittest.skipUnless(may_use_fifo(), "this user may not use SCHED_FIFO")
    def test_executors_take_their_levels(self):
        workload = self.write("two.yaml", "platform: {preemption: os}\ndags:\n  - name: d\n    tasks:\n"
                              "      - {name: a, wcet: 100us, period: 5ms}\n      - {name: b, wcet: 4ms, period: 20ms}\n")
        process = subprocess.Popen([PROGRAM, "run", workload, "--duration", "60s"], env={**os.environ, "REDAG_LEVELS": "30,20"},
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        seen = set()

        def look():
            for task in pathlib.Path(f"/proc/{process.pid}/task").iterdir():
                try:
                    seen.add(state(int(task.name)))
                except (ProcessLookupError, OSError):
                    pass
            return {("FIFO", 31), ("FIFO", 30), ("FIFO", 20)} <= seen
        self.until(look, seen)  # the thread that releases jobs is just above the most urgent one
        others = {priority for kind, priority in seen if kind == "FIFO"} - {31, 30, 20}
        self.assertTrue(all(priority in (1, 90) for priority in others), seen)
        result = subprocess.run([PROGRAM, "run", workload, "--duration", "50ms"], env={**os.environ, "REDAG_LEVELS": "20,30"},
                                capture_output=True, text=True, check=False)
        self.expect(result, 2)
        self.assertIn("REDAG_LEVELS is '20,30', which is no list of priorities", result.stderr)

    def test_a_shared_order_is_on_or_off(self):
        workload = self.write("one.yaml", "platform: {preemption: none}\ndags:\n  - name: d\n    tasks:\n"
                              "      - {name: a, wcet: 100us, period: 5ms}\n")
        def run(value):
            return subprocess.run([PROGRAM, "run", workload, "--duration", "50ms"],
                                  env={**os.environ, "REDAG_SHARE_ORDER": value},
                                  capture_output=True, text=True, check=False)
        self.expect(run("yes"), 2, "REDAG_SHARE_ORDER is 'yes'")
        self.assertIn("no order is shared with other processes, because the preemption is none", run("1").stderr)
        self.assertNotIn("no order is shared", run("0").stderr)


if __name__ == "__main__":
    main()
