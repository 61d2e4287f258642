# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests robot files from outside, as one workload; and the order that executors share.

Usage: robots.py PROGRAM SOURCE_DIR.
"""
import json
import os
import subprocess

from program import PROGRAM, SOURCE, Case, body, main, redag

EXAMPLE = SOURCE / "examples" / "robot" / "cart.yaml"


class Robots(Case):
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
    tasks: [{name: run, wcet: 500us, period: 20ms}]
""")
        # Not by_demand, which refuses groups of several executors and would bound what is written by hand.
        for command in (["analyze", "--check", "--method", "dag_groups"], ["simulate", "--duration", "2s"]):
            robot, hand = (self.expect(redag(command[0], file, *command[1:], "--json"), 0).stdout
                           for file in (EXAMPLE, by_hand))
            self.assertEqual(body(robot), body(hand), command[0])

    def test_validate_reports_robots(self):
        result = self.expect(redag("validate", "--strict", EXAMPLE), 0)
        self.assertIn("robot of 2 processes on 2 processors, 1 entry of threads: 4 DAGs", result.stdout)
        robot = self.write("robot.yaml", EXAMPLE.read_text().replace("wcet: 500us", "wcet: 500").replace(
            "workload: drive.yaml", f"workload: {EXAMPLE.parent}/drive.yaml"))
        self.assertRegex(self.expect(redag("validate", robot), 2).stderr, r"robot.yaml:\d+:\d+: error: wcet: '500' is not a duration")

    def test_what_analysis_cannot_cover_is_refused(self):
        text = EXAMPLE.read_text().replace("drive.yaml", f"{EXAMPLE.parent}/drive.yaml")
        robot = self.write("robot.yaml", text.replace("platform: {preemption: os}", "platform: {workers: 1}"))
        for command in ("analyze", "validate"):
            self.assertRegex(self.expect(redag(command, robot), 2).stderr,
                             r"robot.yaml:\d+:5: error: process 'vision' has 1 worker for 2 processors")

    def test_a_robot_can_be_validated_before_it_is_measured(self):
        callback = "callback: {node: /vision, timer: any}"
        text = EXAMPLE.read_text().replace("drive.yaml", f"{EXAMPLE.parent}/drive.yaml")
        robot = self.write("robot.yaml", text.replace("grab, wcet: 2ms", f"grab, {callback}"))
        self.assertIn("(1 without wcet)", self.expect(redag("validate", robot), 0).stdout)
        self.expect(redag("analyze", robot), 2)

    # --- one order ---

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
