#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Compares the text of every command that prints tables, at four widths of the terminal, with tests/cli/tables/.

Usage: tables.py PROGRAM SOURCE_DIR [--update]. `--update` writes the files anew: read the difference before it is
committed. All runs are in virtual time, and the same every time. Uses the standard library only.
"""
import pathlib
import sys

update = "--update" in sys.argv
sys.argv = [argument for argument in sys.argv if argument != "--update"]

from program import SOURCE, Case, in_terminal, main, redag  # noqa: E402

WIDTHS = 60, 80, 120, 200
GOLDEN = pathlib.Path(__file__).parent / "tables"
CONTENTION = SOURCE / "workloads" / "contention.yaml"
LONG_NAMES = """\
name: camera rig
platform: {workers: 2, preemption: none}
dags:
  - name: perception_front_camera
    deadline: 30ms
    max_active: 2
    tasks:
      - {name: rectify_image_left_sensor, wcet: 4ms, period: 20ms}
      - {name: rectify_image_right_sensor, wcet: 5ms, period: 20ms}
      - {name: detect_obstacles, wcet: 9ms, activation: data, after: [rectify_image_left_sensor, rectify_image_right_sensor]}
  - name: control
    tasks: [{name: pid, wcet: 1ms, period: 5ms}]
"""
CLUSTERS = """\
name: clusters
platform:
  preemption: none
  clusters: [{name: big, workers: 2}, {name: little, workers: 1}]
dags:
  - {name: vision, cluster: big, tasks: [{name: grab, wcet: 2ms, period: 20ms}, {name: look, wcet: 6ms, activation: data, after: grab}]}
  - {name: control, cluster: little, tasks: [{name: pid, wcet: 1ms, period: 5ms}]}
"""


class Tables(Case):
    def setUp(self):
        super().setUp()
        self.long = self.write("long.yaml", LONG_NAMES)

    def agree(self, name, *arguments, status=(0, 1)):
        """Compares what a command prints at each width; no line is wider, and none ends in a blank."""
        for width in WIDTHS:
            result = redag(*arguments, cwd=self.folder, env=self.environment(width))
            self.assertIn(result.returncode, status, result.stderr)
            text = result.stdout.replace(f"{self.folder}/", "")
            for line in text.splitlines():
                self.assertTrue(len(line) <= width or " " not in line.strip(), f"{name} at {width}: {line}")
                self.assertEqual(line, line.rstrip(), f"{name} at {width}")
            file = GOLDEN / f"{name}.{width}.txt"
            if update:
                GOLDEN.mkdir(exist_ok=True)
                file.write_text(text, encoding="utf-8")
            self.assertEqual(file.read_text(encoding="utf-8"), text, f"{name} at {width} columns; --update accepts it")

    @staticmethod
    def environment(width):
        return {"COLUMNS": str(width), "PATH": "/usr/bin:/bin", "LC_ALL": "C.UTF-8"}

    def test_simulate(self):
        self.agree("simulate", "simulate", self.long, "--duration", "1s")

    def test_compare(self):
        self.agree("compare", "compare", self.long, "--simulate", "--duration", "1s", "--repeat", "2", "--executors", "redag,mte,ste")

    def test_compare_results(self):
        for executor in "redag", "ste":
            self.expect(redag("simulate", self.long, "--duration", "1s", "--executor", executor, "--out", self.folder / executor), 0)
        self.agree("compare_results", "compare", "redag", "ste")

    def test_why(self):
        self.expect(redag("simulate", CONTENTION, "--duration", "2s", "--executor", "ste", "--out", self.folder / "run"), 0)
        self.agree("why", "why", "run")
        self.agree("why_job", "why", "run", "control.pid")

    def test_check_trace(self):
        self.expect(redag("simulate", self.long, "--duration", "1s", "--out", self.folder / "run"), 0)
        self.agree("check_trace", "events", "--check", "run")

    def test_validate(self):
        self.agree("validate", "validate", self.long)

    def test_analyze(self):
        self.agree("analyze", "analyze", self.long, "--all")
        self.agree("analyze_methods", "analyze", "--methods")
        self.agree("explain", "analyze", self.long, "--explain", "control.pid")
        self.agree("chains", "analyze", self.long, "--chain", "perception_front_camera.rectify_image_left_sensor,perception_front_camera.detect_obstacles")

    def test_analyze_clusters(self):
        self.agree("clusters", "analyze", self.write("clusters.yaml", CLUSTERS))

    def test_sensitivity(self):
        self.agree("sensitivity", "analyze", "--sensitivity", self.long)

    def test_assign(self):
        self.agree("tune_by_bounds", "tune", "--judge", "bounds", self.long)

    def test_tune(self):
        self.agree("tune", "tune", self.long, "--duration", "200ms")

    def test_a_terminal_tells_its_width(self):
        """A pseudo-terminal of 60 columns shows what COLUMNS=60 does."""
        status, text = in_terminal("simulate", self.long, "--duration", "1s", columns=60, NO_COLOR="1")
        self.assertEqual(status, 0, text)
        golden = (GOLDEN / "simulate.60.txt").read_text(encoding="utf-8")
        self.assertEqual(text.replace("\r", "")[-len(golden):], golden, "after the progress line")

    def test_columns_that_are_no_number_count_as_unset(self):
        widest = [max(map(len, redag("simulate", self.long, "--duration", "1s", env={**self.environment(0), "COLUMNS": columns}).stdout.splitlines()))
                  for columns in ("wide", "", "-3", "0")]
        self.assertEqual(len(set(widest)), 1)
        self.assertGreater(widest[0], 80)


main()
