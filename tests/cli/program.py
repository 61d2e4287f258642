# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Shared by the tests of the program: how to call it, and a folder for each test.

The first two arguments of the importing script are the program and the source tree.
"""
import fcntl
import json
import os
import pathlib
import pty
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest
import zlib

if len(sys.argv) < 3:
    sys.exit(f"usage: {sys.argv[0]} PROGRAM SOURCE_DIR [unittest arguments]")
PROGRAM, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
os.environ.pop("COLUMNS", None)  # tests choose the width themselves
# Set for builds with sanitizers, which run several times slower. They look for other faults than these tests, which
# also run in full without sanitizers.
SANITIZED = os.environ.get("REDAG_SANITIZED") == "1"

CART = """\
name: cart
platform: {workers: 1, preemption: none}
dags:
  - name: fast
    tasks: [{name: sense, wcet: 1ms, period: 10ms}, {name: act, wcet: 1ms, activation: data, after: sense}]
  - name: slow
    tasks: [{name: plan, wcet: 25ms, period: 100ms}]
"""
MISTAKEN = """\
name: cart
platform: {workers: 1}
dags:
  - name: fast
    tasks:
      - {name: sense, wect: 1ms, period: 10ms}
      - {name: act, wcet: 1, activation: data, after: sense}
"""


def redag(*arguments, text=None, **options):
    return subprocess.run([PROGRAM, *map(str, arguments)], input=text, capture_output=True, text=True, timeout=250,
                          check=False, **options)


def body(text):
    """Removes provenance from a JSON document: the rest must be equal for equal input."""
    document = json.loads(text)
    del document["provenance"]
    return json.dumps(document)


def changed_run(events, old, new):
    """Returns the bytes of an events.redag with a change in the description of the run."""
    size, = struct.unpack_from("<I", events, 16 + 8)
    text = zlib.decompress(events[48:48 + size]).decode()
    if old not in text:
        raise AssertionError(f"the run has no {old}")
    packed = zlib.compress(text.replace(old, new, 1).encode())
    header = struct.pack("<III", 1, len(packed), len(text) - len(old) + len(new)) + events[32:48]
    return events[:16] + struct.pack("<I", zlib.crc32(header + packed)) + header + packed + events[48 + size:]


def interrupt(process, after=0.0, by=signal.SIGINT):
    """Interrupts a process `after` s after it has begun to listen for the signal, which would kill it before."""
    listens = 0
    while process.poll() is None and not listens >> (by - 1) & 1:
        time.sleep(0.01)
        status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
        listens = sum(int(line.split()[1], 16) for line in status.splitlines() if line.startswith("SigCgt:"))
    time.sleep(after)
    process.send_signal(by)


def units(folder):
    """Returns the finished units of an experiment: {unit: result}."""
    rows = [row.split(",", 2)[1:] for file in folder.glob("units*.csv") for row in file.read_text().splitlines()[1:]]
    return {int(row[0]): row[1] for row in rows if len(row) == 2}


def wait_for_units(case, process, folder, more=3):
    """Waits until a run has written some units more than are there."""
    before = len(units(folder))
    deadline = time.monotonic() + 60
    while len(units(folder)) < before + more:
        case.assertIsNone(process.poll(), "it ended before it could be disturbed")
        case.assertLess(time.monotonic(), deadline)
        time.sleep(0.01)


def in_terminal(*arguments, columns=80, **environment):
    """Runs a command on a pseudo-terminal. Returns the exit status and all output."""
    try:
        pid, terminal = pty.fork()
    except OSError as error:  # there is no /dev/pts in this chroot
        raise unittest.SkipTest(f"no pseudo-terminal to be had here: {error}") from error
    if pid == 0:
        os.environ.update(TERM="xterm", **environment)
        try:
            while os.get_terminal_size(0).columns == 0:  # the other side has not set it yet
                time.sleep(0.001)
            os.execv(PROGRAM, [str(PROGRAM), *map(str, arguments)])
        finally:
            os._exit(127)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    text = b""
    while True:
        try:
            block = os.read(terminal, 65536)
        except OSError:  # Linux returns EIO once the other end is closed
            break
        if not block:
            break
        text += block
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), text.decode()


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.cart = self.write("cart.yaml", CART)

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text)
        return path

    def expect(self, result, status, *errors):
        self.assertEqual(result.returncode, status, result.stderr + result.stdout)
        for error in errors:
            self.assertIn(error, result.stderr)
        return result

    def document(self, result, form, status=0):
        """Checks that standard output is one JSON document and nothing else."""
        self.expect(result, status)
        document = json.loads(result.stdout)
        self.assertEqual(document["format"], form)
        return document


def main():
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
