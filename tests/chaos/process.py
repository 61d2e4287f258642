#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Injects faults from outside, at random moments.

The faults are signals, limits, full and read-only folders, lost rights, and fewer processors.

Usage: process.py PROGRAM SOURCE_DIR [--runs N] [--seed S] [--fault NAME]... [--clock LIBRARY]

Each fault is tried N times, each time from a seed. If something breaks, the seed is printed, and
`--runs 1 --seed S --fault NAME` repeats the try. The program must end in time, by itself or by the signal, and never by
a crash. It must say why it failed. Its files must be complete, and its traces lawful. Uses the standard library only.
"""
import argparse
import ctypes
import functools
import json
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

NOBODY = 65534
GOOD = {0, 1, 2}
TIMEOUT = 600
PROGRAM = pathlib.Path()
SOURCE = pathlib.Path()
CLOCK = None


class Broken(Exception):
    pass


class Skipped(Exception):
    pass


def expect(condition, what):
    if not condition:
        raise Broken(what)


class Child:
    """Runs the program with faults around it."""

    def __init__(self, *arguments, prepare=None, **options):
        self.arguments = [str(a) for a in arguments]
        options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL} | options
        self.process = subprocess.Popen([PROGRAM, *self.arguments], preexec_fn=prepare, **options)

    def send(self, number):
        if self.process.poll() is None:
            self.process.send_signal(number)

    def end(self, allowed=frozenset(GOOD)):
        try:
            out, err = self.process.communicate(timeout=TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()
            raise Broken(f"does not end: {' '.join(self.arguments)}") from None
        self.out, self.err = (text.decode(errors="replace") if text else "" for text in (out, err))
        self.status = self.process.returncode
        expect(self.status in allowed, f"ended with {self.status}: {' '.join(self.arguments)}\n{self.err}{self.out[-1500:]}")
        if self.status == 2 and self.process.stderr:
            expect("error" in self.err, f"failed without a word: {' '.join(self.arguments)}\n{self.err}{self.out[-1500:]}")
        return self


def check_results(folder, tidy=True):
    """Checks that every file is complete, every trace lawful, and no temporary file is left."""
    for path in pathlib.Path(folder).rglob("*"):
        if not path.is_file():
            continue
        if ".tmp." in path.name:
            expect(not tidy, f"{path.name} was left behind")
        elif path.name == "events.redag":
            Child("events", "--check", path).end({0})
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix in (".csv", ".html", ".svg"):
            expect(path.read_bytes()[-1:] in (b"\n", b""), f"{path.name} ends in the middle of a line")


def workload(rng, folder, tasks=4, busy=True):
    """Writes a random workload with a few short periods: one second of it holds many jobs."""
    path = folder / "random.yaml"
    Child("generate", "--dags", tasks, "--utilization", 0.9 if busy else 0.3, "--workers", 2, "--seed",
          rng.randrange(2**32), "-o", path).end({0})
    return path


def acceptance_plan(folder, sets, seed=1):
    """Writes the plan of an experiment."""
    path = folder / "plan.yaml"
    path.write_text(f"experiment: acceptance\nutilization: [0.3, 0.6]\nsets: {sets}\nseed: {seed}\n")
    return path


def some_command(rng, folder):
    """Returns a command that takes a while."""
    file = workload(rng, folder)
    out = ["--out", folder / "out"]
    return rng.choice([
        ["run", file, "--duration", "20s", *out],
        ["run", file, "--duration", "20s", "--preemption", rng.choice(["none", "cooperative"]), *out],
        ["simulate", file, "--duration", "20000s", *out],
        ["compare", file, "--duration", "1s", "--executors", "redag-none,mte", "--repeat", "20", *out],
        ["experiment", SOURCE / "evaluation" / "experiments" / "acceptance_dags.yaml", *out],
        ["analyze", SOURCE / "workloads" / "robot.yaml", "--sensitivity"],
    ])


def interrupted(rng, folder):
    """Sends Ctrl-C at a random moment, and perhaps once more."""
    child = Child(*some_command(rng, folder))
    time.sleep(rng.uniform(0, 0.6))
    number = rng.choice([signal.SIGINT, signal.SIGTERM])
    child.send(number)
    twice = rng.random() < 0.5
    if twice:
        time.sleep(rng.uniform(0, 0.5))
        child.send(number)
    child.end(GOOD | {-number, 128 + number})
    check_results(folder, tidy=child.status in GOOD)


def stopped(rng, folder):
    """Sends SIGSTOP and SIGCONT: time jumps for all threads."""
    file = workload(rng, folder, busy=False)
    child = Child("run", file, "--duration", "1s", "--preemption", rng.choice(["none", "cooperative", "auto"]), "--out",
                  folder / "out")
    for _ in range(rng.randint(1, 4)):
        time.sleep(rng.uniform(0, 0.4))
        child.send(signal.SIGSTOP)
        time.sleep(rng.uniform(0, 0.3))
        child.send(signal.SIGCONT)
    child.end({0})
    check_results(folder)


def fewer_processors(rng, folder):
    """The affinity of every thread shrinks to one processor and grows again, while jobs run."""
    usable = sorted(os.sched_getaffinity(0))
    file = workload(rng, folder, busy=False)
    child = Child("run", file, "--duration", "1s", "--preemption", rng.choice(["none", "cooperative", "auto"]), "--out",
                  folder / "out")
    for cpus in ([rng.choice(usable)], usable, [rng.choice(usable)]):
        time.sleep(rng.uniform(0, 0.3))
        try:
            for thread in os.listdir(f"/proc/{child.process.pid}/task"):
                os.sched_setaffinity(int(thread), cpus)
        except OSError:  # the thread has ended
            pass
    child.end({0})
    check_results(folder)


def throttled(rng, folder):
    """More SCHED_FIFO work than one processor can do: the kernel pauses all real-time threads for a while."""
    file = folder / "random.yaml"
    Child("generate", "--dags", 4, "--utilization", 2, "--workers", 2, "--seed", rng.randrange(2**32), "-o", file).end({0})
    one = {rng.choice(sorted(os.sched_getaffinity(0)))}

    def run(duration, *arguments):
        return Child("run", file, "--preemption", "os", "--duration", duration, *arguments,
                     prepare=lambda: os.sched_setaffinity(0, one)).end({0, 2})

    if run("10ms").status == 2:
        raise Skipped("no real-time rights")
    limit = pathlib.Path("/proc/sys/kernel/sched_rt_runtime_us")
    if not limit.exists() or int(limit.read_text()) < 0:
        raise Skipped("this kernel does not throttle; a processor would be taken from everybody")
    child = run("2500ms", "--out", folder / "out")
    expect(child.status == 0, child.err)
    check_results(folder)


def clock_jumps(rng, folder):
    """The time of day jumps back and forth by days and years. No thread may wait for a time of day."""
    if CLOCK is None:
        raise Skipped("--clock is not given")
    jumping = {"env": os.environ | {"LD_PRELOAD": str(CLOCK)}}
    shown = subprocess.run(["date", "+%s"], capture_output=True, check=True, **jumping).stdout
    expect(abs(int(shown) - time.time()) > 80_000, "the clock does not jump")
    refused = subprocess.run(["timeout", "60", "true"], capture_output=True, check=False, **jumping)
    expect(refused.returncode == -signal.SIGABRT, "one may wait for a time of day")
    file = workload(rng, folder, busy=False)
    Child("run", file, "--duration", "500ms", "--preemption", rng.choice(["none", "cooperative", "auto"]), "--watchdog",
          "100ms", "--out", folder / "run", **jumping).end({0})
    Child(*writing_command(rng, folder, folder / "out"), **jumping).end({0})
    check_results(folder)


def drop_realtime():
    """Drops CAP_SYS_NICE for this and later programs, which itself needs a capability."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    libc = ctypes.CDLL(None)
    libc.prctl(24, 23, 0, 0, 0)  # PR_CAPBSET_DROP, CAP_SYS_NICE


def without_realtime(rng, folder):
    """`auto` works without real-time rights; `os` is an error that says what to do."""
    file = workload(rng, folder, busy=False)
    child = Child("run", file, "--duration", "200ms", "--preemption", "auto", "--out", folder / "out",
                  prepare=drop_realtime).end({0})
    summary = json.loads((folder / "out" / "summary.json").read_text())
    expect(summary["run"]["preemption"] == "cooperative", f"auto became {summary['run']['preemption']}")
    child = Child("run", file, "--preemption", "os", prepare=drop_realtime).end({2})
    expect("cap_sys_nice" in child.err.lower(), child.err)
    check_results(folder)


def as_nobody(limit=None):
    def prepare():
        if limit:
            resource.setrlimit(*limit)
        os.setgid(NOBODY)
        os.setuid(NOBODY)

    if os.geteuid() != 0:
        raise Skipped("only root can become somebody whom limits hold for")
    return prepare


def for_everybody(folder, rng):
    """Copies the program and a workload to where `nobody` may read them."""
    program = folder / "redag"
    shutil.copy(PROGRAM, program)
    program.chmod(0o755)
    folder.chmod(0o755)
    return program, workload(rng, folder)


def no_threads(rng, folder):
    """RLIMIT_NPROC: only some of the threads, or none, can be created."""
    program, file = for_everybody(folder, rng)
    limit = (resource.RLIMIT_NPROC, (rng.randint(1, 6),) * 2)
    arguments = ["run", file, "--duration", "100ms", "--workers", rng.randint(1, 64), "--preemption", "none"]
    if rng.random() < 0.3:
        arguments = ["experiment", acceptance_plan(folder, 20), "--out", "/dev/shm/none"]
    child = Child(*arguments, executable=program, prepare=as_nobody(limit)).end()
    check_results(folder)


def read_only(rng, folder):
    """Writes into a folder of another user."""
    program, file = for_everybody(folder, rng)
    (folder / "out").mkdir(mode=0o755)
    command = rng.choice([["run", file, "--duration", "100ms"], ["simulate", file], ["compare", file, "--simulate"],
                          ["experiment", acceptance_plan(folder, 2)]])
    target = folder / "out" if rng.random() < 0.5 else folder / "out" / "deeper"
    child = Child(*command, "--out", target, executable=program, prepare=as_nobody()).end({2})
    expect("Permission denied" in child.err, child.err)
    expect(not list((folder / "out").iterdir()), "something was written")


def writing_command(rng, folder, out):
    file = workload(rng, folder)
    return rng.choice([
        ["simulate", file, "--duration", "2s", "--out", out],
        ["compare", file, "--simulate", "--duration", "1s", "--out", out],
        ["run", file, "--duration", "200ms", "--preemption", "none", "--out", out],
        ["experiment", acceptance_plan(folder, 50), "--out", out],
    ])


def small_files(rng, folder):
    """RLIMIT_FSIZE: every file is cut off at a random size."""
    size = rng.choice([0, rng.randrange(1000), rng.randrange(100_000)])
    arguments = writing_command(rng, folder, folder / "out")
    Child(*arguments, prepare=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))).end()
    check_results(folder)


class Tmpfs:
    def __init__(self, folder, size):
        self.folder = folder
        folder.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", folder], capture_output=True,
                          check=False).returncode != 0:
            raise Skipped("a small file system cannot be mounted here")

    def __enter__(self):
        return self.folder

    def __exit__(self, *_):
        subprocess.run(["umount", self.folder], check=True)


def full_disk(rng, folder):
    """A small disk: an experiment continues once there is room."""
    with Tmpfs(folder / "disk", rng.choice([4096, 16384, 65536, 300_000])) as disk:
        arguments = writing_command(rng, folder, disk / "out")
        child = Child(*arguments).end()
        check_results(disk)
        if "experiment" not in arguments or child.status == 0:
            return
        subprocess.run(["mount", "-o", "remount,size=50M", disk], check=True)
        Child(*arguments).end({0})
        Child(*arguments[:-1], folder / "elsewhere").end({0})
        same = (disk / "out" / "results.csv").read_bytes() == (folder / "elsewhere" / "results.csv").read_bytes()
        expect(same, "the results differ from those of an experiment that was not interrupted")


def killed(rng, folder):
    """kill -9 during an experiment, several times: no unit is lost or counted twice."""
    plan = acceptance_plan(folder, 100, rng.randrange(1000))
    arguments = ["experiment", plan, "--jobs", rng.randint(1, 3), "--out"]
    for _ in range(rng.randint(1, 4)):
        child = Child(*arguments, folder / "out")
        time.sleep(rng.uniform(0, 0.5))
        child.send(signal.SIGKILL)
        child.end({0, -signal.SIGKILL})
    Child(*arguments, folder / "out").end({0})
    Child(*arguments, folder / "whole").end({0})
    same = (folder / "out" / "results.csv").read_bytes() == (folder / "whole" / "results.csv").read_bytes()
    expect(same, "the results differ from those of an experiment that was not killed")


@functools.cache
def least_memory():
    """Finds the MiB of address space below which the kernel kills the program while mapping it, before it begins."""
    def begins(limit):
        limits = (limit << 20, limit << 20)
        return subprocess.run([PROGRAM, "--version"], capture_output=True, check=False,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, limits)).returncode != -signal.SIGSEGV
    return next(limit for limit in range(8, 1024, 4) if begins(limit))


def little_memory(rng, folder):
    """RLIMIT_AS: an allocation fails somewhere."""
    file = workload(rng, folder, tasks=rng.choice([4, 40, 400]))
    limit = (least_memory() + rng.randint(0, 152)) << 20
    command = rng.choice([["validate", file], ["simulate", file, "--duration", "5s", "--out", folder / "out"],
                          ["analyze", file], ["run", file, "--duration", "100ms", "--preemption", "none"],
                          ["generate", "--dags", "20000"], ["tune", "--judge", "bounds", SOURCE / "workloads" / "robot.yaml"],
                          ["experiment", acceptance_plan(folder, 5), "--out", folder / "out"]])
    # 127: the loader had no room for the program's libraries.
    child = Child(*command, prepare=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit))).end(GOOD | {127})
    check_results(folder)


def few_files(rng, folder):
    """RLIMIT_NOFILE, and closed standard streams."""
    limit = rng.randint(4, 12)
    closed = [descriptor for descriptor in (0, 1, 2) if rng.random() < 0.3]

    def prepare():
        for descriptor in closed:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit))

    arguments = writing_command(rng, folder, folder / "out")
    child = Child(*arguments, prepare=prepare)
    if 2 in closed:
        child.process.stderr = None
    child.end(GOOD | {127})
    check_results(folder)


FAULTS = [interrupted, stopped, fewer_processors, throttled, clock_jumps, without_realtime, no_threads, read_only,
          small_files, full_disk, killed, little_memory, few_files]


def try_one(fault, seed):
    with tempfile.TemporaryDirectory(prefix="redag_chaos_") as name:
        fault(random.Random(f"{fault.__name__} {seed}"), pathlib.Path(name))


def main():
    global PROGRAM, SOURCE, CLOCK
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=1, help="of each fault")
    parser.add_argument("--seed", type=int, default=1, help="of the first run; the others follow")
    parser.add_argument("--fault", action="append", choices=[fault.__name__ for fault in FAULTS])
    parser.add_argument("--clock", type=pathlib.Path, help="of clock_jumps: redag_jumping_clock as it was built")
    options = parser.parse_args()
    CLOCK = options.clock and options.clock.resolve()
    PROGRAM, SOURCE = options.program.resolve(), options.source.resolve()
    failed = 0
    for fault in FAULTS:
        if options.fault and fault.__name__ not in options.fault:
            continue
        survived = 0
        why = ""
        for seed in range(options.seed, options.seed + options.runs):
            try:
                try_one(fault, seed)
                survived += 1
            except Skipped as skip:
                why = f" (skipped: {skip})"
                break
            except Broken as broken:
                failed += 1
                print(f"{fault.__name__}, seed {seed}: {broken}", file=sys.stderr, flush=True)
        print(f"{fault.__name__:18} {survived:6} survived{why}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
