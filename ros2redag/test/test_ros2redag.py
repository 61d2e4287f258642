# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Runs `ros2 redag` of the installed ros2cli, with a program `redag` that prints its arguments."""

import os
import signal
import subprocess
import sys

import pytest

pytest.importorskip('ros2cli', reason='the package ros2cli is not installed')

ROS2 = [sys.executable, '-c', 'import sys; from ros2cli.cli import main; sys.exit(main())']
PROGRAM = """#!/bin/sh
printf '<%s>' "$@"
exit 7
"""


@pytest.fixture
def program(tmp_path):
    """Put a program `redag` first in PATH, and return its path."""
    path = tmp_path / 'redag'
    path.write_text(PROGRAM)
    path.chmod(0o755)
    return path


def environment_with(folder):
    return {**os.environ, 'PATH': f'{folder}{os.pathsep}{os.environ["PATH"]}'}


def ros2(folder, *arguments):
    return subprocess.run([*ROS2, *arguments], env=environment_with(folder), capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize('verb', ['top', 'report'])
@pytest.mark.parametrize('arguments', [
    [], ['--help'], ['-h'], ['--once', '1234'], ['a', '-o', 'b c'], ['--', '-x'], ['--json=1', 'results']])
def test_arguments_reach_the_program(program, verb, arguments):
    done = ros2(program.parent, 'redag', verb, *arguments)
    assert done.stdout == ''.join(f'<{text}>' for text in [verb, *arguments]), done.stderr
    assert done.returncode == 7


def test_help_lists_the_verbs(program):
    for arguments in (['redag'], ['redag', '--help']):
        done = ros2(program.parent, *arguments)
        assert done.returncode == 0, done.stderr
        for text in ('top     Show the callbacks of running executors in the terminal',
                     'report  Make a page of recorded runs'):
            assert text in done.stdout


def test_ros2_lists_the_command(program):
    assert 'Watch ReDAG executors, and make reports of their runs' in ros2(program.parent, '--help').stdout


def test_an_unknown_verb_is_an_error(program):
    done = ros2(program.parent, 'redag', 'topp')
    assert done.returncode == 2
    assert "invalid choice: 'topp'" in done.stderr


def test_without_the_program_the_message_says_where_it_is(tmp_path):
    done = subprocess.run([*ROS2, 'redag', 'top'], env={**os.environ, 'PATH': str(tmp_path)}, capture_output=True, text=True,
                          timeout=60)
    assert done.returncode == 1
    assert 'package redag_lab' in done.stderr


def test_signals_reach_the_program(program):
    """The program takes the place of ros2: no second process is left."""
    program.write_text('#!/bin/sh\necho started $$\nexec sleep 60\n')
    process = subprocess.Popen([*ROS2, 'redag', 'top'], env=environment_with(program.parent), stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == f'started {process.pid}\n'
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == -signal.SIGINT
