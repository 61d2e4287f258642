#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests what the program makes of the record of a C++ program (ExecutorOptions::record): examples/07_record.

Usage: record.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import signal
import subprocess
import time

from program import PROGRAM, Case, main, redag

EXAMPLE = PROGRAM.parent.parent / "examples" / "example_07_record"


class Record(Case):
    def record(self, folder):
        return subprocess.run([EXAMPLE, folder], capture_output=True, text=True, timeout=100, check=False)

    def test_the_tools_read_a_record(self):
        folder = self.folder / "deep" / "robot"
        self.expect(self.record(folder), 0)
        self.assertEqual([path.name for path in folder.iterdir()], ["events.redag"])
        self.assertIn("deadline", self.expect(redag("why", folder), 0).stdout)
        checked = json.loads(self.expect(redag("events", "--check", "--json", folder), 0).stdout)
        self.assertTrue(checked, "the checker finds nothing wrong, and says so")
        self.expect(redag("report", folder), 0)
        report = (folder / "report.html").read_text(encoding="utf-8")
        self.assertIn("control.pid", report)

    def test_a_killed_program_leaves_a_record(self):
        folder = self.folder / "robot"
        with subprocess.Popen([EXAMPLE, folder], stdout=subprocess.DEVNULL) as process:
            events = folder / "events.redag"
            while process.poll() is None and not (events.exists() and events.stat().st_size > 2000):
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
        self.assertEqual(process.returncode, -signal.SIGKILL)
        self.assertIn("the run was killed, or still goes on", self.expect(redag("events", "--check", folder), 0).stderr)
        self.assertIn("deadline", self.expect(redag("why", folder), 0).stdout)
        events.write_bytes(events.read_bytes()[:-3])
        result = self.expect(redag("why", folder), 0)
        self.assertRegex(result.stderr, r"the record ends here: .*; \d+ bytes are no whole block")

    def test_a_folder_that_cannot_be_written_is_named(self):
        (self.folder / "file").write_text("")
        result = self.record(self.folder / "file")
        self.assertEqual(result.returncode, 2)
        self.assertIn(f"{self.folder / 'file'}: error: cannot create the folder of the record", result.stderr)


if __name__ == "__main__":
    main()
