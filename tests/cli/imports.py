#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag import` on a recording of real nodes, and on what is none.

Usage: imports.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import os
import re
import shutil
import sys

from ctf import Robot, write_trace
from program import SOURCE, Case, main, redag

RECORDING = SOURCE / "workloads" / "traces" / "jazzy_mte"
STREAMS = "ust/uid/0/64-bit"
MS = 1_000_000


def lidar(runs=100, length=4 * MS, **process):
    robot = Robot(**process)
    timer = robot.timer(robot.node("lidar"), 10 * MS)
    for k in range(1, runs + 1):
        robot.run(7, timer, k * 10 * MS, length)
    return robot


class Import(Case):
    def copy(self):
        return shutil.copytree(RECORDING, self.folder / "copy")

    def test_the_robot_that_was_recorded(self):
        robot = self.folder / "robot.yaml"
        said = self.expect(redag("import", RECORDING, "-o", robot), 0).stdout
        self.assertIn("Execution is wall time", said)
        self.assertRegex(said, r"The tasks stand for 99\.99\d* % of the time in callbacks")
        self.assertIn("3 DAGs, 8 tasks, 5 edges", self.expect(redag("validate", robot), 0).stdout)
        text = robot.read_text()
        for line in ("{node: /lidar, timer: {period: 50ms, index: 0}}", "after: /lidar timer 50 ms (0)", "unknown"):
            self.assertIn(line, text)
        self.expect(redag("simulate", robot, "--executor", "mte", "--duration", "2s"), 0)
        self.expect(redag("analyze", robot), 0)
        self.assertEqual(re.sub("(?m)^# .*", "", redag("import", RECORDING).stdout), re.sub("(?m)^# .*", "", text))

    def test_the_model_of_the_executor_that_ran(self):
        result = redag("import", RECORDING, "--check")
        self.assertIn(result.returncode, (0, 1), result.stderr)
        self.assertRegex(result.stdout, r"The model of mte reproduces \d+ of \d+ recorded responses")

    def test_the_verdict(self):
        result = redag("import", RECORDING, "--verdict", env={**os.environ, "COLUMNS": "80"})
        self.assertIn(result.returncode, (0, 1), result.stderr)
        said = result.stdout
        self.assertEqual([line for line in said.splitlines() if len(line) > 80], [])
        for words in (r"callback +by +p50 +p99 +missed +shown +1: p99 +1: miss", r"(?m)^mte on \d+: .* deadlines shown, largest p99",
                      r"(?m)^os on \d+: ", r"What would help most|No single change"):
            self.assertRegex(said, words)
        document = json.loads(redag("import", RECORDING, "--verdict", "--json", "--workers", 3).stdout)
        self.assertEqual(document["format"], "redag.verdict/1")
        self.assertEqual([each["executor"] for each in document["outcomes"]], ["mte", "redag-none", "redag-os"] * 2)
        self.assertEqual(document["outcomes"][3]["workers"], 3)
        self.assertEqual(len(document["refused"]) + document["judged"], 8)
        self.expect(redag("import", RECORDING, "--json"), 2, "--verdict")

    def test_a_robot_that_is_in_time(self):
        write_trace(self.folder / "fine", lidar().events)
        said = self.expect(redag("import", self.folder / "fine", "--verdict"), 0).stdout
        self.assertIn("ste on 1: none missed, 1 of 1 deadlines shown, largest p99 40.0 % of its deadline", said)

    def test_processor_time(self):
        """With the kernel's events, the time without a processor is no execution."""
        write_trace(self.folder / "trace" / "ust", lidar().events)
        switches = [(10 * k * MS + at * MS, "sched_switch", 0, 0, {"prev_tid": leaves, "next_tid": comes})
                    for k in range(1, 101) for at, leaves, comes in ((1, 7, 99), (2, 99, 7))]
        write_trace(self.folder / "trace" / "kernel", switches, is_kernel=True)
        text = self.expect(redag("import", self.folder / "trace"), 0).stdout
        self.assertIn("Execution is processor time", text)
        self.assertIn("wcet: 3ms", text)
        write_trace(self.folder / "wall", lidar().events)
        text = self.expect(redag("import", self.folder / "wall"), 0).stdout
        self.assertIn("Execution is wall time", text)
        self.assertIn("wcet: 4ms", text)

    def test_a_recording_of_caret(self):
        """CARET records nodes that run already under its own name, with the time when they were made, and their groups."""
        robot = lidar()
        later = 504 * MS
        events = []
        for time, name, process, thread, fields in robot.events:
            if "callback_start" not in name and "callback_end" not in name:
                name, fields, time = name.replace("ros2:", "ros2_caret:"), fields | {"init_timestamp": max(time, 1)}, later
            if time >= later:
                events.append((time, name, process, thread, fields))
        write_trace(self.folder / "caret", events)
        said = self.expect(redag("import", self.folder / "caret", "--check"), 0).stdout
        self.assertRegex(said, r"/lidar timer 10 ms \(0\) +4ms +4ms")

    def test_lost_events(self):
        write_trace(self.folder / "lossy", lidar().events, packets=((50, 0), (None, 12)))
        result = self.expect(redag("import", self.folder / "lossy"), 0, "12 events that the tracer lost")
        self.assertIn("# unknown: 12 events that the tracer lost", result.stdout)

    def test_sessions_of_other_clocks(self):
        write_trace(self.folder / "two" / "one", lidar().events)
        write_trace(self.folder / "two" / "other", lidar(process=2).events, clock="other")
        self.expect(redag("import", self.folder / "two"), 2, "cannot read the recording")

    def test_many_callbacks(self):
        robot = Robot()
        node = robot.node("many")
        timers = [robot.timer(node, 10 * MS) for _ in range(20000)]
        for k in range(1, 13):
            for at, timer in enumerate(timers[:500]):
                robot.run(7, timer, k * 10 * MS + at * 1000, 900)
        write_trace(self.folder / "many", robot.events)
        self.assertIn("19 500 callbacks that never ran", self.expect(redag("import", self.folder / "many"), 0).stdout)

    def test_a_robot_file_of_several_processes(self):
        folder, robot = self.folder / "both", self.folder / "robot.yaml"
        write_trace(folder, lidar().events + lidar(process=2, first=5000).events)
        self.expect(redag("import", folder), 2, "several processes ran callbacks", "'all' for a robot file")
        self.expect(redag("import", folder, "all", "--check"), 2, "for one executor")
        self.assertIn("2 DAGs, 2 tasks", self.expect(redag("import", folder, "all", "-o", robot), 0).stdout)
        text = robot.read_text()
        for line in ("robot: recorded", "cpus: 0-0", "  - name: robot\n", "  - name: robot_2\n", "preemption: os"):
            self.assertIn(line, text)
        self.assertIn("robot_2/lidar", self.expect(redag("analyze", "--all", robot), 0).stdout)
        self.expect(redag("simulate", robot, "--duration", "1s"), 0)

    def test_other_processes(self):
        self.expect(redag("import", RECORDING, "nobody"), 2, "'nobody' ran no callback", "(robot, ")
        self.expect(redag("import", RECORDING, "robot"), 0)

    def test_what_is_no_recording(self):
        self.expect(redag("import", "/no/such/folder"), 2, "is no folder")
        self.expect(redag("import", self.write("file", "text")), 2, "is no folder")
        self.expect(redag("import", self.folder), 2, "no file 'metadata'")
        self.expect(redag("import", RECORDING, "-o", "/no/such/folder/x.yaml"), 2, "/no/such/folder/x.yaml")

    def test_damage(self):
        for name in ("metadata", "channel0_0"):
            for size in (0, 100, 5000):
                broken = self.copy()
                file = broken / STREAMS / name
                file.write_bytes(file.read_bytes()[:size])
                if (name, size) != ("channel0_0", 0):
                    self.expect(redag("import", broken), 2, "cannot read the recording", "copied whole")
                shutil.rmtree(broken)
        broken = self.copy()
        index = broken / STREAMS / "index" / "channel0_0.idx"
        content = bytearray(index.read_bytes())
        content[16:24] = b"\x7f" * 8  # the place of the first packet
        index.write_bytes(content)
        self.expect(redag("import", broken), 2, "its index is that of other files")

    def test_no_events_of_ros(self):
        other = self.copy()
        metadata = other / STREAMS / "metadata"
        metadata.write_bytes(metadata.read_bytes().replace(b'"ros2:', b'"rosx:'))
        self.expect(redag("import", other), 2, "no run of a callback", "ros2 trace")

    def test_events_without_their_thread(self):
        other = self.copy()
        metadata = other / STREAMS / "metadata"
        metadata.write_bytes(metadata.read_bytes().replace(b" _vtid;", b" _xtid;"))
        self.expect(redag("import", other), 2, "contexts vpid and vtid")


if __name__ == "__main__":
    if "built without" in redag("import", SOURCE).stderr:
        print("this build has no libbabeltrace2")
        sys.exit(77)
    main()
