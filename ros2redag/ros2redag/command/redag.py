# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""The command `ros2 redag`."""

from ros2cli.command import CommandExtension, add_subparsers_on_demand


class RedagCommand(CommandExtension):
    """Watch ReDAG executors, and make reports of their runs."""

    def add_arguments(self, parser, cli_name):
        self._subparser = parser
        add_subparsers_on_demand(parser, cli_name, '_verb', 'ros2redag.verb', required=False)

    def main(self, *, parser, args):
        if not hasattr(args, '_verb'):
            self._subparser.print_help()
            return 0
        return args._verb.main(args=args)
