#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Compares tables of pages with the code that they describe.

Usage: pages_test.py SOURCE_DIR. Uses the standard library only. tests/cli/usage.py compares what
the program itself can tell.
"""
import importlib.machinery
import importlib.util
import pathlib
import re
import sys
import unittest

SOURCE = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent)


def layers():
    """LAYERS of tools/check_layers, each with all that lies below it."""
    loader = importlib.machinery.SourceFileLoader("check_layers", str(SOURCE / "tools" / "check_layers"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    sys.dont_write_bytecode = True
    loader.exec_module(module)
    below = {layer: {module.layer_of(place) for place in allowed} - {None, layer}
             for layer, allowed in module.LAYERS.items()}
    for _ in below:
        for places in below.values():
            places.update(*(below[place] for place in list(places)))
    return module.layer_of, below


def first_cells(page, heading):
    """Returns the code spans in the first column of the first table below a heading."""
    text = (SOURCE / page).read_text(encoding="utf-8").split(f"\n## {heading}\n", maxsplit=1)[1]
    rows = re.search(r"(?:^\|.*\n)+", text, re.M)[0].splitlines()[2:]
    return [span for row in rows for span in re.findall(r"`([^`]+)`", row.split("|")[1])]


class Pages(unittest.TestCase):
    def test_ros2_lists_the_parameters(self):
        sources = [f for f in SOURCE.glob("ros/redag_rclcpp/src/**/*.cpp")
                   if f.name in ("options.cpp", "parameter_reader.cpp", "monitor_options.cpp")]
        self.assertEqual(len(sources), 3, sources)
        text = "".join(file.read_text(encoding="utf-8") for file in sources)
        declared = re.findall(r'(?:\{|word\()\s*"([a-z_]+)",\s*(?!"[a-z]+"[,}])"', text)  # not lists of words
        self.assertGreater(len(declared), 15)
        declared += re.findall(r'\.find\("([a-z_]+)"\)', text)  # declared by rclcpp's container
        self.assertEqual(sorted(first_cells("docs/ros2.md", "Parameters")), sorted(declared))

    def test_the_map_has_every_page(self):
        """The README.md of docs/, or of a page's own folder, links every page. docs/site/ has the front of the site."""
        docs = (SOURCE / "docs").resolve()
        maps = {docs / "README.md", *docs.glob("*/README.md")}
        linked = {(page.parent / target).resolve() for page in maps
                  for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8"))}
        pages = {page for page in docs.rglob("*.md") if page.parent != docs / "site"}
        self.assertEqual(pages - linked - {docs / "README.md"}, set())

    def test_no_walk_takes_a_step_back_up(self):
        """Each step of a walk is a file of its own, not in a layer above the step before, and has what is named."""
        layer_of, below = layers()
        text = (SOURCE / "docs/life_of_a_job.md").read_text(encoding="utf-8").split("\n## Where values go\n")[1]
        steps = [re.findall(r"^\d+\. `([^`]+)`(.*(?:\n   .*)*)", walk, re.M) for walk in text.split("\n### ")[1:]]
        self.assertEqual(len(steps), 2)
        for file, said in (step for walk in steps for step in walk):
            source = (SOURCE / file).read_text(encoding="utf-8")
            for name in re.findall(r"`(?:\w+::)*(\w+)(?:\(\))?`", said):
                self.assertRegex(source, rf"\b{name}\b", f"{file} has no {name}")
        for walk in ([file for file, _ in walk] for walk in steps):
            self.assertGreater(len(walk), 5)
            self.assertEqual(len(walk), len(set(walk)), walk)
            for file in walk:
                self.assertTrue((SOURCE / file).is_file(), file)
            for before, after in zip(walk, walk[1:]):
                self.assertNotIn(layer_of(before), below[layer_of(after)], f"{before}, then {after}")

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
