#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests the provider `redag` for LTTng: records a run in a session of LTTng, and reads it with babeltrace2.

Usage: lttng_test.py PROGRAM PROVIDER. Ends with 77 and says so where LTTng is not installed or cannot run. Uses the
standard library only.
"""
import collections
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM, PROVIDER = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
# plan takes the worker from sense and act, and misses its own deadline.
WORKLOAD = """\
name: cart
platform: {workers: 1, preemption: none}
dags:
  - name: fast
    tasks: [{name: sense, wcet: 1ms, period: 10ms}, {name: act, wcet: 1ms, activation: data, after: sense}]
  - name: slow
    tasks: [{name: plan, wcet: 25ms, period: 100ms, deadline: 20ms}]
"""
EVENT = re.compile(r"^\[(?P<stamp>[\d.]+)\].* redag:(?P<name>\w+): (?P<rest>.*)$")


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(77)


class Lttng(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        # Where the test is not root's, it has a daemon of its own.
        self.environment = {**os.environ, "LTTNG_HOME": str(self.folder), "LTTNG_UST_REGISTER_TIMEOUT": "-1"}
        log = open(self.folder / "sessiond.log", "w")
        self.addCleanup(log.close)
        self.daemon = subprocess.Popen(["lttng-sessiond", "--no-kernel"], stdout=log, stderr=log, env=self.environment)
        self.addCleanup(self.daemon.wait)
        self.addCleanup(self.daemon.terminate)
        deadline = time.monotonic() + 60
        while self.lttng("list", check=False).returncode != 0:
            if time.monotonic() > deadline:
                self.skipTest("no session daemon of LTTng answers")
            time.sleep(0.1)
        self.session = f"redag-test-{os.getpid()}"
        self.lttng("create", self.session, "--output", self.folder / "trace")
        self.addCleanup(self.lttng, "destroy", self.session, check=False)

    def lttng(self, *arguments, check=True):
        return subprocess.run(["lttng", *map(str, arguments)], capture_output=True, text=True, check=check,
                              env=self.environment, timeout=100)

    def run_workload(self, **more):
        workload = self.folder / "cart.yaml"
        workload.write_text(WORKLOAD)
        out = self.folder / "out"
        subprocess.run([PROGRAM, "run", workload, "--duration", "1s", "--no-live", "--json", "--out", out],
                       check=True, capture_output=True, env={**self.environment, **more}, timeout=100)
        text = subprocess.run([PROGRAM, "events", out], check=True, capture_output=True, text=True, timeout=100).stdout
        return [json.loads(line) for line in text.splitlines()[1:-1]]

    def recorded(self):
        self.lttng("stop", self.session)
        if not list((self.folder / "trace").rglob("metadata")):
            return []  # no program registered the provider
        text = subprocess.run(["babeltrace2", "--clock-seconds", self.folder / "trace"], capture_output=True, text=True,
                              check=True).stdout
        events = []
        for line in text.splitlines():
            found = EVENT.match(line)
            self.assertTrue(found, line)
            fields = dict(re.findall(r'(\w+) = ("[^"]*"|[\w-]+)', found["rest"].rsplit("{", 1)[1]))
            events.append((found["name"], {key: value.strip('"') for key, value in fields.items()}))
        return events

    def test_a_session_has_the_events_of_the_run(self):
        self.lttng("enable-event", "--userspace", "redag:*")
        self.lttng("start", self.session)
        written = self.run_workload(LD_PRELOAD=str(PROVIDER))
        events = self.recorded()
        tasks = {fields["name"]: fields for name, fields in events if name == "task"}
        self.assertEqual(list(tasks), ["sense", "act", "plan"])
        self.assertEqual((tasks["plan"]["deadline_ns"], tasks["plan"]["dag"]), ("20000000", "1"))
        self.assertEqual(len({fields["executor"] for _, fields in events}), 1)
        # Each event that was recorded is there with its figures. Only the end of the job that ran when the run ended may
        # be missing in the file.
        expected = collections.Counter((kind, task, job, worker, reason) for _, kind, task, job, worker, _, reason in written)
        found = collections.Counter((name, int(f["task"]), int(f["job"]), int(f["worker"]), f["reason"])
                                    for name, f in events if name not in ("task", "deadline_missed"))
        self.assertEqual(expected - found, collections.Counter())
        self.assertLessEqual({name for name, *_ in found - expected}, {"executed", "finished"})
        self.assertLessEqual(sum((found - expected).values()), 2)
        late = [f for name, f in events if name == "deadline_missed"]
        # A job of plan takes longer than its deadline, whatever the machine does.
        finished = [f["job"] for name, f in events if name == "finished" and f["task"] == "2"]
        self.assertEqual([f["job"] for f in late if f["task"] == "2"], finished)
        self.assertGreater(len(finished), 0)
        for fields in late:
            self.assertGreater(int(fields["lateness_ns"]), 0)

    def test_only_what_is_enabled_is_recorded(self):
        self.lttng("enable-event", "--userspace", "redag:finished")
        self.lttng("start", self.session)
        self.run_workload(LD_PRELOAD=str(PROVIDER))
        self.assertEqual({name for name, _ in self.recorded()}, {"finished"})

    def test_without_the_provider_there_is_nothing(self):
        self.lttng("enable-event", "--userspace", "redag:*")
        self.lttng("start", self.session)
        self.run_workload()
        self.assertEqual(self.recorded(), [])

    def test_a_program_without_an_executor_runs_as_before(self):
        result = subprocess.run(["true"], env={**self.environment, "LD_PRELOAD": str(PROVIDER)}, capture_output=True,
                                text=True, check=True)
        self.assertEqual(result.stderr, "")


if __name__ == "__main__":
    missing = [name for name in ("lttng", "lttng-sessiond", "babeltrace2") if not shutil.which(name)]
    if missing:
        skip(f"no {', '.join(missing)} (tools/bootstrap observe)")
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
