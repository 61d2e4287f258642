#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag experiment` on a real Slurm: munged, slurmctld and slurmd of this machine alone, on the loopback device.

Usage: slurm.py PROGRAM SOURCE_DIR. Ends with 77 and says so where Slurm cannot run. Uses the standard library only.
"""
import contextlib
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

from program import PROGRAM, Case, main, redag, units

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel")
CONFIGURATION = """\
ClusterName=loopback
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.sock
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/jobs.txt
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""
PLAN = """\
experiment: acceptance
name: cluster
dags: 6
workers: 2
sets: {sets}
utilization: [0.2, 0.4, 0.6, 0.8]
methods: [any, simulation, melani]
simulation: {{periods: {periods}}}
"""
WAIT = 240  # seconds, for jobs that take some


def program(name):
    return shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")


def obstacle():
    """Returns why Slurm cannot run here; nothing if it can."""
    missing = [name for name in PROGRAMS if program(name) is None]
    if missing:
        return f"no {', '.join(missing)}: install slurmctld, slurmd, slurm-client and munge (tools/bootstrap cluster)"
    return "" if os.geteuid() == 0 else "slurmd starts jobs of users, and needs root"


def free_port():
    with contextlib.closing(socket.socket()) as some:
        some.bind(("127.0.0.1", 0))
        return some.getsockname()[1]


class Cluster:
    """Daemons with all their files in one folder."""

    def __init__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="redag-slurm-"))
        self.folder.chmod(0o755)  # munge wants its socket reachable
        host = socket.gethostname().split(".")[0]
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        (self.folder / "munge.key").write_bytes(os.urandom(128))
        (self.folder / "munge.key").chmod(0o400)
        (self.folder / "slurm.conf").write_text(
            CONFIGURATION.format(folder=self.folder, host=host, ports=[free_port(), free_port()]))
        os.environ["SLURM_CONF"] = str(self.folder / "slurm.conf")
        self.call("munged", "--force", *(f"--{option}={self.folder}/munge.{end}" for option, end in (
            ("key-file", "key"), ("socket", "sock"), ("pid-file", "pid"), ("log-file", "log"), ("seed-file", "seed"))))
        self.call("slurmctld", "-c")
        self.call("slurmd", "-N", host)
        self.wait(lambda: "idle" in self.call("sinfo", "-h", "-o", "%T"), "the node to be idle")

    def call(self, name, *arguments):
        result = subprocess.run([program(name), *map(str, arguments)], capture_output=True, text=True, timeout=WAIT,
                                check=False)
        if result.returncode != 0:
            raise RuntimeError(f"{name}: {result.stderr}{result.stdout}")
        return result.stdout

    def wait(self, condition, what):
        deadline = time.monotonic() + WAIT
        while not condition():
            if time.monotonic() > deadline:
                log = (self.folder / "slurmctld.log").read_text()[-3000:]
                raise RuntimeError(f"waited {WAIT} s for {what}\n{log}")
            time.sleep(0.1)

    def wait_for_jobs(self):
        self.wait(lambda: self.call("squeue", "-h", "-t", "all", "-o", "%T").split().count("COMPLETING") == 0
                  and not self.call("squeue", "-h").strip(), "all jobs to end")

    def jobs(self, name):
        """Returns the states of the tasks of the jobs with this name, as Slurm accounts for them."""
        lines = [dict(word.split("=", 1) for word in line.split() if "=" in word)
                 for line in (self.folder / "jobs.txt").read_text().splitlines()]
        return sorted((line["JobState"], line.get("ArrayTaskId", "")) for line in lines if line["Name"] == name)

    def stop(self):
        for name in ("slurmd", "slurmctld", "munge"):
            with contextlib.suppress(OSError, ValueError):
                process = int((self.folder / f"{name}.pid").read_text())
                os.kill(process, signal.SIGTERM)
                self.wait(lambda number=process: not pathlib.Path(f"/proc/{number}").exists(), f"{name} to end")
        shutil.rmtree(self.folder, ignore_errors=True)


class Slurm(Case):
    @classmethod
    def setUpClass(cls):
        cls.cluster = Cluster()
        cls.addClassCleanup(cls.cluster.stop)

    def plan(self, sets=20, periods=5):
        return self.write("plan.yaml", PLAN.format(sets=sets, periods=periods))

    def results(self, folder):
        return [(folder / file).read_text() for file in ("acceptance.csv", "acceptance.svg")], units(folder)

    def whole(self, plan):
        self.expect(redag("experiment", "acceptance", plan, "--out", self.folder / "whole"), 0)
        return self.results(self.folder / "whole")

    def submit(self, plan, name, *options):
        return self.expect(redag("experiment", "submit", plan, "--slurm", "--now", "--out", self.folder / name, *options), 0)

    def test_an_array_and_its_merge(self):
        plan = self.plan()
        self.assertRegex(self.submit(plan, "array", "--shards", "3").stdout, r"array job \d+, merge job \d+")
        self.cluster.wait_for_jobs()
        merged = self.folder / "array" / "merged"
        self.assertEqual(self.results(merged), self.whole(plan))
        self.assertEqual(self.cluster.jobs("redag-array"), [("COMPLETED", "1"), ("COMPLETED", "2"), ("COMPLETED", "3")])
        self.assertEqual([state for state, _ in self.cluster.jobs("redag-array-merge")], ["COMPLETED"])
        runs = json.loads((merged / "acceptance.json").read_text())["runs"]
        begins = [run for run in runs if run["event"] == "begin"]
        self.assertEqual([run["shard"] for run in begins], ["1/3", "2/3", "3/3"])
        self.assertEqual([run["slurm_job"].split("_")[1] for run in begins], ["1", "2", "3"])

    def test_a_killed_task_goes_on_when_submitted_again(self):
        plan = self.plan(sets=60, periods=80)
        self.submit(plan, "killed", "--shards", "2")
        shard = self.folder / "killed" / "shards" / "2"
        self.cluster.wait(lambda: (shard / "units.db-wal").exists() and (shard / "runs.jsonl").exists(), "shard 2 to begin")
        job = json.loads((shard / "runs.jsonl").read_text().splitlines()[0])["slurm_job"]
        self.cluster.call("scancel", "--signal=KILL", "--full", job)
        self.cluster.wait_for_jobs()
        self.assertIn(("COMPLETED", "1"), self.cluster.jobs("redag-killed"))
        self.assertNotIn(("COMPLETED", "2"), self.cluster.jobs("redag-killed"))
        self.assertIn("workloads are missing from the folders", (self.folder / "killed" / "logs" / "merge.log").read_text())
        self.assertIn("go on where they ended", self.submit(plan, "killed").stdout)
        self.cluster.wait_for_jobs()
        self.assertEqual(self.results(self.folder / "killed" / "merged"), self.whole(plan))

    def test_tasks_find_their_share(self):
        """Two tasks of an array, with two tasks of srun in each."""
        plan = self.plan()
        command = f"srun {PROGRAM} experiment acceptance {plan} --shard auto -j1 --out {self.folder}/auto/{{shard}}"
        self.cluster.call("sbatch", "--array=5-7:2", "--ntasks=2", f"--output={self.folder}/%a.log", "--wrap", command)
        self.cluster.wait_for_jobs()
        folders = [self.folder / "auto" / str(shard) for shard in (1, 2, 3, 4)]
        self.expect(redag("experiment", "merge", *folders, "-o", self.folder / "merged"), 0)
        self.assertEqual(self.results(self.folder / "merged"), self.whole(plan))
        self.assertEqual([len(units(folder)) for folder in folders], [40, 40, 40, 40])


if __name__ == "__main__":
    if why := obstacle():
        print(f"*** NOT TESTED: experiments on Slurm: {why} ***")
        sys.exit(77)
    main()
