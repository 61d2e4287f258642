#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Runs the example workflow (examples/fleet/Snakefile) on two robots, and again after one of them has changed.

Usage: fleet_test.py PROGRAM SOURCE_DIR. Ends with 77 and says so without Snakemake. Uses the standard library only.
"""
import csv
import pathlib
import shutil
import subprocess
import sys
import tempfile

PROGRAM, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])


def workflow(folder):
    result = subprocess.run(["snakemake", "--snakefile", SOURCE / "examples" / "fleet" / "Snakefile", "--cores", "1",
                             "--config", f"robots={folder}/robots", f"out={folder}/out", f"redag={PROGRAM}", "seeds=2",
                             "duration=1s"], cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert result.returncode == 0, result.stderr + result.stdout
    with open(folder / "out" / "fleet.csv", newline="", encoding="utf-8") as table:
        return list(csv.DictReader(table))


def test():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "robots").mkdir()
        for robot in ("hello", "contention"):
            shutil.copy(SOURCE / "workloads" / f"{robot}.yaml", folder / "robots")
        rows = workflow(folder)
        assert [row["robot"] for row in rows] == ["contention", "hello"], rows
        assert all(int(row["released"]) > 100 and row["schedulable"] in ("True", "False") for row in rows), rows
        pages = {robot: folder / "out" / robot / "report.html" for robot in ("hello", "contention")}
        written = {robot: page.stat().st_mtime_ns for robot, page in pages.items()}
        changed = folder / "robots" / "hello.yaml"
        changed.write_text(changed.read_text() + "# changed\n")
        workflow(folder)
        assert pages["hello"].stat().st_mtime_ns > written["hello"], "what changed is done again"
        assert pages["contention"].stat().st_mtime_ns == written["contention"], "and nothing else"


if __name__ == "__main__":
    if shutil.which("snakemake") is None:
        print("*** NOT TESTED: examples/fleet: no snakemake (tools/bootstrap cluster) ***")
        sys.exit(77)
    test()
