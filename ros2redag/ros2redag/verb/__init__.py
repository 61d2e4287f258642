# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""The extension point of verbs, and the verbs that are commands of the program `redag`."""

import argparse
import os
import shutil

from ros2cli.plugin_system import PLUGIN_SYSTEM_VERSION, satisfies_version

PROGRAM = 'redag'  # of the package redag_lab


class VerbExtension:
    """
    The extension point for verbs of `ros2 redag`.

    A verb defines `main`, and may define `add_arguments`. Its `NAME` is that of its entry point.
    """

    NAME = None
    EXTENSION_POINT_VERSION = '0.1'

    def __init__(self):
        super().__init__()
        satisfies_version(PLUGIN_SYSTEM_VERSION, '^0.1')

    def add_arguments(self, parser, cli_name):
        pass

    def main(self, *, args):
        raise NotImplementedError()


class ProgramVerb(VerbExtension):
    """Runs the command of the same name of the program `redag`, with all arguments as they are."""

    def add_arguments(self, parser, cli_name):
        # The program alone knows its options, and prints its own help: no argument is an option for this parser.
        parser.prefix_chars = '\0'
        parser.add_argument('arguments', nargs=argparse.REMAINDER, help='see `redag` and the name of this verb, with --help')

    def main(self, *, args):
        program = shutil.which(PROGRAM)
        if program is None:
            return (f'There is no program `{PROGRAM}` in PATH. It is in the package redag_lab: build or install it, and '
                    'source the setup file of its workspace.')
        # Its signals, terminal and exit code are those of the program.
        os.execv(program, [program, self.NAME, *args.arguments])
