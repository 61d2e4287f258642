#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag import` on a recording of real nodes, and on what is none.

Usage: imports.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import re
import shutil
import sys

from program import SOURCE, Case, main, redag

RECORDING = SOURCE / "workloads" / "traces" / "jazzy_mte"
STREAMS = "ust/uid/0/64-bit"


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
