# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""The verb `ros2 redag report`."""

from ros2redag.verb import ProgramVerb


class ReportVerb(ProgramVerb):
    """Make a page of recorded runs."""
