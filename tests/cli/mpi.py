#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag experiment --mpi` with Open MPI's launcher: the number of ranks, and their deaths, change no result.

Usage: mpi.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import json
import os
import pathlib
import signal
import subprocess

from program import PROGRAM, Case, main, redag, units, wait_for_units

# mpirun lets ranks be for that many seconds before it asks them to end, and again before it kills them. In the usual one
# second a busy machine writes no results.
ENVIRONMENT = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                            "OMPI_MCA_odls_base_sigkill_timeout": "3"}
PLAN = ["--dags", "6", "--workers", "2", "--utilization", "0.2:0.8:0.2", "--methods", "any,simulation,melani"]
LONG = [*PLAN, "--sets", "60", "--simulation-periods", "80"]


def mpirun(*arguments):
    return ["mpirun", "--oversubscribe", *map(str, arguments)]


def rank_of(process, rank):
    """Returns the process id of a rank of a launcher."""
    for child in pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
        if f"OMPI_COMM_WORLD_RANK={rank}\0" in pathlib.Path(f"/proc/{child}/environ").read_text():
            return int(child)
    raise AssertionError(f"no rank {rank} below {process.pid}")


class Mpi(Case):
    known = {}

    def run_ranks(self, ranks, name, *plan, status=0):
        command = mpirun("-n", ranks, PROGRAM, "experiment", "acceptance", *plan, "--mpi", "--out", self.folder / name)
        result = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=250, check=False)
        return self.expect(result, status)

    def start(self, name, ranks=3, *options):
        """Starts a run of some seconds. Returns it once it has written units."""
        process = subprocess.Popen(mpirun(*options, "-n", ranks, PROGRAM, "experiment", "acceptance", *LONG, "--mpi",
                                          "--out", self.folder / name),
                                   env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        wait_for_units(self, process, self.folder / name, 1)
        return process

    def results(self, name):
        folder = self.folder / name
        return [(folder / file).read_text() for file in ("acceptance.csv", "acceptance.svg")], units(folder)

    def whole(self, *plan):
        """Returns the results of one process, which runs once for all tests."""
        if plan not in self.known:
            self.expect(redag("experiment", "acceptance", *plan, "--out", self.folder / "whole"), 0)
            self.known[plan] = self.results("whole")
        return self.known[plan]

    def test_same_results_for_any_number_of_ranks(self):
        plan = [*PLAN, "--sets", "20"]
        expected = self.whole(*plan)
        for ranks in (1, 2, 4):
            result = self.run_ranks(ranks, f"ranks{ranks}", *plan)
            self.assertEqual(self.results(f"ranks{ranks}"), expected)
            self.assertIn(f"on {ranks} processor", result.stderr)
        self.run_ranks(2, "threads", *plan, "-j2")
        self.assertEqual(self.results("threads"), expected)
        begin = json.loads((self.folder / "threads" / "runs.jsonl").read_text().splitlines()[0])
        self.assertEqual((begin["ranks"], begin["jobs"]), (2, 2))

    def test_a_killed_rank_loses_only_what_it_had_not_finished(self):
        process = self.start("killed", 3, "--enable-recovery")
        os.kill(rank_of(process, 2), signal.SIGKILL)
        _, error = process.communicate(timeout=250)
        self.assertEqual(process.returncode, 0, error)
        self.assertRegex(error, r"1 of 3 ranks no longer answer: what they had not finished was done again \(\d+ workloads\)")
        self.assertEqual(self.results("killed"), self.whole(*LONG))
        ends = [json.loads(line) for line in (self.folder / "killed" / "runs.jsonl").read_text().splitlines()]
        self.assertEqual([(run["event"], run["units"]) for run in ends], [("begin", 480), ("end", 480)])

    def test_all_ranks_but_the_first_can_die(self):
        process = self.start("alone", 3, "--enable-recovery")
        for child in [rank_of(process, rank) for rank in (1, 2)]:
            os.kill(child, signal.SIGKILL)
        _, error = process.communicate(timeout=250)
        self.assertEqual(process.returncode, 0, error)
        self.assertIn("2 of 3 ranks no longer answer", error)
        self.assertEqual(self.results("alone"), self.whole(*LONG))

    def test_a_rank_can_be_stopped(self):
        process = self.start("one_less")
        os.kill(rank_of(process, 1), signal.SIGTERM)
        _, error = process.communicate(timeout=250)
        self.assertEqual(process.returncode, 0, error)
        self.assertEqual(self.results("one_less"), self.whole(*LONG))

    def test_the_same_command_goes_on_after_the_end_of_all(self):
        """Without --enable-recovery, mpirun ends all ranks when one is killed. So does the death of rank 0."""
        process = self.start("ended")
        os.kill(rank_of(process, 0), signal.SIGKILL)
        _, error = process.communicate(timeout=250)
        self.assertNotEqual(process.returncode, 0, error)
        self.assertGreater(len(units(self.folder / "ended")), 0)
        self.assertRegex(self.run_ranks(2, "ended", *LONG).stderr, r"\d+ of 480 workloads are done already")
        self.assertEqual(self.results("ended"), self.whole(*LONG))

    def test_ctrl_c_keeps_what_is_done(self):
        process = self.start("stopped")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=250)
        document = json.loads((self.folder / "stopped" / "acceptance.json").read_text())
        self.assertFalse(document["complete"])
        self.assertEqual(document["done"], len(units(self.folder / "stopped")))
        self.assertGreater(document["done"], 0)
        self.assertTrue(document["runs"][-1]["interrupted"])

    def test_ranks_must_agree(self):
        program = [PROGRAM, "experiment", "acceptance", *PLAN, "--mpi", "--out", self.folder / "mixed", "--sets"]
        result = subprocess.run(mpirun("-n", 1, *program, 20, ":", "-n", 1, *program, 21), env=ENVIRONMENT,
                                capture_output=True, text=True, timeout=250, check=False)
        self.expect(result, 2, "rank 1 runs another version of redag or another plan", "install the same redag")

    def test_bad_input(self):
        self.assertIn("'gaun'", self.run_ranks(2, "bad", "--methods", "gaun", status=2).stderr)
        self.run_ranks(2, "done", *PLAN, "--sets", "1")
        self.assertIn("another plan", self.run_ranks(2, "done", *PLAN, "--sets", "2", status=2).stderr)
        plan = self.write("threads.yaml", "experiment: factorial\nworld: threads\nexecutors: [redag]\n"
                          f"workloads: [{self.cart}]\n")
        self.expect(redag("experiment", "factorial", plan, "--mpi"), 2, "--mpi: runs on threads")


if __name__ == "__main__":
    main()
