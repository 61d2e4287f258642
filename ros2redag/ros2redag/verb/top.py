# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""The verb `ros2 redag top`."""

from ros2redag.verb import ProgramVerb


class TopVerb(ProgramVerb):
    """Show the callbacks of running executors in the terminal."""
