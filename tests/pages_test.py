#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Compares tables of pages with the code that they describe.

Usage: pages_test.py SOURCE_DIR. Uses the standard library only. tests/cli/usage.py compares what
the program itself can tell.
"""
import pathlib
import re
import sys
import unittest

SOURCE = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent)


def first_cells(page, heading):
    """Returns the code spans in the first column of the first table below a heading."""
    text = (SOURCE / page).read_text(encoding="utf-8").split(f"\n## {heading}\n", maxsplit=1)[1]
    rows = re.search(r"(?:^\|.*\n)+", text, re.M)[0].splitlines()[2:]
    return [span for row in rows for span in re.findall(r"`([^`]+)`", row.split("|")[1])]


class Pages(unittest.TestCase):
    def test_ros2_lists_the_parameters(self):
        sources = [f for f in SOURCE.glob("redag_rclcpp*/**/*.cpp") if f.name == "options.cpp"]
        self.assertEqual(len(sources), 1, sources)
        declared = re.findall(r'\{"([a-z_]+)",\s*"', sources[0].read_text(encoding="utf-8"))
        self.assertGreater(len(declared), 15)
        self.assertEqual(sorted(first_cells("docs/ros2.md", "Parameters")), sorted(declared))

    def test_the_map_has_every_page(self):
        """The README.md of docs/, or of a page's own folder, links every page."""
        docs = (SOURCE / "docs").resolve()
        maps = {docs / "README.md", *docs.glob("*/README.md")}
        linked = {(page.parent / target).resolve() for page in maps
                  for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8"))}
        self.assertEqual(set(docs.rglob("*.md")) - linked - {docs / "README.md"}, set())

    def test_contributing_lists_the_targets_of_the_makefile(self):
        makefile = (SOURCE / "Makefile").read_text(encoding="utf-8")
        targets = set(re.findall(r"^([a-z]+):.*## ", makefile, re.M)) - {"help", "demo", "install", "clean"}
        cells = first_cells("CONTRIBUTING.md", "Build and test")
        self.assertEqual({cell[len("make "):] for cell in cells if cell.startswith("make ")}, targets)

    def test_contributing_says_what_ci_runs(self):
        stages = set(re.findall(r"^stage \w+ make (\w+)", (SOURCE / ".ci" / "run").read_text(encoding="utf-8"), re.M))
        row = re.search(r"^\| `\.ci/run` \|(.*)\|$", (SOURCE / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.M)[1]
        self.assertEqual({span.replace("make ", "") for span in re.findall(r"`([^`]+)`", row)}, stages)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
